// What stands under the views. A recipe with figures of its own adds a row to PANELS; a table of the report that no row
// names is shown as it is.

/** Words for keys of the report. */
const WORDS = {
  hausdorff_pct: "largest distance from the input (% of the diagonal)",
  hausdorff_bound_pct: "proven bound of that distance (%)",
  mean_pct: "mean distance from the input (%)",
  max_deviation_pct: "distance promised (%)",
  covariance_energy: "developability energy",
  seam_length_mm: "length of the seams (mm)",
  seam_length_rel: "length of the seams (diagonals)",
  max_principal_stretch: "largest stretch",
  p99_principal_stretch: "stretch on 99 % of the area",
  density: "share of the sheets used",
  cut_mm: "way of the tool at work (mm)",
  travel_mm: "way of the tool between (mm)",
  lifts: "lifts of the tool",
  seconds_estimate: "time on the machine (s, estimated)",
  cut_m: "to cut (m)",
  fold_m: "to fold (m)",
};

/** What to do about a failed check, where its note does not say. */
const ADVICE = [
  [/^develop\.deviation/, "Allow more with develop.max_deviation, or start from more faces (coarsen.faces)."],
  [/^develop\.(folds|self_intersections)/, "Try another coarsen.method or more coarsen.faces; look at the place in the view “Developable”."],
  [/^flatten\.stretch/, "Raise material.stretch if the material forgives it, or let cut.style make more pieces."],
  [/^flatten\.|^unfold\.overlaps/, "Cut with another cut.style or a lower cut.tolerance, so that the piece is divided."],
  [/^seams\./, "Both sides of this seam must be equally long: lower cut.stretch, so that the pieces stretch less."],
  [/^layout\.labels/, "Make the model larger, or the letters smaller (layout.text), or write the missing numbers on by hand."],
  [/^layout\./, "Make the model larger, or choose another material.join, so that tabs and marks find room."],
  [/^nest\.unplaced/, "Use larger sheets (material.sheet), a smaller model (input.height), or cut.fit_sheet = true."],
  [/^nest\./, "Raise nest.effort or the gap of the machine profile, and run again."],
  [/^strips\./, "The pieces can be cut all the same; rulings of the pieces named are missing or cross."],
  [/^route\.kerf/, "Use a finer tool, or leave the hole out: it is narrower than the cut."],
  [/^(files|cut)\./, "Do not send this file to a machine. This is a fault of fabricate: please report it with the config."],
  [/./, "Open the note above: it names the place. `fabricate check` says what the config asks for."],
];

const panel = (id, title, ...children) => make("section", { class: "card panel", id }, make("h2", {}, title), ...children);

function tableOf(head, rows, className = "") {
  const cells = (tag) => (it) => make(tag, { class: typeof it === "object" && it?.number ? "number" : "" }, it?.number ?? it);
  return make(
    "div",
    { class: "scroll" },
    make(
      "table",
      { class: className },
      make("thead", {}, make("tr", {}, ...head.map(cells("th")))),
      make("tbody", {}, ...rows.map((row) => (row instanceof Node ? row : make("tr", {}, ...row.map(cells("td")))))),
    ),
  );
}

const number = (value) => ({ number: short(value) });

function checksPanel() {
  const checks = report.checks ?? [];
  if (checks.length === 0) return null;
  const failed = checks.filter((it) => !it.ok);
  const row = (it) => {
    const advice = it.ok ? null : make("p", { class: "advice" }, make("strong", {}, "What to do: "), ADVICE.find(([name]) => name.test(it.name))[1]);
    return make(
      "tr",
      { class: it.ok ? "" : "failed" },
      make("td", { class: "mark" }, make("span", { class: it.ok ? "ok" : "bad" }, it.ok ? "✓ holds" : "✗ failed")),
      make("td", {}, make("code", {}, it.name), it.note ? make("p", { class: "note" }, it.note) : null, advice),
      make("td", { class: "number" }, `${short(it.value)} ${it.unit}`.trim()),
      make("td", { class: "number" }, short(it.limit)),
    );
  };
  const head = ["", "check", { number: "measured" }, { number: "limit" }];
  const held = checks.filter((it) => it.ok);
  const all = make("details", {}, make("summary", {}, `${held.length} of ${checks.length} checks hold`), tableOf(head, held.map(row), "checks"));
  const bad = failed.length > 0 ? tableOf(head, failed.map(row), "checks") : make("p", {}, "Every check holds: what was promised was measured again in the files.");
  return panel("checks", failed.length > 0 ? `${failed.length} failed ${failed.length === 1 ? "check" : "checks"}` : "Checks", bad, all);
}

