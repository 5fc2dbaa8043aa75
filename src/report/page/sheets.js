// The sheets: the drawings that are cut, with the parts to point at and the seams of the part in hand.

class SheetView {
  constructor(host, header, index, payload) {
    this.index = index;
    this.header = header;
    [this.width, this.height] = header.size;
    this.margin = 0.02 * Math.max(this.width, this.height);
    this.parts = header.parts.map((it) => this.readPart(it, payload));
    this.drawing = header.svg ? payload.text(header.svg) : null;
    this.svg = make("svg", { class: "sheet", role: "group", "aria-label": `${header.name}, ${header.parts.length} parts` });
    this.over = make("canvas", { class: "over", "aria-hidden": "true" });
    this.element = make("div", { class: "sheet-view" }, this.svg, this.over);
    host.append(this.element);
    this.fill();
    this.reset();
    this.steer();
    new ResizeObserver(() => this.apply()).observe(this.element);
  }

  readPart(header, payload) {
    const points = payload.places(header.points, this.header.grid);
    const data = [];
    let first = 0;
    for (const count of header.contours) {
      const at = (i) => `${points[2 * i].toFixed(2)} ${(this.height - points[2 * i + 1]).toFixed(2)}`;
      data.push(`M${Array.from({ length: count }, (_, i) => at(first + i)).join("L")}Z`);
      first += count;
    }
    const piece = scene.pieces.findIndex((it) => it.name === header.name);
    return { ...header, piece, data: data.join("") };
  }

  fill() {
    this.svg.append(make("rect", { class: "stock", width: this.width, height: this.height }));
    for (const part of this.parts) {
      const color = part.piece >= 0 ? app.colors[part.piece] : PLAIN;
      const shape = { d: part.data, class: "part", fill: css(color), "fill-rule": "evenodd", "data-name": part.name };
      const label = { role: "button", tabindex: "-1", "aria-label": `Part ${part.name}` };
      part.shape = make("path", { ...shape, ...label }, make("title", {}, `Part ${part.name}`));
      part.shape.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") {
          event.preventDefault();
          app.select(part.piece);
        }
      });
      this.svg.append(part.shape);
    }
    if (this.drawing) {
      const root = new DOMParser().parseFromString(this.drawing, "image/svg+xml").documentElement;
      const drawing = document.importNode(root, true);
      drawing.setAttribute("class", "drawing");
      drawing.setAttribute("width", this.width);
      drawing.setAttribute("height", this.height);
      drawing.setAttribute("aria-hidden", "true");
      this.svg.append(drawing);
    }
    this.marks = make("g", { class: "marks", "aria-hidden": "true" });
    this.svg.append(this.marks);
  }

  reset() {
    this.box = [-this.margin, -this.margin, this.width + 2 * this.margin, this.height + 2 * this.margin];
    this.apply();
  }

  apply() {
    this.svg.setAttribute("viewBox", this.box.map((it) => it.toFixed(3)).join(" "));
    this.replay?.draw();
  }

  /** Millimetres per pixel, and the pixel of the upper left corner of the box: the drawing is centred. */
  scale() {
    const [width, height] = [this.element.clientWidth || 1, this.element.clientHeight || 1];
    const size = Math.max(this.box[2] / width, this.box[3] / height);
    return { size, left: (width - this.box[2] / size) / 2, top: (height - this.box[3] / size) / 2 };
  }

  /** From pixels in the view to millimetres of the page, y down. */
  at(x, y) {
    const { size, left, top } = this.scale();
    return [this.box[0] + (x - left) * size, this.box[1] + (y - top) * size];
  }

  zoom(factor, x, y) {
    const least = 0.01 * this.width;
    const size = Math.min(4 * this.width, Math.max(least, this.box[2] * factor));
    const real = size / this.box[2];
    const [px, py] = this.at(x, y);
    this.box = [px - (px - this.box[0]) * real, py - (py - this.box[1]) * real, size, this.box[3] * real];
    this.apply();
  }

  pan(dx, dy) {
    const { size } = this.scale();
    this.box[0] -= dx * size;
    this.box[1] -= dy * size;
    this.apply();
  }

  steer() {
    const { svg } = this;
    const fingers = new Map();
    let moved = 0;
    svg.addEventListener("wheel", (event) => {
      event.preventDefault();
      const box = svg.getBoundingClientRect();
      const amount = Math.max(-200, Math.min(200, event.deltaY * (event.deltaMode ? 30 : 1)));
      this.zoom(Math.exp(0.0015 * amount), event.clientX - box.left, event.clientY - box.top);
    }, { passive: false });
    svg.addEventListener("pointerdown", (event) => {
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 1) moved = 0;
    });
    svg.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY];
      moved += Math.abs(now[0] - before[0]) + Math.abs(now[1] - before[1]);
      if (moved > 5) svg.setPointerCapture(event.pointerId);
      if (fingers.size === 2) {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        const gap = (p) => Math.max(1, Math.hypot(p[0] - other[0], p[1] - other[1]));
        const box = svg.getBoundingClientRect();
        this.zoom(gap(before) / gap(now), (now[0] + other[0]) / 2 - box.left, (now[1] + other[1]) / 2 - box.top);
      } else if (moved > 5) this.pan(now[0] - before[0], now[1] - before[1]);
      fingers.set(event.pointerId, now);
    });
    const release = (event) => fingers.delete(event.pointerId);
    svg.addEventListener("pointerup", release);
    svg.addEventListener("pointercancel", release);
    svg.addEventListener("pointerleave", release);
    svg.addEventListener("click", (event) => {
      if (moved > 5) return;
      const name = event.target.dataset?.name;
      app.select(name === undefined ? -1 : this.parts.find((it) => it.name === name).piece);
    });
  }

  /** Lights up the parts of pieces, and the seams of the selected one. */
  mark(selected, partners, seams) {
    for (const part of this.parts) {
      const state = part.piece === selected ? "selected" : partners.has(part.piece) ? "partner" : "";
      const dim = selected >= 0 && state === "" ? "dim" : "";
      part.shape.setAttribute("class", `part ${state} ${dim}`);
    }
    this.marks.replaceChildren();
    const cut = app.meshes.find((it) => it.name === "cut");
    if (!cut?.flat) return;
    for (const seam of seams) {
      seam.chains.forEach((chain, side) => {
        const part = this.parts.find((it) => it.piece === seam.pieces[side]);
        if (!part) return;
        const [c, s] = [Math.cos(part.angle), Math.sin(part.angle)];
        const place = (v) => {
          const [x, y] = [cut.flat[2 * v], cut.flat[2 * v + 1]];
          return [c * x - s * y + part.offset[0], this.height - (s * x + c * y + part.offset[1])];
        };
        const points = Array.from(chain, place);
        const own = part.piece === selected ? "own" : "other";
        this.marks.append(make("polyline", { class: `seam ${own}`, points: points.map((it) => it.map((x) => x.toFixed(2)).join(",")).join(" ") }));
      });
    }
  }

  /** Brings the part of a piece into view. */
  reveal(piece) {
    const part = this.parts.find((it) => it.piece === piece);
    if (!part || !this.element.clientWidth) return;
    const box = part.shape.getBBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    const inside = x > this.box[0] && y > this.box[1] && x < this.box[0] + this.box[2] && y < this.box[1] + this.box[3];
    if (inside) return;
    this.box[0] = x - this.box[2] / 2;
    this.box[1] = y - this.box[3] / 2;
    this.apply();
  }
}
