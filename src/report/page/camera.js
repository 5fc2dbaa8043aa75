// The camera of the 3-D view: it goes round a point, with the up axis of the model always up.

const HALF_VIEW = 0.22; // half the angle of view, radians: a long lens keeps proportions true

class Camera {
  /** `up` is 1 for y or 2 for z; `center` and `radius` describe the ball to be seen. */
  constructor(up, center, radius) {
    this.up = up;
    this.start = { center, radius };
    this.reset();
  }

  reset() {
    this.yaw = 0.6;
    this.pitch = 0.3;
    this.center = [...this.start.center];
    this.distance = (0.86 * this.start.radius) / Math.sin(HALF_VIEW);
  }

  turn(dx, dy) {
    this.yaw -= dx;
    this.pitch = Math.min(1.55, Math.max(-1.55, this.pitch + dy));
  }

  zoom(factor) {
    const { radius } = this.start;
    this.distance = Math.min(40 * radius, Math.max(0.15 * radius, this.distance * factor));
  }

  /** Moves the picture by a share of the height of the view. */
  pan(dx, dy) {
    const [right, upward] = this.axes();
    const scale = 2 * this.distance * Math.tan(HALF_VIEW);
    for (let k = 0; k < 3; k++) this.center[k] += scale * (-dx * right[k] + dy * upward[k]);
  }

  /** Right, up and back of the view, in the coordinates of the model. */
  axes() {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    const turned = ([x, y, z]) => (this.up === 2 ? [x, -z, y] : [x, y, z]);
    return [turned([cy, 0, -sy]), turned([-sy * sp, cp, -cy * sp]), turned([sy * cp, sp, cy * cp])];
  }

  eye() {
    const back = this.axes()[2];
    return this.center.map((it, k) => it + this.distance * back[k]);
  }

  /** Projection times view, column by column. `aspect` is width over height; a narrow view sees as much across. */
  matrix(aspect) {
    const [right, upward, back] = this.axes();
    const eye = this.eye();
    const t = Math.tan(HALF_VIEW) / Math.min(1, aspect);
    const near = Math.max(0.02 * this.distance, this.distance - 4 * this.start.radius);
    const far = this.distance + 8 * this.start.radius;
    const rows = [right.map((it) => it / (t * aspect)), upward.map((it) => it / t), back];
    const dot = (a) => a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2];
    const [x, y, z] = rows;
    const a = (far + near) / (near - far);
    const b = (2 * far * near) / (near - far);
    const depth = -dot(back);
    // prettier-ignore
    return new Float32Array([
      x[0], y[0], a * z[0], -z[0],
      x[1], y[1], a * z[1], -z[1],
      x[2], y[2], a * z[2], -z[2],
      -dot(x), -dot(y), a * depth + b, -depth,
    ]);
  }

  /** A line of sight through a point of the view in [-1, 1]²: origin and direction. */
  ray(x, y, aspect) {
    const [right, upward, back] = this.axes();
    const t = Math.tan(HALF_VIEW) / Math.min(1, aspect);
    const direction = [0, 1, 2].map((k) => x * t * aspect * right[k] + y * t * upward[k] - back[k]);
    return [this.eye(), direction];
  }
}

/** Mouse, touch, wheel and keys on `canvas` move `camera`; `changed` redraws, `clicked` gets places in [-1, 1]². */
function steer(canvas, camera, changed, clicked) {
  const fingers = new Map();
  let moved = 0;
  const spot = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height];
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 1) moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    const size = canvas.clientHeight;
    moved += Math.abs(dx) + Math.abs(dy);
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const gap = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      camera.zoom(Math.max(1, gap(before)) / Math.max(1, gap(now)));
      camera.pan(dx / 2 / size, dy / 2 / size);
    } else if (event.buttons & 2 || event.shiftKey) camera.pan(dx / size, dy / size);
    else camera.turn((3.5 * dx) / size, (3.5 * dy) / size);
    fingers.set(event.pointerId, now);
    changed();
  });
  const release = (event) => {
    if (fingers.delete(event.pointerId) && event.type === "pointerup" && moved < 5 && event.button === 0) clicked(...spot(event));
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  const wheel = (event) => {
    event.preventDefault();
    camera.zoom(Math.exp(0.0015 * Math.max(-200, Math.min(200, event.deltaY * (event.deltaMode ? 30 : 1)))));
    changed();
  };
  canvas.addEventListener("wheel", wheel, { passive: false });
  const keys = {
    ArrowLeft: () => camera.turn(-0.12, 0),
    ArrowRight: () => camera.turn(0.12, 0),
    ArrowUp: () => camera.turn(0, 0.12),
    ArrowDown: () => camera.turn(0, -0.12),
    "+": () => camera.zoom(1 / 1.15),
    "=": () => camera.zoom(1 / 1.15),
    "-": () => camera.zoom(1.15),
    0: () => camera.reset(),
  };
  canvas.addEventListener("keydown", (event) => {
    const key = keys[event.key];
    if (!key || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    key();
    changed();
  });
}