function assemblyPanel() {
  const steps = report.assembly?.steps ?? [];
  if (steps.length === 0) return null;
  const list = (word, labels) => (labels.length === 0 ? null : `${word} ${labels.join(", ")}`);
  const row = (it, i) => {
    const words = [
      i === 0 ? "begin here" : it.to.length > 0 ? `join to ${it.to.join(", ")}` : "a new body",
      list("seams", it.seams),
      list("close its own seams", it.own_seams),
    ];
    const button = make("button", { type: "button", class: "step", "data-step": i, onclick: () => app.showStep(app.step === i ? null : i) });
    button.append(make("span", { class: "step-number" }, String(i + 1)), make("strong", {}, it.part), make("span", { class: "note" }, words.filter(Boolean).join(" · ")));
    return make("li", {}, button);
  };
  const move = (by) => () => app.showStep(Math.min(steps.length - 1, Math.max(0, (app.step ?? -1) + by)));
  const buttons = make(
    "p",
    { class: "row" },
    make("button", { type: "button", class: "button", onclick: move(-1) }, "‹ Back"),
    make("button", { type: "button", class: "button", id: "next-step", onclick: move(1) }, "Next step ›"),
    make("button", { type: "button", class: "button", onclick: () => app.showStep(null) }, "All pieces"),
  );
  const about = make("p", {}, `${report.assembly.joining}. Each step lights up in the view above; `, make("a", { href: "assembly.pdf" }, "assembly.pdf"), " has the same with pictures, to print.");
  return panel("assembly", "Putting it together", about, buttons, make("ol", { class: "steps" }, ...steps.map(row)));
}

function roundsPanel() {
  const rounds = report.develop?.rounds ?? [];
  if (rounds.length === 0) return null;
  const key = make("p", { class: "key" }, make("span", { class: "swatch first" }), "rounds ", make("span", { class: "swatch second" }), "corrections after the proof");
  const head = ["round", "energy", { number: "faces" }, { number: "before" }, { number: "after" }, { number: "steps" }, { number: "time" }, "ended by"];
  const row = (it, i) => [`${i + 1}${it.correction ? " (correction)" : ""}`, it.energy, number(it.faces), number(it.energy_start), number(it.energy_end), number(it.iterations), { number: duration(it.seconds) }, it.stopped];
  const numbers = make("details", {}, make("summary", {}, "as numbers"), tableOf(head, rounds.map(row)));
  return panel("rounds", "How the surface became developable", roundsPlot(rounds), key, numbers);
}

function piecesPanel() {
  const placed = report.layout?.placed ?? [];
  if (placed.length === 0) return null;
  const flat = new Map((report.flatten?.pieces ?? []).map((it) => [it.name, it]));
  const head = ["part", { number: "sheet" }, { number: "area cm²" }, { number: "size mm" }, { number: "worst stretch" }, "joined to"];
  const order = new Map(scene.pieces.map((it, i) => [it.name, i]));
  const sorted = [...placed].sort((a, b) => (order.get(a.name) ?? Infinity) - (order.get(b.name) ?? Infinity));
  const rows = sorted.map((it) => {
    const piece = scene.pieces.findIndex((p) => p.name === it.name);
    const [x0, y0, x1, y1] = it.box_mm;
    const name = make("button", { type: "button", class: "link", onclick: () => app.select(piece, true) }, it.name);
    const stretch = flat.get(it.name)?.max_abs_log_scale;
    const partners = [...(app.partners(piece) ?? [])].map((p) => scene.pieces[p].name).join(", ");
    const shown = { number: stretch === undefined ? "–" : `${(100 * stretch).toFixed(2)} %` };
    return [name, { number: String(it.sheet) }, number(it.area_mm2 / 100), { number: `${Math.round(x1 - x0)} × ${Math.round(y1 - y0)}` }, shown, partners || "itself only"];
  });
  return panel("parts", "Parts", tableOf(head, rows));
}

function stagesPanel() {
  const stages = report.stages ?? [];
  if (stages.length === 0) return null;
  const most = Math.max(...stages.map((it) => it.seconds), 1e-9);
  const row = (it) => {
    const bar = make("span", { class: "time-bar" });
    bar.style.width = `${(100 * it.seconds) / most}%`;
    return [it.name, it.cached ? make("span", { class: "note" }, "kept from before") : make("span", { class: "time-track" }, bar), { number: duration(it.seconds) }];
  };
  const memory = report.peak_rss_mb ? `, ${short(report.peak_rss_mb)} MB of memory at most` : "";
  return panel("stages", "Stages", tableOf(["stage", "", { number: "time" }], stages.map(row), "stages"), make("p", { class: "note" }, `${duration(report.seconds_total)} in all${memory}.`));
}

function filesPanel() {
  const files = report.files ?? [];
  if (files.length === 0) return null;
  const folders = new Map();
  for (const it of files) {
    const folder = it.path.includes("/") ? it.path.slice(0, it.path.lastIndexOf("/") + 1) : "";
    folders.set(folder, [...(folders.get(folder) ?? []), it]);
  }
  const about = { "sheets/": "nested sheets: what the machine cuts", "parts/": "one file per part, for a shop", "model/": "the meshes", "preview/": "pictures", "strips/": "bends, for rolling and press brakes", "toolpaths/": "programs of the mill", "stripes/": "the lines", "mold/": "parts of the mould, its programs, profile and panels", "laths/": "one drawing per lath, and the cut list", "folded/": "the folded sheet, the steps on its way, fold angles and the pattern", "": "instructions" };
  const href = (path) => path.split("/").map(encodeURIComponent).join("/");
  const row = (it) => [make("a", { href: href(it.path) }, it.path.slice(it.path.lastIndexOf("/") + 1)), it.format, { number: fileSize(it.bytes) }];
  const group = ([folder, list]) => {
    const size = list.reduce((sum, it) => sum + it.bytes, 0);
    const title = make("summary", {}, make("code", {}, folder || "./"), ` ${list.length} ${list.length === 1 ? "file" : "files"}, ${fileSize(size)}`, make("span", { class: "note" }, ` ${about[folder] ?? ""}`));
    return make("details", { open: folder === "sheets/" }, title, tableOf(["file", "format", { number: "size" }], list.map(row)));
  };
  return panel("files", "Files", ...[...folders].map(group));
}

