// Puts the page together and holds what is chosen.

/** What the views share. `selected` is a piece, or -1. */
const app = { meshes: [], seams: [], colors: [], selected: -1, step: null, edges: "angle", lines: new Set(["seams", "stripes"]), names: true };

function problem(text) {
  byId("problem").hidden = false;
  byId("problem").textContent = text;
}

/** Pieces that share a seam with one. */
app.partners = (piece) => {
  const out = new Set();
  for (const { pieces } of app.seams) {
    if (pieces[0] === piece && pieces[1] !== piece) out.add(pieces[1]);
    if (pieces[1] === piece && pieces[0] !== piece) out.add(pieces[0]);
  }
  return out;
};

/** The seams of a piece, its own included. */
app.seamsOf = (piece) => app.seams.filter((it) => it.pieces.includes(piece));

/** Chooses a piece in all views; the same again, or -1, chooses none. */
app.select = (piece, bring) => {
  app.step = null;
  app.selected = piece === app.selected && !bring ? -1 : piece;
  if (app.selected >= 0 && app.viewer && !app.mesh.pieces) app.showMesh("cut");
  refresh();
  const view = app.selected >= 0 ? app.views.findIndex((it) => it.parts.some((part) => part.piece === app.selected)) : -1;
  if (view >= 0) {
    app.showSheet(view);
    app.views[view].reveal(app.selected);
  }
  if (bring) byId("work").scrollIntoView({ behavior: "smooth", block: "start" });
};

/** Shows the pieces up to a step of the assembly, the new one lit; null shows all. */
app.showStep = (step) => {
  app.step = step;
  app.selected = -1;
  if (step !== null && app.viewer) app.showMesh("cut");
  refresh();
  if (step !== null) {
    const piece = pieceOfStep(step);
    const view = app.views.findIndex((it) => it.parts.some((part) => part.piece === piece));
    if (view >= 0) app.showSheet(view);
  }
};

const pieceOfStep = (step) => scene.pieces.findIndex((it) => it.name === report.assembly.steps[step].part);

/** Makes every view show what is chosen. */
function refresh() {
  const chosen = app.step === null ? app.selected : pieceOfStep(app.step);
  const seams = chosen < 0 ? [] : app.step === null ? app.seamsOf(chosen) : stepSeams();
  const partners = new Set(seams.flatMap((it) => it.pieces).filter((it) => it !== chosen));
  const states = new Uint8Array(scene.pieces.length + 1);
  if (app.step !== null) {
    states.fill(STATE.hidden, 1);
    for (let i = 0; i <= app.step; i++) states[pieceOfStep(i) + 1] = STATE.plain;
    states[chosen + 1] = STATE.selected;
  } else if (chosen >= 0) {
    states.fill(STATE.dim, 1);
    partners.forEach((it) => (states[it + 1] = STATE.partner));
    states[chosen + 1] = STATE.selected;
  }
  if (app.viewer) {
    app.viewer.setPieces(app.offsets, states);
    const cut = hasPieces(app.mesh) ? app.mesh : app.meshes.find((it) => it.name === "cut");
    app.viewer.setLines("marked", chosen >= 0 && cut && app.mesh.pieces ? seamSegments(cut, seams, 4, INK) : null);
    app.seamNumbers = chosen >= 0 && app.mesh.pieces ? seams : [];
  }
  app.views.forEach((it) => it.mark(chosen, partners, seams));
  describe(chosen, seams);
  byId("chips").querySelectorAll("button").forEach((it, i) => {
    it.setAttribute("aria-pressed", i === chosen);
    it.classList.toggle("partner", partners.has(i));
  });
  document.querySelectorAll(".step").forEach((it, i) => it.setAttribute("aria-pressed", i === app.step));
}

function stepSeams() {
  const { seams, own_seams: own } = report.assembly.steps[app.step];
  const wanted = new Set([...seams, ...own]);
  return app.seams.filter((it) => wanted.has(it.label));
}

