// The player: one slider for the scene, the cameras' pictures and the plots.
const data = JSON.parse(document.getElementById("data").textContent);
const get = id => document.getElementById(id);
const all = (selector, within = document) => [...within.querySelectorAll(selector)];
if (!data.steps.length || !get("player")) return;

const slider = get("slider"), play = get("play"), now = get("now"), detail = get("detail"), speed = get("speed");
const figures = all(".camera"), marks = all(".strip i"), values = all(".sofar .value");
const cursors = all(".cursor").map(g => [g, g.dataset.at.split(" ")]);
const over = { outline: true, box: true, place: true, splats: false };
slider.max = data.steps.length - 1;
slider.value = Math.max(0, data.steps.findIndex(step => !step.dropped));
document.documentElement.classList.add("scripted");

let viewer = null;
try {
  viewer = new Viewer(get("scene"), data, showView);
  get("scene").classList.add("live");
} catch (error) {
  get("keys").textContent = "The scene needs WebGL2, which this browser does not offer: this is a still picture.";
}

function setRectangle(node, [x0, y0, x1, y1]) {
  const sides = { x: x0, y: y0, width: x1 - x0, height: y1 - y0 };
  for (const key in sides) node.setAttribute(key, Math.max(0, sides[key]));
}

function sizeOf(crop) {
  const [x0, y0, x1, y1] = crop.object || [0, 0, 0, 0], scale = (crop.box[2] - crop.box[0]) / crop.size[0];
  return `${Math.round((x1 - x0) * scale)} × ${Math.round((y1 - y0) * scale)} px`;
}

// Own keys only: a camera may be called "constructor".
function cropOf(step, camera) {
  return step.crops && Object.hasOwn(step.crops, camera) ? step.crops[camera] : null;
}

function showCrop(figure, crop, dropped) {
  figure.classList.toggle("absent", !crop);
  figure.querySelector(".where").textContent = crop ? sizeOf(crop) : dropped ? "frame dropped" : "not used";
  if (!crop) return;
  figure.querySelector("img").setAttribute("src", crop.jpeg);
  const drawn = figure.querySelector(".over"), place = figure.querySelector(".place");
  drawn.setAttribute("viewBox", `0 0 ${crop.size[0]} ${crop.size[1]}`);
  drawn.querySelector("path").setAttribute("d", crop.outline);
  setRectangle(drawn.querySelector("rect"), crop.object || [0, 0, 0, 0]);
  place.setAttribute("viewBox", `0 0 ${crop.full[0]} ${crop.full[1]}`);
  setRectangle(place.querySelector("rect"), crop.box);
}

// The Gaussians as each camera would see them, over its picture; drawn once a frame of the screen at most.
let stamp = null, waiting = false;
function requestOver() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; drawOver(data.steps[+slider.value]); });
}
function drawOver(step) {
  if (!over.splats || step.dropped) return;
  if (!stamp) {
    const canvas = document.createElement("canvas"), gl = canvas.getContext("webgl2", { antialias: false });
    if (!gl) return;
    canvas.width = canvas.height = 224;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    stamp = { canvas, gl, layer: new SplatLayer(gl) };
  }
  const { canvas, gl, layer } = stamp;
  layer.set(viewer.splatsOf(+slider.value));
  gl.viewport(0, 0, canvas.width, canvas.height);
  figures.forEach((figure, i) => {
    const crop = cropOf(step, data.cameras[i]), picture = figure.querySelector(".drawn");
    if (!crop) return;
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    layer.draw(eyeOfCrop(crop, step.centre, canvas.width, canvas.height), step.centre, canvas.width, canvas.height, 1);
    Object.assign(picture, { width: canvas.width, height: canvas.height });
    picture.getContext("2d").drawImage(canvas, 0, 0);
  });
}

function describe(step) {
  if (step.dropped) return `dropped: ${step.dropped}`;
  const place = step.place.map((v, i) => `${"xyz"[i]} ${v === null ? "?" : v.toFixed(2)}`).join("  ");
  return `${(step.frame / data.fps).toFixed(3)} s · ${place} m · ${step.count} Gaussians`;
}

// Of a dropped frame, those after the last one before it that was used.
function showValues(index) {
  const step = data.steps.slice(0, index + 1).findLast(one => !one.dropped);
  if (!step) return;
  values.forEach((node, i) => {
    const p = step.probabilities[i];
    node.textContent = p === null ? "?" : `${(100 * p).toFixed(1)} %`;
  });
}

