// The recipe `sphere`: the certificate of its map, the slices with their stretch, and the gores on the sphere and in the plane.

/** The outlines of the pieces of a mesh as loops of vertices. */
function outlines(mesh) {
  const key = (a, b) => a * mesh.vertexCount + b;
  const all = new Set();
  const each = (use) => {
    for (let i = 0; i < mesh.triangles.length; i++) use(mesh.triangles[i], mesh.triangles[i % 3 === 2 ? i - 2 : i + 1]);
  };
  each((a, b) => all.add(key(a, b)));
  const next = new Map();
  each((a, b) => !all.has(key(b, a)) && next.set(a, b));
  const loops = [];
  for (const [first] of next) {
    if (!next.has(first)) continue;
    const loop = [];
    for (let v = first; next.has(v); ) {
      loop.push(v);
      const after = next.get(v);
      next.delete(v);
      v = after;
    }
    loops.push({ piece: mesh.pieces[first], loop });
  }
  return loops;
}

const pathOf = (points) => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`).join("");

function pieceShape(piece, d) {
  const shape = make("path", { d, onclick: () => app.select(piece) }, make("title", {}, `Piece ${scene.pieces[piece].name}`));
  shape.style.fill = css(app.colors[piece]);
  return shape;
}

/** The sphere seen from a little above its equator, with the seams on the near side. */
function sphereDrawing(mesh, loops) {
  const most = [0, 1, 2].map((k) => mesh.points.reduce((high, it, i) => (i % 3 === k ? Math.max(high, it) : high), -Infinity));
  const least = [0, 1, 2].map((k) => mesh.points.reduce((low, it, i) => (i % 3 === k ? Math.min(low, it) : low), Infinity));
  const [up, middle] = [scene.up, most.map((it, k) => (it + least[k]) / 2)];
  const radius = (most[up] - least[up]) / 2;
  const tilt = 0.35;
  const place = (v) => {
    const p = sub(mesh.point(v), middle).map((it) => it / radius);
    const [x, y, z] = [p[(up + 1) % 3], p[(up + 2) % 3], p[up]];
    return { at: [100 * y, -100 * (z * Math.cos(tilt) - x * Math.sin(tilt))], near: x * Math.cos(tilt) + z * Math.sin(tilt) };
  };
  const svg = make("svg", { class: "globe", viewBox: "-104 -104 208 208", role: "img", "aria-label": "the seams on the sphere" });
  svg.append(make("circle", { cx: 0, cy: 0, r: 100 }));
  for (const { loop } of loops) {
    let run = [];
    const flush = () => {
      if (run.length > 1) svg.append(make("path", { d: pathOf(run) }));
      run = [];
    };
    for (const v of [...loop, loop[0]]) {
      const { at, near } = place(v);
      if (near > 0) run.push(at);
      else flush();
    }
    flush();
  }
  return svg;
}

/** The pieces in the plane, in rows, to one scale. */
function flatDrawing(mesh, loops) {
  const boxes = new Map();
  const flat = (v) => [mesh.flat[2 * v], -mesh.flat[2 * v + 1]];
  for (const { piece, loop } of loops) {
    const box = boxes.get(piece) ?? { least: [Infinity, Infinity], most: [-Infinity, -Infinity], loops: [] };
    box.loops.push(loop);
    for (const v of loop) flat(v).forEach((it, k) => { box.least[k] = Math.min(box.least[k], it); box.most[k] = Math.max(box.most[k], it); });
    boxes.set(piece, box);
  }
  const sizes = [...boxes].sort((a, b) => a[0] - b[0]).map(([piece, box]) => ({ piece, ...box, size: [0, 1].map((k) => box.most[k] - box.least[k]) }));
  const area = sizes.reduce((sum, it) => sum + it.size[0] * it.size[1], 0);
  const widest = Math.max(...sizes.map((it) => it.size[0]), 1.7 * Math.sqrt(area));
  const gap = 0.015 * widest;
  const svg = make("svg", { class: "gores", role: "img", "aria-label": "the pieces laid flat" });
  let [x, y, row] = [0, 0, 0];
  for (const { piece, least, loops: own, size } of sizes) {
    if (x > 0 && x + size[0] > widest) [x, y, row] = [0, y + row + gap, 0];
    const shift = [x - least[0], y - least[1]];
    const d = own.map((loop) => `${pathOf(loop.map((v) => flat(v).map((it, k) => it + shift[k])))}Z`).join("");
    svg.append(pieceShape(piece, d));
    [x, row] = [x + size[0] + gap, Math.max(row, size[1])];
  }
  svg.setAttribute("viewBox", `${-gap} ${-gap} ${widest + 2 * gap} ${y + row + 2 * gap}`);
  return svg;
}

/** One row for each slice: where it is, how much it stretches, and that against what the material takes. */
function slicesTable(table) {
  const caps = (table.caps ?? []).map((it, i) => ({ ...it, name: ["top cap", "bottom cap"][i] })).filter((it) => it.principal_stretch > 0);
  const most = Math.max(table.stretch_limit, ...[...table.slices, ...caps].map((it) => it.principal_stretch ?? 0));
  const where = (it, i) => {
    if (it.name) return it.name;
    if (it.from_deg !== undefined) return `from ${short(it.from_deg)}°`;
    return it.to_latitude_deg !== undefined ? `up to ${short(it.to_latitude_deg)}°` : `slice ${i + 1}`;
  };
  const row = (it, i) => {
    const over = !(it.principal_stretch <= table.stretch_limit);
    const bar = make("span", { class: over ? "time-bar over" : "time-bar" });
    bar.style.width = `${(100 * (it.principal_stretch ?? most)) / most}%`;
    const figure = it.principal_stretch === null ? "is no disk" : `${(100 * it.principal_stretch).toFixed(2)} %`;
    return [it.name ? "" : String(i + 1), where(it, i), make("span", { class: "time-track" }, bar), { number: make("span", { class: over ? "bad" : "" }, figure) }];
  };
  return tableOf(["slice", "", "", { number: "stretch" }], [...table.slices, ...caps].map(row), "stages");
}

function spherePanel() {
  const table = report.sphere;
  if (!table) return null;
  const sound = table.flips === 0 && table.degree === 1;
  const found = make("span", { class: sound ? "ok" : "bad" }, sound ? "✓ one to one" : "✗ not one to one");
  const proof = `: ${short(table.faces)} faces, ${table.flips} turned over, the sphere covered ${table.degree === 1 ? "once" : `${table.degree} times`}, each by an exact predicate, again after reading sphere/map.obj. `;
  const quality = `Angles: a circle becomes an ellipse of ${short(table.dilatation_mean)} on the average and at most ${short(table.dilatation_p99)} on 99 % of the area (½ (σ₁/σ₂ + σ₂/σ₁), 1 is exact); energy ${table.energy.toFixed(3)}, 8π = 25.133 is a smooth one. Found in ${duration(table.seconds)}.`;
  const out = [make("p", {}, found, proof, quality)];
  const mesh = app.meshes.find((it) => it.name === "sphere");
  if (mesh?.flat) {
    const loops = outlines(mesh);
    const show = () => {
      app.showMesh("sphere");
      byId("work").scrollIntoView({ behavior: "smooth", block: "start" });
    };
    out.push(make("div", { class: "beside" }, sphereDrawing(mesh, loops), flatDrawing(mesh, loops)));
    if (app.viewer) out.push(make("p", { class: "row" }, make("button", { type: "button", class: "button", onclick: show }, "Look at the sphere"), make("span", { class: "note" }, "turn it, and unroll it with the slider below the view")));
  }
  const limit = `Stretch on 99.9 % of the area of a slice; the limit is ${(100 * table.stretch_limit).toFixed(2)} %. ${table.note}.`;
  out.push(slicesTable(table), make("p", { class: "note" }, limit));
  const rest = Object.fromEntries(Object.entries(table).filter(([key]) => !["slices", "caps", "note"].includes(key)));
  return panel("sphere", "Sphere", ...out, make("details", {}, make("summary", {}, "as numbers"), figures(rest)));
}