/** What is known of the chosen piece, under the views. */
function describe(piece, seams) {
  const host = byId("details");
  if (piece < 0) {
    const hint = scene.pieces.length > 0 ? "Choose a piece here, in the model, or on a sheet: it lights up in all of them, with the pieces it is joined to." : "";
    return host.replaceChildren(make("p", { class: "note" }, hint));
  }
  const { name, faces, area_mm2: area } = scene.pieces[piece];
  const sheet = app.views.find((it) => it.parts.some((part) => part.piece === piece));
  const facts = [`${short(area / 100)} cm²`, `${short(faces)} faces`, sheet ? sheet.header.name.toLowerCase() : "on no sheet"];
  const row = (other) => {
    const shared = seams.filter((it) => it.pieces.includes(other) && (other !== piece || it.pieces[0] === it.pieces[1]));
    const labels = shared.map((it) => `${it.label} (${short(it.mm)} mm)`).join(", ");
    const to = other === piece ? "to itself" : make("button", { type: "button", class: "link", onclick: () => app.select(other) }, `to ${scene.pieces[other].name}`);
    return make("li", {}, to, make("span", { class: "note" }, ` seam${shared.length === 1 ? "" : "s"} ${labels}`));
  };
  const others = new Set(seams.flatMap((it) => (it.pieces[0] === it.pieces[1] ? [piece] : it.pieces.filter((p) => p !== piece))));
  host.replaceChildren(
    make("h3", {}, `Piece ${name}`, make("span", { class: "note" }, ` ${facts.join(" · ")}`)),
    make("ul", { class: "joined" }, ...[...others].sort((a, b) => a - b).map(row)),
  );
}

/** Buttons of which the arrow keys choose one. */
function roving(host, pressed) {
  const all = () => [...host.querySelectorAll("button")];
  const settle = (chosen) => all().forEach((it) => (it.tabIndex = it === chosen ? 0 : -1));
  host.addEventListener("keydown", (event) => {
    const list = all();
    const at = list.indexOf(document.activeElement);
    const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1, Home: -Infinity, End: Infinity }[event.key];
    if (by === undefined || at < 0) return;
    event.preventDefault();
    const next = list[Math.min(list.length - 1, Math.max(0, at + by))];
    settle(next);
    next.focus();
    if (pressed) next.click();
  });
  settle(all()[0]);
  return settle;
}

/** A row of tabs; returns the function that chooses one. */
function tabs(host, titles, choose) {
  titles.forEach((title, i) => host.append(make("button", { type: "button", role: "tab", "aria-selected": "false", onclick: () => choose(i) }, title)));
  const settle = roving(host, true);
  return (index) => {
    const list = [...host.querySelectorAll("button")];
    list.forEach((it, i) => it.setAttribute("aria-selected", i === index));
    settle(list[index]);
  };
}

function header() {
  const { config = {}, input = {} } = report;
  byId("title").textContent = input.file ?? "A job";
  byId("kicker").textContent = [report.recipe, config.material?.title, config.machine?.title].filter(Boolean).join(" · ");
  const failed = (report.checks ?? []).filter((it) => !it.ok).length;
  const status = byId("status");
  status.textContent = failed === 0 ? `✓ all ${(report.checks ?? []).length} checks hold` : `✗ ${failed} of ${report.checks.length} checks failed`;
  status.classList.toggle("failed", failed > 0);
  const percent = (value) => `${short(100 * value)} %`;
  const rows = [
    ["size", input.size_mm?.map((it) => Math.round(it)).join(" × "), "mm"],
    ["pieces", report.layout?.parts ?? report.cut?.pieces],
    ["sheets", report.layout?.sheets, report.layout?.sheet_mm ? `of ${report.layout.sheet_mm.map((it) => Math.round(it)).join(" × ")} mm` : ""],
    ["on the machine", report.route ? duration(report.route.seconds_estimate) : undefined],
    ["largest deviation", report.develop ? short(report.develop.hausdorff_pct) : report.coarsen?.hausdorff_pct > 0 ? short(report.coarsen.hausdorff_pct) : undefined, "% of the diagonal"],
    ["stretch on 99 %", report.flatten ? percent(report.flatten.p99_principal_stretch) : undefined],
  ];
  for (const [name, value, unit] of rows) {
    if (value === undefined || value === null) continue;
    byId("figures").append(make("div", {}, make("dt", {}, name), make("dd", {}, String(value), unit ? make("small", {}, ` ${unit}`) : null)));
  }
  byId("footer").textContent = `fabricate ${report.fabricate} · seed ${report.seed} · this page is one file and asks the network for nothing`;
}

/** How the pieces move apart: away from the middle of the model. */
function offsets() {
  const cut = app.meshes.find((it) => it.name === "cut");
  const out = new Float32Array(4 * (scene.pieces.length + 1));
  if (!cut) return out;
  const sums = scene.pieces.map(() => [0, 0, 0, 0]);
  for (let f = 0; f < cut.faceCount; f++) {
    const corners = cut.corners(f);
    const area = Math.hypot(...cut.normal(f)) / 2;
    const sum = sums[cut.pieces[corners[0]]];
    for (const v of corners) cut.point(v).forEach((it, k) => (sum[k] += (area * it) / 3));
    sum[3] += area;
  }
  const total = sums.reduce((a, b) => a.map((it, k) => it + b[k]), [0, 0, 0, 0]);
  sums.forEach((sum, i) => {
    for (let k = 0; k < 3; k++) out[4 * (i + 1) + k] = sum[k] / (sum[3] || 1) - total[k] / (total[3] || 1);
  });
  return out;
}

