// The 4D viewer: one canvas that shows one step of the scene; what it draws is decided by `orbit`, `step` and `shown`.
const GIZMO = 92; // side of the axes' corner, CSS pixels
const AXES = [["x", [1, 0, 0]], ["y", [0, 1, 0]], ["z", [0, 0, 1]]];

class Viewer {
  // `root` holds a canvas, .labels and .scale; `changed` is called after every change of the view.
  constructor(root, data, changed) {
    Object.assign(this, { root, data, changed, step: 0, waiting: false });
    this.canvas = root.querySelector("canvas");
    this.labels = root.querySelector(".labels");
    this.scale = root.querySelector(".scale");
    this.shown = { gaussians: true, cameras: true, sight: false, track: true, axes: true, ground: true };
    const { rig, track, ground } = data.scene, places = track.filter(place => place);
    this.orbit = new Orbit(data.scene, [...rig.map(camera => camera.centre), ...places, ...places.map(([x, y]) => [x, y, ground])]);
    this.unpacked = new Map();
    this.gl = this.canvas.getContext("webgl2", { antialias: false, premultipliedAlpha: true, alpha: true });
    if (!this.gl) throw new Error("no WebGL2");
    this.start();
    this.canvas.addEventListener("webglcontextlost", event => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => { this.start(); this.draw(); });
    listen(this.canvas, {
      orbit: (dx, dy) => this.change(() => this.orbit.orbit(dx, dy, this.place(), this.data.scene.rig)),
      shift: (dx, dy) => this.change(() => this.orbit.shift(dx, dy, this.canvas.clientHeight)),
      zoom: factor => this.change(() => this.orbit.zoomBy(factor)),
      reset: () => this.change(() => { this.orbit.reset(); this.orbit.look("object"); }),
    });
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  start() {
    const gl = this.gl;
    this.splats = new SplatLayer(gl);
    this.lines = new LineLayer(gl);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.clearColor(0, 0, 0, 0);
  }

  change(edit) {
    edit();
    this.changed();
    this.request();
  }

  request() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); });
  }

  // The step itself, or the last one before it that has Gaussians.
  reconstructed() {
    for (let i = this.step; i >= 0; i--) if (this.data.steps[i].splats) return i;
    return this.data.steps.findIndex(step => step.splats);
  }

  place() {
    return this.data.steps[this.reconstructed()].centre;
  }

  splatsOf(step) {
    if (!this.unpacked.has(step)) this.unpacked.set(step, unpackSplats(this.data.steps[step].splats));
    return this.unpacked.get(step);
  }

  eye(width, height) {
    const { view } = this.orbit, step = this.data.steps[this.reconstructed()];
    if (typeof view !== "number") return this.orbit.eye(width, height, step.centre);
    const camera = this.data.scene.rig[view], crop = Object.hasOwn(step.crops, camera.name) && step.crops[camera.name];
    return crop ? eyeOfCrop(crop, step.centre, width, height) : eyeOfCamera(camera, step.centre, width, height);
  }

  colours() {
    const style = getComputedStyle(this.root);
    const rgb = name => [1, 3, 5].map(i => parseInt(style.getPropertyValue(name).trim().slice(i, i + 2), 16) / 255);
    const names = ["ground", "rig", "suspect", "track", "axis-x", "axis-y", "axis-z"];
    return Object.fromEntries(names.map(name => [name, rgb("--" + name)]));
  }

  draw() {
    const { gl, canvas } = this, ratio = Math.min(2, window.devicePixelRatio || 1);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height || gl.isContextLost()) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const at = this.reconstructed(), step = this.data.steps[at], eye = this.eye(width, height), tint = this.colours();
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const [lines, square] = this.sceneLines(eye, step, tint);
    this.lines.set(lines);
    this.lines.draw(eye, width, height, ratio);
    if (this.shown.gaussians) {
      this.splats.set(this.splatsOf(at));
      this.splats.draw(eye, step.centre, width, height, at === this.step ? 1 : 0.35);
    }
    this.labels.replaceChildren();
    if (this.shown.cameras && typeof this.orbit.view !== "number") this.nameCameras(eye, ratio);
    if (this.shown.axes) this.drawAxes(eye, ratio, tint);
    this.drawScale(eye, ratio, square);
  }

  sceneLines(eye, step, tint) {
    const { scene } = this.data, lines = [];
    let square = 0;
    if (this.shown.ground) {
      const whole = this.orbit.view === "scene", above = Math.abs(step.centre[2] - scene.ground);
      const extent = whole ? scene.extent : Math.max(above, 3 * scene.radius);
      const ground = groundLines(whole ? scene.middle : step.centre, scene.ground, extent, tint.ground);
      lines.push(...ground.lines);
      square = ground.step;
    }
    scene.rig.forEach((camera, index) => {
      if (index === this.orbit.view) return;
      const away = Math.hypot(...sub(camera.centre, step.centre)), colour = camera.suspect ? tint.suspect : tint.rig;
      if (this.shown.cameras) lines.push(...frustumLines(camera, 0.12 * away, colour));
      if (this.shown.sight) lines.push(line(camera.centre, step.centre, colour, 0.6, 1.2, 5));
    });
    if (this.shown.track) {
      lines.push(...trackLines(scene.track, this.step, tint.track));
      if (this.orbit.view === "scene" && this.shown.ground) lines.push(...plumbLines(step.centre, scene.ground, tint.track));
    }
    return [lines, square];
  }

  // Names that would cover one another are left out, those of cameras that disagree last.
  nameCameras(eye, ratio) {
    const taken = [], rig = [...this.data.scene.rig].sort((a, b) => b.suspect - a.suspect);
    for (const camera of rig) {
      const pixel = pixelOf(eye, camera.centre), text = camera.name + (camera.suspect ? " disagrees" : "");
      if (!pixel) continue;
      const [x, y] = times([...pixel, 0], 1 / ratio), width = 7.5 * text.length;
      if (taken.some(([u, v, w]) => Math.abs(v - y) < 14 && x < u + w && u < x + width)) continue;
      taken.push([x, y, width]);
      this.label(text, [x, y], camera.suspect ? "suspect" : "");
    }
  }

  label(text, [x, y], kind) {
    const span = document.createElement("span");
    span.textContent = text;
    span.className = kind;
    span.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    this.labels.append(span);
  }

  drawAxes(eye, ratio, tint) {
    const { gl, canvas } = this, side = GIZMO * ratio;
    const corner = { rotation: eye.rotation, offset: [0, 0, 6], lens: [1.7 * side, 1.7 * side, side / 2, side / 2], near: 1, far: 20 };
    gl.viewport(canvas.width - side, 0, side, side);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.lines.set(AXES.map(([name, axis]) => line([0, 0, 0], axis, tint["axis-" + name], 1, 2.4)));
    this.lines.draw(corner, side, side, ratio);
    for (const [name, axis] of AXES) {
      const [x, y] = times([...pixelOf(corner, times(axis, 1.28)), 0], 1 / ratio);
      this.label(name, [canvas.clientWidth - GIZMO + x, canvas.clientHeight - GIZMO + y], "axis");
    }
  }

  // A length at the object's distance, and the side of the ground's squares.
  drawScale(eye, ratio, square) {
    const depth = add(turn(eye.rotation, this.orbit.view === "scene" ? this.data.scene.middle : this.place()), eye.offset)[2];
    const perMetre = eye.lens[0] / depth / ratio, metres = roundLength(110 / perMetre);
    this.scale.hidden = !(perMetre > 0);
    this.scale.firstElementChild.style.width = `${(metres * perMetre).toFixed(1)}px`;
    const ground = square ? `, squares of ${+square.toPrecision(1)} m` : "";
    this.scale.lastElementChild.textContent = `${+metres.toPrecision(1)} m${ground}`;
  }
}

// The eye of a camera's crop, whole in a picture of any shape.
function eyeOfCrop(crop, centre, width, height) {
  const [fx, fy, cx, cy, w, h] = crop.lens, s = Math.min(width / w, height / h);
  const rotation = [0, 4, 8].flatMap(i => crop.pose.slice(i, i + 3)), away = [3, 7, 11].map(i => crop.pose[i]);
  const lens = [fx * s, fy * s, cx * s + (width - s * w) / 2, cy * s + (height - s * h) / 2];
  const far = Math.hypot(...away);
  return { rotation, offset: sub(away, turn(rotation, centre)), lens, near: far / 200, far: 10 * far };
}

function eyeOfCamera(camera, centre, width, height) {
  const [fx, fy, cx, cy, w, h] = camera.lens, s = Math.min(width / w, height / h);
  const rotation = [0, 1, 2].flatMap(i => [camera.axes[i], camera.axes[3 + i], camera.axes[6 + i]]);
  const lens = [fx * s, fy * s, cx * s + (width - s * w) / 2, cy * s + (height - s * h) / 2];
  const far = Math.hypot(...sub(centre, camera.centre));
  return { rotation, offset: times(turn(rotation, camera.centre), -1), lens, near: far / 200, far: 10 * far };
}