/** A table of the report as rows of names and values; lists only by their length. */
function figures(table) {
  const words = (key) => WORDS[key] ?? key.replace(/_(mm|pct|deg)$/, (_, unit) => ` (${{ mm: "mm", pct: "%", deg: "°" }[unit]})`).replaceAll("_", " ");
  const shown = (value) => {
    if (typeof value === "number") return short(value);
    if (Array.isArray(value)) return value.every((it) => typeof it === "number") && value.length <= 4 ? value.map(short).join(" × ") : `${value.length} listed in report.json`;
    if (value && typeof value === "object") return Object.entries(value).map(([key, it]) => `${key} ${shown(it)}`).join(", ");
    return typeof value === "boolean" ? (value ? "yes" : "no") : String(value);
  };
  const fine = Object.entries(table).filter(([, it]) => it !== null && !(Array.isArray(it) && it.length === 0));
  return tableOf(["", ""], fine.map(([key, it]) => [words(key), shown(it)]), "facts");
}

function stripesPanel() {
  const table = report.stripes;
  if (!table) return null;
  const ends = (list) => (list ?? []).length;
  const about = `${short(table.lines)} lines, ${short(table.spacing_mm?.mean)} mm apart on the average; they begin or end at ${ends(table.found)} places, marked + and − in the view “Input”.`;
  return panel("stripes", "Stripes", make("p", {}, about), make("details", {}, make("summary", {}, "as numbers"), figures(table)));
}

function foldPanel() {
  const table = report.fold;
  if (!table) return null;
  const strip = scene.folding ? [make("img", { src: scene.folding, alt: "the steps from flat to folded", style: "max-width: 100%" })] : [];
  const head = ["crease", { number: "length mm" }, { number: "mean angle °" }, "folds"];
  const row = (it) => [String(it.crease), number(it.length_mm), number(it.mean_angle_deg), it.folds.join(", ")];
  const creases = make("details", { open: table.creases.length <= 12 }, make("summary", {}, "creases"), tableOf(head, table.creases.map(row)));
  return panel("fold", "Folding", ...strip, creases, make("details", {}, make("summary", {}, "as numbers"), figures(table)));
}

/** The recipes `net` and `mold`: pictures of the net, its figures, and the parts of the moulds. */
function netPanel() {
  if (!report.net) return null;
  const picture = ({ about, src }) => make("figure", {}, make("img", { src, alt: `the net, coloured by ${about}` }), make("figcaption", { class: "note" }, about));
  const head = ["part of the mould", { number: "width × depth × height mm" }, { number: "volume cm³" }, { number: "dowel holes" }];
  const row = (it) => [it.file, it.size_mm.map((x) => x.toFixed(1)).join(" × "), number(it.volume_mm3 / 1000), { number: it.dowel_holes }];
  const segments = report.mold?.segments?.length ? [tableOf(head, report.mold.segments.map(row))] : [];
  const tables = ["net", "bend", "mold"].filter((key) => report[key]).map((key) => make("details", {}, make("summary", {}, key), figures(report[key])));
  const pictures = make("div", { class: "pictures" }, ...scene.net.map(picture));
  return panel("net", report.mold ? "Net and mould" : "Net", pictures, ...segments, ...tables);
}

/** Tables of the report that have a panel of their own, or are shown above. */
const SHOWN = ["config", "stages", "checks", "files", "assembly", "stripes", "sphere", "fold", "net", "bend", "mold"];

/** Everything else that was measured. */
function measuresPanel() {
  const tables = Object.entries(report).filter(([key, it]) => it && typeof it === "object" && !Array.isArray(it) && !SHOWN.includes(key));
  if (tables.length === 0) return null;
  const group = ([key, table]) => make("details", {}, make("summary", {}, key), figures(table));
  return panel("measures", "Measured", ...tables.map(group));
}

function configPanel() {
  if (!report.config) return null;
  const command = make("p", {}, "The whole config with its defaults. ", make("code", {}, "fabricate init"), " writes one to edit.");
  const text = make("pre", { tabindex: 0 }, JSON.stringify(report.config, null, 2));
  return panel("config", "Config", command, make("details", {}, make("summary", {}, "show"), text));
}

/** In this order; each returns an element, or null where the job has nothing of the kind. */
const PANELS = [checksPanel, assemblyPanel, piecesPanel, stripesPanel, spherePanel, foldPanel, netPanel, roundsPanel, stagesPanel, filesPanel, measuresPanel, configPanel];