/** The ways in which a mesh can be coloured: name, title, and the colour of a vertex. */
function colorings(mesh) {
  const out = [];
  if (mesh.pieces) out.push({ name: "piece", title: "piece", of: (v) => app.colors[mesh.pieces[v]] });
  if (mesh.strips) {
    const colors = SURFACES.map((it) => oklch(...it));
    out.unshift({ name: "strip", title: "strip", of: (v) => colors[(mesh.strips[v] * 3) % colors.length] });
  }
  for (const field of mesh.fields) {
    const colors = ramp(field.kind);
    out.push({ name: field.name, title: field.title, field, of: (v) => colors[field.values[v]] });
  }
  out.push({ name: "plain", title: "nothing", of: () => PLAIN });
  return out;
}

function legend(coloring) {
  const host = byId("legend");
  const { field } = coloring;
  host.hidden = !field;
  if (!field) return;
  const stops = ramp(field.kind).filter((_, i) => i % 17 === 0).map(css);
  const bar = make("span", { class: "ramp" });
  bar.style.background = `linear-gradient(90deg, ${stops.join(", ")})`;
  const ends = field.kind === "diverging" ? [-field.most, field.most] : [field.most / 10 ** field.decades, field.most];
  host.replaceChildren(make("strong", {}, field.title), bar, make("span", { class: "ends" }, make("span", {}, short(ends[0])), make("span", {}, short(ends[1]))), make("span", { class: "note" }, field.about));
}

/** Chooses a mesh, and keeps the colouring where it has it. */
app.showMesh = (name) => {
  const index = Math.max(0, app.meshes.findIndex((it) => it.name === name));
  app.mesh = app.meshes[index];
  app.markMesh(index);
  const ways = colorings(app.mesh);
  const select = byId("color");
  select.replaceChildren(...ways.map((it) => make("option", { value: it.name }, it.title)));
  app.paint(ways.some((it) => it.name === app.coloring) ? app.coloring : ways[0].name);
  for (const id of ["explode", "unroll"]) byId(id).closest("label").hidden = !app.mesh.pieces || (id === "unroll" && !app.mesh.flat);
  for (const input of byId("controls").querySelectorAll("input[data-lines]")) {
    input.closest("label").hidden = !linesOf(app.mesh).includes(input.dataset.lines);
  }
  app.drawLines();
  refresh();
};

app.paint = (name) => {
  const coloring = colorings(app.mesh).find((it) => it.name === name);
  app.coloring = name;
  byId("color").value = name;
  const colors = new Uint8Array(3 * app.mesh.vertexCount);
  for (let v = 0; v < app.mesh.vertexCount; v++) colors.set(coloring.of(v), 3 * v);
  app.viewer.show(app.mesh, colors);
  legend(coloring);
};

/** Whether a mesh has the vertices of the cut mesh: that itself, or its image on the sphere. */
const hasPieces = (mesh) => mesh.name === "cut" || mesh.name === "sphere";

/** Names of the sets of lines that can lie on a mesh. */
function linesOf(mesh) {
  const own = scene.lines.filter((it) => it.models.includes(mesh.name)).map((it) => it.name);
  return [...(hasPieces(mesh) ? ["seams", "names"] : []), ...own];
}

app.drawLines = () => {
  const { viewer, mesh } = app;
  viewer.setLines("edges", edgeSegments(mesh, app.edges));
  const shown = (name) => app.lines.has(name) && linesOf(mesh).includes(name);
  viewer.setLines("seams", shown("seams") ? seamSegments(mesh, app.seams, 2, INK) : null);
  for (const it of scene.lines) {
    const color = it.name === "rulings" ? oklch(0.45, 0.12, 250) : oklch(0.5, 0.17, 30);
    viewer.setLines(it.name, shown(it.name) ? lineSegments(it, app.payload, it.name === "rulings" ? 1.1 : 2, color) : null);
  }
};

