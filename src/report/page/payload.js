// The data of the page: the report, the scene, and the numbers of `pack.rs`.

const byId = (id) => document.getElementById(id);
const report = JSON.parse(byId("report").textContent);
const scene = JSON.parse(byId("scene").textContent);

/** The bytes that all addresses of the scene point into. */
async function inflate() {
  const text = atob(byId("data").textContent.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Reads the three kinds of streams; an address is `{ at, n }`. */
class Payload {
  constructor(bytes) {
    this.data = bytes;
  }

  bytes({ at, n }) {
    return this.data.subarray(at, at + n);
  }

  text(address) {
    return new TextDecoder().decode(this.bytes(address));
  }

  integers({ at, n }) {
    const out = new Uint32Array(n);
    let before = 0;
    for (let i = 0; i < n; i++) {
      let rest = 0;
      let weight = 1;
      let byte;
      do {
        byte = this.data[at++];
        rest += (byte & 127) * weight;
        weight *= 128;
      } while (byte > 127);
      before += rest % 2 ? -(rest + 1) / 2 : rest / 2;
      out[i] = before;
    }
    return out;
  }

  /** Rows of `dims` coordinates on a grid, as millimetres. */
  places({ at, n }, grid) {
    const dims = grid.least.length;
    const out = new Float32Array(n * dims);
    for (let column = 0; column < dims; column++) {
      let before = 0;
      for (let i = 0; i < n; i++) {
        const step = this.data[at + i] | (this.data[at + n + i] << 8);
        before = (before + ((step >> 1) ^ -(step & 1))) & 0xffff;
        out[i * dims + column] = grid.least[column] + grid.step * before;
      }
      at += 2 * n;
    }
    return out;
  }
}

/** An element with attributes, listeners (`onclick`) and children. */
function make(tag, attributes = {}, ...children) {
  const svg = ["svg", "g", "path", "line", "circle", "rect", "text", "title", "polyline"].includes(tag);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value !== undefined && value !== null) element.setAttribute(key, value);
  }
  element.append(...children.filter((it) => it !== undefined && it !== null));
  return element;
}

/** Three significant digits, without an exponent where people read it. */
function short(value) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  // What is zero but for rounding is 0.
  if (size < 1e-9) return "0";
  if (size >= 1000) return Math.round(value).toLocaleString("en");
  if (size >= 0.001) return String(Number(value.toPrecision(3)));
  return value.toExponential(1);
}

/** Seconds as people say them. */
function duration(seconds) {
  if (seconds < 1) return `${short(seconds)} s`;
  if (seconds < 120) return `${seconds < 10 ? seconds.toFixed(1) : Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  return minutes < 60 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

function fileSize(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
