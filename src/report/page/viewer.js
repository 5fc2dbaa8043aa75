// The 3-D view: WebGL 2, drawn only when something changed.

const SURFACE_VERTEX = `#version 300 es
precision highp float;
in vec3 place; in vec3 rolled; in vec3 color; in float piece;
uniform mat4 view; uniform float unroll; uniform float explode;
uniform highp sampler2D offsets; uniform highp sampler2D states;
out vec3 world; out vec3 tint; flat out float state;
void main() {
  ivec2 slot = ivec2(int(piece + 0.5), 0);
  state = floor(texelFetch(states, slot, 0).r * 255.0 + 0.5);
  world = mix(place, rolled, unroll) + explode * texelFetch(offsets, slot, 0).xyz;
  tint = color;
  gl_Position = state == 4.0 ? vec4(2.0, 2.0, 2.0, 1.0) : view * vec4(world, 1.0);
}`;

const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
in vec3 world; in vec3 tint; flat in float state;
uniform vec3 eye; uniform vec3 light; uniform vec3 selected; uniform float unroll;
out vec4 color;
void main() {
  vec3 normal = normalize(cross(dFdx(world), dFdy(world)));
  vec3 toEye = normalize(eye - world);
  if (dot(normal, toEye) < 0.0) normal = -normal;
  vec3 base = tint;
  if (state == 1.0) base = mix(base, selected, 0.88);
  if (state == 3.0) base = mix(base, vec3(0.86, 0.86, 0.85), 0.78);
  float shade = 0.56 + 0.4 * max(dot(normal, light), 0.0) + 0.14 * max(dot(normal, toEye), 0.0);
  if (!gl_FrontFacing) { base = mix(base, vec3(0.55, 0.56, 0.6), 0.45 * (1.0 - unroll)); }
  color = vec4(min(base * shade, vec3(1.0)), 1.0);
}`;

const LINE_VERTEX = `#version 300 es
precision highp float;
in vec3 a; in vec3 b; in vec3 rolledA; in vec3 rolledB; in float piece; in float width; in vec4 color;
uniform mat4 view; uniform float unroll; uniform float explode; uniform vec2 size; uniform float lift;
uniform highp sampler2D offsets; uniform highp sampler2D states;
out vec4 tint;
void main() {
  ivec2 slot = ivec2(int(piece + 0.5), 0);
  float state = floor(texelFetch(states, slot, 0).r * 255.0 + 0.5);
  vec3 offset = explode * texelFetch(offsets, slot, 0).xyz;
  vec4 p = view * vec4(mix(a, rolledA, unroll) + offset, 1.0);
  vec4 q = view * vec4(mix(b, rolledB, unroll) + offset, 1.0);
  vec2 along = (q.xy / q.w - p.xy / p.w) * size;
  float far = length(along);
  along = far > 1e-6 ? along / far : vec2(1.0, 0.0);
  float end = float(gl_VertexID / 2), side = float(gl_VertexID % 2) - 0.5;
  vec4 place = end < 0.5 ? p : q;
  vec2 shift = vec2(-along.y, along.x) * side * width + along * (end - 0.5) * 0.6 * width;
  place.xy += 2.0 * shift / size * place.w;
  place.z -= lift * place.w;
  tint = vec4(color.rgb, state == 3.0 ? 0.35 * color.a : color.a);
  gl_Position = state == 4.0 ? vec4(2.0, 2.0, 2.0, 1.0) : place;
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
in vec4 tint; out vec4 color;
void main() { color = vec4(tint.rgb * tint.a, tint.a); }`;

/** How a piece is shown. */
const STATE = { plain: 0, selected: 1, partner: 2, dim: 3, hidden: 4 };

class Viewer {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    this.surface = this.program(SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.line = this.program(LINE_VERTEX, LINE_FRAGMENT);
    this.unroll = 0;
    this.explode = 0;
    this.sets = new Map();
    this.afterwards = () => {};
    canvas.addEventListener("webglcontextlost", () => problem("The 3-D view lost its graphics context. Reload the page."));
    new ResizeObserver(() => this.changed()).observe(canvas);
  }

  program(vertex, fragment) {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const places = {};
    for (let i = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) - 1; i >= 0; i--) {
      const { name } = gl.getActiveUniform(program, i);
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  /** One row of a texture, a texel for "no piece" and one for each. */
  row(texture, values, kind) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const width = values.length / (kind === "float" ? 4 : 1);
    if (kind === "float") gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, 1, 0, gl.RGBA, gl.FLOAT, values);
    else {
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, width, 1, 0, gl.RED, gl.UNSIGNED_BYTE, values);
    }
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
  }

  /** Directions in which the pieces move apart, and how they are shown. */
  setPieces(offsets, states) {
    this.offsetTexture ??= this.gl.createTexture();
    this.stateTexture ??= this.gl.createTexture();
    this.offsets = offsets;
    this.states = states;
    this.row(this.offsetTexture, offsets, "float");
    this.row(this.stateTexture, states, "byte");
    this.changed();
  }

  buffer(data, target = this.gl.ARRAY_BUFFER) {
    const buffer = this.gl.createBuffer();
    this.gl.bindBuffer(target, buffer);
    this.gl.bufferData(target, data, this.gl.STATIC_DRAW);
    return buffer;
  }

  attribute({ program }, name, size, type, stride, offset, perInstance) {
    const gl = this.gl;
    const at = gl.getAttribLocation(program, name);
    if (at < 0) return;
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, type, type === gl.UNSIGNED_BYTE, stride, offset);
    if (perInstance) gl.vertexAttribDivisor(at, 1);
  }

  /** Shows a mesh in these colours, three bytes per vertex. */
  show(mesh, colors) {
    const gl = this.gl;
    if (!mesh.gpu) {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      const numbers = (name, data, size) => {
        this.buffer(data);
        this.attribute(this.surface, name, size, gl.FLOAT, 0, 0, false);
      };
      numbers("place", mesh.points, 3);
      numbers("rolled", mesh.unrolled(), 3);
      numbers("piece", mesh.pieces ? Float32Array.from(mesh.pieces, (it) => it + 1) : new Float32Array(mesh.vertexCount), 1);
      const color = this.buffer(colors);
      this.attribute(this.surface, "color", 3, gl.UNSIGNED_BYTE, 0, 0, false);
      this.buffer(mesh.triangles, gl.ELEMENT_ARRAY_BUFFER);
      gl.bindVertexArray(null);
      mesh.gpu = { array, color };
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, mesh.gpu.color);
    gl.bufferData(gl.ARRAY_BUFFER, colors, gl.STATIC_DRAW);
    this.mesh = mesh;
    this.changed();
  }

  /** A named set of lines; `null` takes it away. */
  setLines(name, segments) {
    const gl = this.gl;
    const old = this.sets.get(name);
    if (old) {
      gl.deleteVertexArray(old.array);
      gl.deleteBuffer(old.data);
      this.sets.delete(name);
    }
    this.changed();
    if (!segments || segments.count === 0) return;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const data = this.buffer(new Float32Array(segments.numbers));
    let offset = 0;
    const layout = [["a", 3], ["b", 3], ["rolledA", 3], ["rolledB", 3], ["piece", 1], ["width", 1], ["color", 4]];
    for (const [part, size] of layout) {
      this.attribute(this.line, part, size, gl.FLOAT, 4 * Segments.FLOATS, offset, true);
      offset += 4 * size;
    }
    gl.bindVertexArray(null);
    this.sets.set(name, { array, data, count: segments.count });
  }

  changed() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    const { gl, canvas } = this;
    const scale = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
    if (!this.mesh || width === 0 || height === 0) return;
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    this.matrix = this.camera.matrix(width / height);
    const [right, upward, back] = this.camera.axes();
    const light = normalize(add(add(back.map((it) => 0.75 * it), upward, 0.6), right, -0.35));
    this.begin(this.surface);
    gl.uniform3fv(this.surface.places.eye, this.camera.eye());
    gl.uniform3fv(this.surface.places.light, light);
    gl.uniform3fv(this.surface.places.selected, SELECTED.map((it) => it / 255));
    gl.bindVertexArray(this.mesh.gpu.array);
    gl.drawElements(gl.TRIANGLES, this.mesh.triangles.length, gl.UNSIGNED_INT, 0);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    this.begin(this.line);
    gl.uniform2f(this.line.places.size, width / scale, height / scale);
    gl.uniform1f(this.line.places.lift, 0.0006);
    for (const { array, count } of this.sets.values()) {
      gl.bindVertexArray(array);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    }
    gl.depthMask(true);
    gl.bindVertexArray(null);
    this.afterwards();
  }

  begin({ program, places }) {
    const gl = this.gl;
    gl.useProgram(program);
    gl.uniformMatrix4fv(places.view, false, this.matrix);
    gl.uniform1f(places.unroll, this.unroll);
    gl.uniform1f(places.explode, this.explode);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.offsetTexture);
    gl.uniform1i(places.offsets, 0);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.stateTexture);
    gl.uniform1i(places.states, 1);
    gl.activeTexture(gl.TEXTURE0);
  }

  /** Where a vertex is at the moment. */
  place(mesh, v) {
    const rolled = mesh.unrolled();
    const slot = mesh.pieces ? mesh.pieces[v] + 1 : 0;
    return [0, 1, 2].map((k) => {
      const flat = (1 - this.unroll) * mesh.points[3 * v + k] + this.unroll * rolled[3 * v + k];
      return flat + this.explode * this.offsets[4 * slot + k];
    });
  }

  /** Pixels from the upper left corner, or null behind the eye. */
  project(p) {
    const m = this.matrix;
    const [x, y, w] = [0, 1, 3].map((k) => m[k] * p[0] + m[4 + k] * p[1] + m[8 + k] * p[2] + m[12 + k]);
    if (w <= 0) return null;
    return [(0.5 + (0.5 * x) / w) * this.canvas.clientWidth, (0.5 - (0.5 * y) / w) * this.canvas.clientHeight];
  }

  /** The first face under a place of the view in [-1, 1]², or -1 (Möller and Trumbore 1997, on every triangle). */
  pick(x, y) {
    const { mesh } = this;
    const [eye, direction] = this.camera.ray(x, y, this.canvas.clientWidth / this.canvas.clientHeight);
    const places = new Float32Array(3 * mesh.vertexCount);
    for (let v = 0; v < mesh.vertexCount; v++) places.set(this.place(mesh, v), 3 * v);
    const at = (v) => [places[3 * v], places[3 * v + 1], places[3 * v + 2]];
    let [best, nearest] = [-1, Infinity];
    for (let f = 0; f < mesh.faceCount; f++) {
      const [a, b, c] = mesh.corners(f);
      if (mesh.pieces && this.states[mesh.pieces[a] + 1] === STATE.hidden) continue;
      const p = at(a);
      const [e, g] = [sub(at(b), p), sub(at(c), p)];
      const normal = cross(direction, g);
      const det = dot(e, normal);
      if (Math.abs(det) < 1e-15) continue;
      const s = sub(eye, p);
      const u = dot(s, normal) / det;
      const q = cross(s, e);
      const w = dot(direction, q) / det;
      const t = dot(g, q) / det;
      if (u >= 0 && w >= 0 && u + w <= 1 && t > 0 && t < nearest) [best, nearest] = [f, t];
    }
    return best;
  }
}