/** Words in the 3-D view: names of the pieces, numbers of the marked seams, and places of a recipe. */
function drawLabels() {
  const { viewer, mesh } = app;
  const words = [];
  const back = viewer.camera.axes()[2];
  const put = (place, text, kind) => {
    const spot = viewer.project(place);
    if (spot) words.push({ spot, text, kind });
  };
  if (mesh.pieces && app.names) {
    app.anchors.forEach(({ vertex, normal }, piece) => {
      const state = viewer.states[piece + 1];
      if (state === STATE.hidden || state === STATE.dim) return;
      const outwards = mesh.name === "cut" ? normal : mesh.normalAt(vertex);
      const faces = viewer.unroll > 0.2 || dot(outwards, back) > -0.1;
      if (faces && hasPieces(mesh)) put(viewer.place(mesh, vertex), scene.pieces[piece].name, state === STATE.selected ? "piece chosen" : "piece");
    });
  }
  for (const seam of app.seamNumbers ?? []) {
    const cut = hasPieces(mesh) ? mesh : app.meshes.find((it) => it.name === "cut");
    const vertex = seam.chains[0][Math.floor(seam.chains[0].length / 2)];
    if (viewer.unroll > 0.2 || dot(cut.normalAt(vertex), back) > 0) put(viewer.place(cut, vertex), String(seam.label), "seam");
  }
  for (const set of scene.dots.filter((it) => it.models.includes(mesh.name))) {
    set.rows.forEach((it) => put(it.place, it.text, "dot"));
  }
  const host = byId("labels");
  while (host.children.length < words.length) host.append(make("span"));
  while (host.children.length > words.length) host.lastChild.remove();
  const taken = [];
  words.forEach(({ spot, text, kind }, i) => {
    const span = host.children[i];
    // Numbers that would lie over each other are left out.
    const free = kind !== "seam" || taken.every((it) => Math.hypot(it[0] - spot[0], it[1] - spot[1]) > 15);
    if (free) taken.push(spot);
    span.className = free ? kind : "away";
    span.textContent = text;
    span.style.transform = `translate(${spot[0].toFixed(1)}px, ${spot[1].toFixed(1)}px) translate(-50%, -50%)`;
  });
}

/** Where the name of each piece stands: on its vertex nearest to its middle, as far as it looks outwards. */
function anchors() {
  const cut = app.meshes.find((it) => it.name === "cut");
  if (!cut) return [];
  const sums = scene.pieces.map(() => [0, 0, 0, 0]);
  for (let v = 0; v < cut.vertexCount; v++) {
    const sum = sums[cut.pieces[v]];
    cut.point(v).forEach((it, k) => (sum[k] += it));
    sum[3]++;
  }
  const best = scene.pieces.map(() => ({ vertex: 0, away: Infinity }));
  for (let v = 0; v < cut.vertexCount; v++) {
    const piece = cut.pieces[v];
    const middle = sums[piece].slice(0, 3).map((it) => it / sums[piece][3]);
    const away = Math.hypot(...sub(cut.point(v), middle));
    if (away < best[piece].away) best[piece] = { vertex: v, away };
  }
  return best.map(({ vertex }) => ({ vertex, normal: cut.normalAt(vertex) }));
}

function spaceControls() {
  const host = byId("controls");
  const field = (text, input) => make("label", {}, make("span", {}, text), input);
  const color = make("select", { id: "color", onchange: (event) => app.paint(event.target.value) });
  const edges = make("select", { id: "edges", onchange: (event) => { app.edges = event.target.value; app.drawLines(); } });
  for (const [value, title] of [["angle", "as they are bent"], ["all", "all"], ["none", "none"]]) edges.append(make("option", { value }, title));
  const slide = (id) => make("input", { type: "range", id, min: 0, max: 100, value: 0, oninput: (event) => { app.viewer[id] = (event.target.value / 100) * (id === "explode" ? 1.2 : 1); app.viewer.changed(); } });
  host.append(field("Colour by", color), field("Edges", edges), field("Explode", slide("explode")), field("Unroll", slide("unroll")));
  const sets = [["seams", "Seams"], ["names", "Names"], ...scene.lines.map((it) => [it.name, it.title])];
  for (const [name, title] of sets) {
    const on = name === "names" ? app.names : app.lines.has(name);
    const change = (event) => {
      if (name === "names") app.names = event.target.checked;
      else app.lines[event.target.checked ? "add" : "delete"](name);
      app.drawLines();
    };
    host.append(make("label", { class: "toggle" }, make("input", { type: "checkbox", "data-lines": name, checked: on, onchange: change }), make("span", {}, title)));
  }
}

