// Meshes as the viewer needs them: typed arrays, edges with their angles, and the pieces laid flat where they are.

const add = (a, b, t = 1) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const normalize = (a) => {
  const length = Math.hypot(...a);
  return length > 0 ? a.map((it) => it / length) : [0, 0, 0];
};

class Mesh {
  constructor(header, payload) {
    Object.assign(this, { name: header.name, title: header.title, about: header.about, header });
    this.points = payload.places(header.points, scene.grid);
    this.triangles = payload.integers(header.triangles);
    this.flat = header.flat ? payload.places(header.flat, scene.flat_grid) : null;
    this.pieces = header.pieces ? payload.integers(header.pieces) : null;
    this.strips = header.strips ? payload.integers(header.strips) : null;
    this.fields = header.fields.map((it) => ({ ...it, values: payload.bytes(it.values) }));
    this.vertexCount = this.points.length / 3;
    this.faceCount = this.triangles.length / 3;
  }

  point(v) {
    return [this.points[3 * v], this.points[3 * v + 1], this.points[3 * v + 2]];
  }

  corners(f) {
    return [this.triangles[3 * f], this.triangles[3 * f + 1], this.triangles[3 * f + 2]];
  }

  /** Twice the area of a face times its normal. */
  normal(f) {
    const [a, b, c] = this.corners(f).map((v) => this.point(v));
    return cross(sub(b, a), sub(c, a));
  }

  /** The unit normal around a vertex. */
  normalAt(v) {
    if (!this.normals) {
      this.normals = new Float32Array(this.points.length);
      for (let f = 0; f < this.faceCount; f++) {
        const normal = this.normal(f);
        for (const w of this.corners(f)) for (let k = 0; k < 3; k++) this.normals[3 * w + k] += normal[k];
      }
    }
    return normalize([this.normals[3 * v], this.normals[3 * v + 1], this.normals[3 * v + 2]]);
  }

  /** Edges as pairs of vertices, with the angle between their faces, radians; -1 on the boundary. */
  edges() {
    if (this.known) return this.known;
    const keys = new Float64Array(this.triangles.length);
    const n = this.vertexCount;
    for (let i = 0; i < keys.length; i++) {
      const next = i % 3 === 2 ? i - 2 : i + 1;
      const [a, b] = [this.triangles[i], this.triangles[next]];
      keys[i] = Math.min(a, b) * n + Math.max(a, b);
    }
    const order = Uint32Array.from(keys.keys()).sort((a, b) => keys[a] - keys[b]);
    const normals = Array.from({ length: this.faceCount }, (_, f) => normalize(this.normal(f)));
    const ends = [];
    const angles = [];
    for (let i = 0; i < order.length; i++) {
      const key = keys[order[i]];
      const paired = i + 1 < order.length && keys[order[i + 1]] === key;
      ends.push(Math.floor(key / n), key % n);
      if (paired) {
        const [f, g] = [order[i], order[i + 1]].map((it) => normals[Math.floor(it / 3)]);
        angles.push(Math.acos(Math.min(1, Math.max(-1, dot(f, g)))));
        i++;
      } else angles.push(-1);
    }
    this.known = { ends, angles };
    return this.known;
  }

  /** Where every vertex goes when its piece is laid flat beside itself: the plane of a piece goes through its middle, turned
   *  so that it moves as little as can be. */
  unrolled() {
    if (!this.flat) return this.points;
    this.rolled ??= this.layFlat();
    return this.rolled;
  }

  layFlat() {
    const frames = pieceFrames(this);
    const out = new Float32Array(this.points.length);
    for (let v = 0; v < this.vertexCount; v++) {
      const { center, flat, right, upward } = frames[this.pieces[v]];
      const [u, w] = [this.flat[2 * v] - flat[0], this.flat[2 * v + 1] - flat[1]];
      for (let k = 0; k < 3; k++) out[3 * v + k] = center[k] + u * right[k] + w * upward[k];
    }
    return out;
  }
}

