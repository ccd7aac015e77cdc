// Vectors are arrays of 3; rotations are 9 numbers, row after row. Cameras have OpenCV axes: x right, y down, z forward.
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => times(a, 1 / (Math.hypot(...a) || 1));
const turn = (r, a) => [dot(r.slice(0, 3), a), dot(r.slice(3, 6), a), dot(r.slice(6, 9), a)];
const turnBack = (r, a) => [0, 1, 2].map(i => r[i] * a[0] + r[3 + i] * a[1] + r[6 + i] * a[2]);

// An eye: what draws the scene. `rotation` and `offset` take scene points to its axes, `lens` is fx, fy, cx, cy in pixels.
function lookFrom(place, target, lens) {
  const forward = unit(sub(target, place));
  const right = unit(cross(forward, Math.abs(forward[2]) > 0.9999 ? [0, 1, 0] : [0, 0, 1]));
  const rotation = [...right, ...cross(forward, right), ...forward];
  return { rotation, offset: times(turn(rotation, place), -1), lens };
}

// Pixel of a scene point, or null where it lies behind the eye.
function pixelOf(eye, point) {
  const [x, y, z] = add(turn(eye.rotation, point), eye.offset);
  if (z <= eye.near) return null;
  const [fx, fy, cx, cy] = eye.lens;
  return [fx * x / z + cx, fy * y / z + cy];
}

// Column-major matrix from camera axes to clip space.
function projection(eye, width, height) {
  const [fx, fy, cx, cy] = eye.lens, n = eye.near, f = eye.far;
  return [
    2 * fx / width, 0, 0, 0,
    0, -2 * fy / height, 0, 0,
    2 * cx / width - 1, 1 - 2 * cy / height, (f + n) / (f - n), 1,
    0, 0, -2 * f * n / (f - n), 0,
  ];
}