function startSpace() {
  const canvas = byId("canvas");
  app.offsets = offsets();
  app.anchors = anchors();
  app.names = scene.pieces.length <= 60;
  app.viewer = new Viewer(canvas);
  const { least, most } = app.meshes[0].points.reduce(
    (box, it, i) => {
      box.least[i % 3] = Math.min(box.least[i % 3], it);
      box.most[i % 3] = Math.max(box.most[i % 3], it);
      return box;
    },
    { least: [Infinity, Infinity, Infinity], most: [-Infinity, -Infinity, -Infinity] },
  );
  const center = least.map((it, k) => (it + most[k]) / 2);
  app.viewer.camera = new Camera(scene.up, center, Math.hypot(...sub(most, least)) / 2 || 1);
  app.viewer.afterwards = drawLabels;
  app.viewer.setPieces(app.offsets, new Uint8Array(scene.pieces.length + 1));
  app.markMesh = tabs(byId("models"), app.meshes.map((it) => it.title), (i) => app.showMesh(app.meshes[i].name));
  spaceControls();
  const clicked = (x, y) => {
    const face = app.viewer.pick(x, y);
    if (!app.mesh.pieces) return;
    if (face < 0) app.select(-1);
    else app.select(app.mesh.pieces[app.mesh.corners(face)[0]]);
  };
  const moved = () => {
    byId("hint").hidden = true;
    app.viewer.changed();
  };
  steer(canvas, app.viewer.camera, moved, clicked);
  byId("home").addEventListener("click", () => {
    app.viewer.camera.reset();
    app.viewer.changed();
  });
  app.showMesh(app.meshes.some((it) => it.name === "cut") ? "cut" : app.meshes.at(-1).name);
}

function startPlane() {
  const host = byId("table");
  app.views = scene.sheets.map((it, i) => new SheetView(host, it, i, app.payload));
  if (app.views.length === 0) {
    byId("plane").hidden = true;
    byId("work").classList.add("alone");
    return;
  }
  const mark = tabs(byId("sheets"), app.views.map((it) => it.header.name), (i) => app.showSheet(i));
  app.views.forEach((it) => {
    if (it.header.paths) it.replay = new Replay(it, app.payload);
  });
  const controls = replayControls(byId("replay"), app.views.map((it) => it.replay).filter(Boolean));
  app.showSheet = (index) => {
    if (app.sheet === index) return;
    app.sheet = index;
    mark(index);
    app.views.forEach((it, i) => it.element.classList.toggle("shown", i === index));
    if (app.views[index].replay) controls.use(app.views[index].replay);
  };
  app.showSheet(0);
  byId("fit").addEventListener("click", () => app.views[app.sheet].reset());
}

function startChips() {
  const host = byId("chips");
  if (scene.pieces.length === 0) return (byId("selection").hidden = true);
  scene.pieces.forEach((it, i) => {
    const chip = make("button", { type: "button", class: "chip", "aria-pressed": "false", "aria-label": `Piece ${it.name}`, onclick: () => app.select(i) }, it.name);
    chip.style.setProperty("--piece", css(app.colors[i]));
    host.append(chip);
  });
  roving(host, false);
}

/** Light or dark as the system has it, until the button says otherwise. */
function startTheme() {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const follow = () => (root.dataset.theme = system.matches ? "dark" : "light");
  follow();
  system.addEventListener("change", follow);
  byId("theme").addEventListener("click", () => {
    system.removeEventListener("change", follow);
    root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
  });
}

/** A printed page has no canvas: the picture takes its place. */
function startPrint() {
  window.addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((it) => it.closest("#checks") && (it.open = true));
    if (!app.viewer) return;
    app.viewer.draw();
    byId("snapshot").src = byId("canvas").toDataURL();
  });
}

async function start() {
  startTheme();
  header();
  app.payload = new Payload(await inflate());
  app.meshes = scene.models.map((it) => new Mesh(it, app.payload));
  app.seams = scene.seams.map((it) => ({ ...it, chains: it.sides.map((side) => app.payload.integers(side)) }));
  app.colors = spread(scene.pieces.length, app.seams.map((it) => it.pieces));
  startPlane();
  startChips();
  try {
    startSpace();
  } catch (error) {
    app.viewer = null;
    byId("space").hidden = true;
    problem(`No 3-D view: ${error.message}. The pictures in preview/ show the same meshes.`);
  }
  byId("panels").append(...PANELS.map((it) => it()).filter(Boolean));
  refresh();
  startPrint();
  document.addEventListener("keydown", (event) => event.key === "Escape" && (app.step !== null ? app.showStep(null) : app.select(-1)));
  document.documentElement.dataset.ready = "true";
}

app.views = [];
window.fabricate = app;
start().catch((error) => {
  problem(`This page could not be built: ${error.message}`);
  throw error;
});