/** Per piece its middle in space and in the plane, and the directions in space that its plane axes have on the average. */
function pieceFrames(mesh) {
  const frames = scene.pieces.map(() => ({ area: 0, center: [0, 0, 0], flat: [0, 0], right: [0, 0, 0], upward: [0, 0, 0] }));
  for (let f = 0; f < mesh.faceCount; f++) {
    const corners = mesh.corners(f);
    const frame = frames[mesh.pieces[corners[0]]];
    const [p, q, r] = corners.map((v) => mesh.point(v));
    const [a, b, c] = corners.map((v) => [mesh.flat[2 * v], mesh.flat[2 * v + 1]]);
    const [e, g] = [sub(q, p), sub(r, p)];
    const area = Math.hypot(...cross(e, g)) / 2;
    const [eu, ev, gu, gv] = [b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]];
    const det = eu * gv - ev * gu;
    frame.area += area;
    for (let k = 0; k < 3; k++) {
      frame.center[k] += (area * (p[k] + q[k] + r[k])) / 3;
      if (Math.abs(det) > 1e-12) {
        frame.right[k] += (area * (gv * e[k] - ev * g[k])) / det;
        frame.upward[k] += (area * (eu * g[k] - gu * e[k])) / det;
      }
    }
    for (let k = 0; k < 2; k++) frame.flat[k] += (area * (a[k] + b[k] + c[k])) / 3;
  }
  return frames.map(({ area, center, flat, right, upward }) => {
    const share = area > 0 ? 1 / area : 0;
    const sideways = normalize(right);
    const along = normalize(sub(upward, sideways.map((it) => it * dot(upward, sideways))));
    const fine = Math.hypot(...sideways) > 0 && Math.hypot(...along) > 0;
    return {
      center: center.map((it) => it * share),
      flat: flat.map((it) => it * share),
      right: fine ? sideways : [1, 0, 0],
      upward: fine ? along : [0, 1, 0],
    };
  });
}

/** Collects straight segments for the viewer: ends in space and laid flat, piece, width in pixels, colour with opacity. */
class Segments {
  static FLOATS = 18;

  constructor() {
    this.numbers = [];
  }

  add(a, b, flatA, flatB, piece, width, [red, green, blue], opacity) {
    this.numbers.push(...a, ...b, ...flatA, ...flatB, piece, width, red / 255, green / 255, blue / 255, opacity);
  }

  /** An edge of a mesh. */
  edge(mesh, rolled, v, w, width, color, opacity) {
    const at = (points, i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
    const piece = mesh.pieces ? mesh.pieces[v] + 1 : 0;
    this.add(at(mesh.points, v), at(mesh.points, w), at(rolled, v), at(rolled, w), piece, width, color, opacity);
  }

  get count() {
    return this.numbers.length / Segments.FLOATS;
  }
}

/** Edges of a mesh: `angle` draws them as strong as they are bent, `all` all alike, `none` only where the surface ends. */
function edgeSegments(mesh, how) {
  const out = new Segments();
  const { ends, angles } = mesh.edges();
  const rolled = mesh.unrolled();
  for (let i = 0; i < angles.length; i++) {
    const [v, w] = [ends[2 * i], ends[2 * i + 1]];
    if (angles[i] < 0) out.edge(mesh, rolled, v, w, 1.4, INK, 0.9);
    else if (how === "all") out.edge(mesh, rolled, v, w, 0.9, INK, 0.3);
    else if (how === "angle" && angles[i] > 0.05) {
      const share = Math.min(1, angles[i] / 0.6);
      out.edge(mesh, rolled, v, w, 0.8 + 0.7 * share, INK, 0.75 * share);
    }
  }
  return out;
}

/** Both sides of seams. */
function seamSegments(mesh, seams, width, color) {
  const out = new Segments();
  const rolled = mesh.unrolled();
  for (const side of seams.flatMap((it) => it.chains)) {
    for (let i = 1; i < side.length; i++) out.edge(mesh, rolled, side[i - 1], side[i], width, color, 1);
  }
  return out;
}

/** Lines that lie on the surface. */
function lineSegments(header, payload, width, color) {
  const points = payload.places(header.points, scene.grid);
  const runs = payload.integers(header.runs);
  const pieces = payload.integers(header.pieces);
  const cut = app.meshes.find((it) => it.name === "cut");
  const flat = header.flat && cut?.flat ? payload.places(header.flat, scene.flat_grid) : null;
  const frames = flat ? pieceFrames(cut) : [];
  const out = new Segments();
  let first = 0;
  runs.forEach((count, run) => {
    const at = (i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
    const rolled = (i) => {
      if (!flat || pieces[run] === 0) return at(i);
      const frame = frames[pieces[run] - 1];
      const place = add(frame.center, frame.right, flat[2 * i] - frame.flat[0]);
      return add(place, frame.upward, flat[2 * i + 1] - frame.flat[1]);
    };
    for (let i = first + 1; i < first + count; i++) {
      out.add(at(i - 1), at(i), rolled(i - 1), rolled(i), pieces[run], width, color, 0.85);
    }
    first += count;
  });
  return out;
}
