"use strict";
// Everything of the site is put on the page as text (textContent, attributes), never as HTML.
const CLASSES = ["bird", "drone", "airplane", "helicopter"];
const token = new URLSearchParams(location.search).get("token");
const byId = (id) => document.getElementById(id);

const node = (name, attributes, text) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
};

const row = (cells) => {
  const made = document.createElement("tr");
  for (const [text, kind] of cells) {
    const cell = document.createElement("td");
    cell.textContent = text;
    if (kind) cell.className = kind;
    made.append(cell);
  }
  return made;
};

const isSilent = (shown, name) => Boolean(shown.health && shown.health.cameras[name] && shown.health.cameras[name].silent);
const answerOf = (track) => track.label || `${track.status} (${track.most_likely} ${(100 * track.probabilities[track.most_likely]).toFixed(0)} %)`;
const kindOf = (track) => (CLASSES.includes(track.label) ? track.label : ""); // unknown is drawn grey
const speedOf = (track) => (track.velocity ? Math.hypot(...track.velocity).toFixed(1) : "");
const clock = (time) => new Date(time).toLocaleTimeString();

const words = (event) => {
  switch (event.type) {
    case "started": return `started with ${event.cameras.length} cameras` + (event.resumed === null ? "" : `, goes on behind frame ${event.resumed}`);
    case "appeared": return `track ${event.track} appeared`;
    case "lost": return `track ${event.track} lost`;
    case "camera": return `camera ${event.camera === null ? "(all)" : event.camera} ${event.state}: ${event.text}`;
    case "dropped": return `${event.frames} frames dropped, ${event.total} in all`;
    default: return `${event.type}: ${event.text || ""}`;
  }
};

// Round steps of 1, 2 or 5 times a power of ten, about six of them.
const stepOf = (span) => {
  const raw = span / 6, power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= raw);
};

const draw = (shown) => {
  const map = byId("map"), cameras = shown.started ? shown.started.cameras : [];
  const places = [...cameras.map((one) => one.position), ...shown.tracks.flatMap((one) => one.trail)];
  map.replaceChildren();
  if (!places.length) return;
  const xs = places.map((one) => one[0]), ys = places.map((one) => one[1]);
  const middle = [(Math.min(...xs) + Math.max(...xs)) / 2, (Math.min(...ys) + Math.max(...ys)) / 2];
  const span = 1.3 * Math.max(Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys), 1);
  const at = (x, y) => [320 + (640 * (x - middle[0])) / span, 320 - (640 * (y - middle[1])) / span];
  const step = stepOf(span), list = (points) => points.map((one) => one.map((v) => v.toFixed(1)).join(",")).join(" ");
  for (let i = Math.ceil((middle[0] - span / 2) / step); i * step < middle[0] + span / 2; i++) {
    const [x] = at(i * step, 0);
    map.append(node("line", { class: "grid", x1: x, x2: x, y1: 0, y2: 640 }), node("text", { x: x + 2, y: 636 }, +(i * step).toPrecision(6)));
  }
  for (let i = Math.ceil((middle[1] - span / 2) / step); i * step < middle[1] + span / 2; i++) {
    const [, y] = at(0, i * step);
    map.append(node("line", { class: "grid", x1: 0, x2: 640, y1: y, y2: y }), node("text", { x: 2, y: y - 2 }, +(i * step).toPrecision(6)));
  }
  for (const camera of cameras) {
    const [x, y] = at(camera.position[0], camera.position[1]);
    const ends = camera.view.map((ray) => at(camera.position[0] + 0.3 * span * ray[0], camera.position[1] + 0.3 * span * ray[1]));
    const kind = isSilent(shown, camera.name) ? "camera bad" : "camera";
    map.append(node("polygon", { class: "sight", points: list([[x, y], ...ends]) }));
    map.append(node("circle", { class: kind, cx: x, cy: y, r: 5 }), node("text", { x: x + 7, y: y - 6 }, camera.name));
  }
  for (const track of shown.tracks) {
    const path = track.trail.map((place) => at(place[0], place[1])), [x, y] = path[path.length - 1], kind = kindOf(track);
    map.append(node("polyline", { class: `trail ${kind}`, points: list(path) }));
    map.append(node("circle", { class: `spot ${kind}`, cx: x, cy: y, r: 5 }), node("text", { x: x + 7, y: y + 4 }, `${track.track}: ${track.label || track.status}`));
  }
  byId("scale").textContent = `Lines every ${step} m; +x right, +y up.`;
};

const tell = (shown) => {
  byId("tracks").replaceChildren(...shown.tracks.map((one) => row([[one.track], [answerOf(one)], [one.position[2].toFixed(1)], [speedOf(one)]])));
  byId("none").hidden = shown.tracks.length > 0;
  byId("events").replaceChildren(...shown.events.map((one) => row([[clock(one.time), "time"], [words(one)]])));
  const health = shown.health, silent = health ? Object.keys(health.cameras).filter((name) => health.cameras[name].silent) : [];
  const facts = health ? [
    ["frames a second", health.rate.toFixed(1)],
    ["frame to track, ms", health.latency_ms ? `${health.latency_ms.p50.toFixed(0)} (95 %: ${health.latency_ms.p95.toFixed(0)})` : ""],
    ["frames", health.frames], ["dropped", health.dropped], ["waiting", health.waiting],
    ["memory, MB", health.resources.resident_mb.toFixed(0)],
    ["silent cameras", silent.join(", ") || "none"],
  ] : [];
  byId("figures").replaceChildren(...facts.map(([name, value]) => row([[name], [value]])));
};

const say = (text, bad) => {
  byId("state").textContent = text;
  byId("state").className = bad ? "bad" : "";
};

const ask = async () => {
  try {
    const answer = await fetch("state" + (token === null ? "" : `?token=${encodeURIComponent(token)}`), { cache: "no-store" });
    if (!answer.ok) throw new Error(`the server says ${answer.status}`);
    const shown = await answer.json();
    draw(shown);
    tell(shown);
    say(shown.health ? `${shown.tracks.length === 1 ? "1 track" : `${shown.tracks.length} tracks`}, ${shown.health.rate.toFixed(1)} frames a second` : "waiting for frames", false);
  } catch (error) {
    say(`no answer: ${error.message}`, true);
  }
  setTimeout(ask, 500);
};
ask();