function show() {
  const index = +slider.value, step = data.steps[index];
  now.textContent = `frame ${step.frame}`;
  detail.textContent = describe(step);
  detail.classList.toggle("lost", Boolean(step.dropped));
  slider.setAttribute("aria-valuetext", now.textContent + (step.dropped ? ", dropped" : ""));
  figures.forEach((figure, i) => showCrop(figure, cropOf(step, data.cameras[i]), step.dropped));
  for (const [g, places] of cursors) g.setAttribute("transform", `translate(${places[step.index]})`);
  marks.forEach((mark, i) => mark.classList.toggle("here", i === index));
  showValues(index);
  if (!viewer) return;
  if (over.splats) requestOver();
  viewer.step = index;
  showBehind();
  viewer.request();
}

function showView() {
  const { view } = viewer.orbit, through = get("scene").querySelector(".through");
  for (const button of all("[data-view]")) button.setAttribute("aria-pressed", String(button.dataset.view === String(view)));
  through.hidden = typeof view !== "number";
  through.querySelector("b").textContent = `through ${data.cameras[view]}`;
  showBehind();
}

// The camera's own picture behind what is seen through it: both are whole and in the middle of the same frame.
function showBehind() {
  const { view } = viewer.orbit, picture = get("scene").querySelector(".behind");
  const crop = typeof view === "number" && cropOf(data.steps[viewer.reconstructed()], data.cameras[view]);
  picture.hidden = !crop || !get("behind").checked;
  if (crop) picture.setAttribute("src", crop.jpeg);
}
get("behind").addEventListener("change", showBehind);

function look(view) {
  if (!viewer || +view >= data.scene.rig.length) return; // a camera that is not calibrated in the report has no eye
  viewer.change(() => viewer.orbit.look(/^\d+$/.test(view) ? +view : view));
}

for (const button of all("[data-view]")) button.addEventListener("click", () => {
  look(button.getAttribute("aria-pressed") === "true" && button.classList.contains("look") ? "object" : button.dataset.view);
});
for (const box of all("[data-show]")) box.addEventListener("change", () => {
  if (viewer) viewer.change(() => { viewer.shown[box.dataset.show] = box.checked; });
});
for (const box of all("[data-over]")) box.addEventListener("change", () => setOver(box.dataset.over, box.checked));
function setOver(name, on) {
  over[name] = on;
  get("player").classList.toggle(`without-${name}`, !on);
  show();
}
get("player").classList.add("without-splats");

let running = null;
function stop() {
  running = null;
  play.classList.remove("running");
  play.setAttribute("aria-label", "Play");
}
function run(last) {
  running = requestAnimationFrame(time => {
    if (running === null) return;
    const passed = (time - last) / 1000 * data.fps * +speed.value;
    if (passed < 1) return run(last);
    slider.value = (+slider.value + Math.max(1, Math.min(5, Math.floor(passed)))) % data.steps.length;
    show();
    run(time);
  });
}
function toggle() {
  if (running !== null) return stop();
  play.classList.add("running");
  play.setAttribute("aria-label", "Pause");
  run(performance.now());
}
function stepBy(count) {
  stop();
  slider.value = (+slider.value + count + data.steps.length) % data.steps.length;
  show();
}
play.addEventListener("click", toggle);
slider.addEventListener("input", () => { stop(); show(); });
document.addEventListener("keydown", event => {
  if (event.target.closest?.("button, select, input:not([type=range])")) return;
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const act = { " ": toggle, ",": () => stepBy(-1), ".": () => stepBy(1) }[event.key];
  if (!act) return;
  event.preventDefault();
  act();
});

// A link can open the page at a frame and a view: #frame=5&view=scene&yaw=40&pitch=20&zoom=2&show=gaussians,track&over=splats
function follow() {
  const wish = new URLSearchParams(location.hash.slice(1));
  if (wish.has("frame")) {
    const index = data.steps.findIndex(step => step.frame === +wish.get("frame"));
    if (index >= 0) slider.value = index;
  }
  if (viewer) {
    const view = wish.get("view") ?? viewer.orbit.view, named = data.cameras.indexOf(view);
    look(named >= 0 ? String(named) : ["object", "scene"].includes(view) ? view : String(viewer.orbit.view));
    for (const key of ["yaw", "pitch", "zoom"]) {
      const value = parseFloat(wish.get(key));
      if (Number.isFinite(value)) viewer.orbit[key] = value;
    }
    if (wish.has("show")) for (const box of all("[data-show]")) {
      box.checked = viewer.shown[box.dataset.show] = wish.get("show").split(",").includes(box.dataset.show);
    }
  }
  if (wish.has("over")) for (const box of all("[data-over]")) {
    box.checked = wish.get("over").split(",").includes(box.dataset.over);
    setOver(box.dataset.over, box.checked);
  }
  show();
}
window.addEventListener("hashchange", follow);
follow();
