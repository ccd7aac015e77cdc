// Where the viewer looks from: about the object, about the whole scene, or through a camera.
const FIELD_OF_VIEW = 32 * Math.PI / 180, MOST_PITCH = 89;

class Orbit {
  // `scene` has radius, middle, extent, yaw and pitch (degrees) of the first view; `points` are to be in that of the whole.
  constructor(scene, points) {
    Object.assign(this, { scene, points, view: "object", fitted: null });
    this.reset();
  }

  reset() {
    Object.assign(this, { yaw: this.scene.yaw, pitch: this.scene.pitch, zoom: 1, pan: [0, 0, 0] });
  }

  // "object", "scene", or the index of a camera.
  look(view) {
    this.view = view;
    this.fitted = null;
    this.zoom = 1;
    this.pan = [0, 0, 0];
  }

  // Leaves a camera for an orbit that begins where it stands.
  orbit(dx, dy, place, cameras) {
    if (typeof this.view === "number") {
      const [x, y, z] = sub(cameras[this.view].centre, place);
      this.yaw = Math.atan2(y, x) * 180 / Math.PI;
      this.pitch = Math.atan2(z, Math.hypot(x, y)) * 180 / Math.PI;
      this.look("object");
    }
    this.yaw -= dx;
    this.pitch = Math.min(MOST_PITCH, Math.max(-MOST_PITCH, this.pitch + dy));
  }

  zoomBy(factor) {
    this.zoom = Math.min(40, Math.max(0.05, this.zoom * factor));
  }

  shift(dx, dy, height) {
    const metres = this.distance(1) / this.zoom * 2 * Math.tan(FIELD_OF_VIEW / 2) / height;
    const { rotation } = this.eye(1, height, [0, 0, 0]);
    this.pan = add(this.pan, turnBack(rotation, [-dx * metres, -dy * metres, 0]));
  }

  // From the target at zoom 1 so that everything is in the picture, also where that is narrow. That of the whole scene
  // stays as it was when it was chosen: a picture that breathes while it is turned is hard to follow.
  distance(aspect) {
    const up = Math.tan(FIELD_OF_VIEW / 2), across = up * aspect;
    if (this.view !== "scene") return this.scene.radius / Math.sin(FIELD_OF_VIEW / 2) / Math.min(1, aspect);
    if (this.fitted?.aspect !== aspect) {
      const { rotation } = lookFrom(this.direction(), [0, 0, 0], []);
      const needed = this.points.map(point => {
        const [x, y, z] = turn(rotation, sub(point, this.scene.middle));
        return Math.max(Math.abs(x) / across, Math.abs(y) / up) - z;
      });
      this.fitted = { aspect, metres: 1.25 * Math.max(...needed) };
    }
    return this.fitted.metres;
  }

  direction() {
    const yaw = this.yaw * Math.PI / 180, pitch = this.pitch * Math.PI / 180;
    return [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
  }

  eye(width, height, place) {
    const middle = this.view === "scene" ? this.scene.middle : place;
    const target = add(middle, this.pan), away = this.distance(width / height) / this.zoom;
    const focal = height / 2 / Math.tan(FIELD_OF_VIEW / 2);
    const eye = lookFrom(add(target, times(this.direction(), away)), target, [focal, focal, width / 2, height / 2]);
    return { ...eye, away, near: away / 200, far: 4 * (away + this.scene.extent + Math.hypot(...sub(target, this.scene.middle))) };
  }
}

// Pointers, wheel and keys; `act` has orbit(dx, dy), shift(dx, dy), zoom(factor), reset().
function listen(canvas, act) {
  const held = new Map();
  const spread = () => {
    const [a, b] = [...held.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  };
  canvas.addEventListener("pointerdown", event => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", event => {
    const last = held.get(event.pointerId);
    if (!last) return;
    const before = spread(), dx = event.clientX - last[0], dy = event.clientY - last[1];
    held.set(event.pointerId, [event.clientX, event.clientY]);
    if (held.size > 1) {
      act.zoom(spread() / (before || 1) || 1);
      act.shift(dx / held.size, dy / held.size);
    } else if (event.shiftKey || event.buttons & 6) act.shift(dx, dy);
    else act.orbit(0.4 * dx, 0.4 * dy);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, event => held.delete(event.pointerId));
  canvas.addEventListener("contextmenu", event => event.preventDefault());
  canvas.addEventListener("dblclick", act.reset);
  canvas.addEventListener("wheel", event => {
    // The page scrolls unless the picture was clicked before: it must not catch the wheel that passes over it.
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    act.zoom(Math.exp(-0.0015 * event.deltaY));
  }, { passive: false });
  const keys = {
    ArrowLeft: () => act.orbit(8, 0), ArrowRight: () => act.orbit(-8, 0),
    ArrowUp: () => act.orbit(0, 8), ArrowDown: () => act.orbit(0, -8),
    "+": () => act.zoom(1.25), "=": () => act.zoom(1.25), "-": () => act.zoom(0.8), Home: act.reset,
  };
  canvas.addEventListener("keydown", event => {
    if (!Object.hasOwn(keys, event.key) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key]();
  });
}
