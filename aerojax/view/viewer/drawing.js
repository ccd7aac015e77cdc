// The scene's lines: ground, cameras with their lines of sight, track, axes.
function roundLength(metres) {
  const power = 10 ** Math.floor(Math.log10(metres));
  return power * [5, 2, 1].find(f => f * power <= metres * 1.0001);
}

// Squares of a round size about `middle`, fading outwards.
function groundLines(middle, height, extent, colour) {
  const step = roundLength(extent / 5), n = 12, lines = [];
  const x0 = Math.round(middle[0] / step), y0 = Math.round(middle[1] / step);
  const piece = (x, y, dx, dy) => {
    const far = Math.hypot(x + dx / 2 - middle[0] / step, y + dy / 2 - middle[1] / step) / n;
    const alpha = 0.55 * Math.max(0, 1 - far * far);
    if (alpha > 0.02) lines.push(line([x * step, y * step, height], [(x + dx) * step, (y + dy) * step, height], colour, alpha, 1));
  };
  for (let i = -n; i <= n; i++) for (let j = -n; j < n; j++) {
    piece(x0 + i, y0 + j, 0, 1);
    piece(x0 + j, y0 + i, 1, 0);
  }
  return { step, lines };
}

// The pyramid between a camera's centre and its image at `depth`, with a mark at the image's upper side.
function frustumLines(camera, depth, colour) {
  const [fx, fy, cx, cy, width, height] = camera.lens;
  const at = (u, v) => add(camera.centre, turn(camera.axes, [(u - cx) / fx * depth, (v - cy) / fy * depth, depth]));
  const corners = [at(0, 0), at(width, 0), at(width, height), at(0, height)];
  const dash = camera.suspect ? 7 : 0, lines = [];
  corners.forEach((corner, i) => {
    lines.push(line(camera.centre, corner, colour, 0.9, 1.4, dash), line(corner, corners[(i + 1) % 4], colour, 0.9, 1.8, dash));
  });
  const tip = at(width / 2, -0.22 * height);
  lines.push(line(at(0.38 * width, 0), tip, colour, 0.9, 1.4), line(tip, at(0.62 * width, 0), colour, 0.9, 1.4));
  return lines;
}

// Places so far solid, those to come faint; a gap where a place is unknown; a dot at the first one.
function trackLines(track, step, colour) {
  const lines = [], start = track.find(place => place);
  for (let i = 1; i < track.length; i++) {
    const past = i <= step;
    if (track[i] && track[i - 1]) lines.push(line(track[i - 1], track[i], colour, past ? 1 : 0.35, past ? 2.6 : 1.6));
  }
  if (start) lines.push(line(start, start, colour, 1, 8));
  return lines;
}

// From the object straight down, so that its place over the ground can be seen.
function plumbLines(place, height, colour) {
  const foot = [place[0], place[1], height];
  return [line(place, foot, colour, 0.8, 1.4, 6), line(foot, foot, colour, 0.9, 7)];
}
