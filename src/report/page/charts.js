// Plots as SVG, drawn with the colours of the page.

/** Nice values between two numbers: powers of ten for a logarithmic axis. */
function decades(low, high) {
  const out = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++) out.push(10 ** e);
  return out.filter((it) => it >= low / 1.0001 && it <= high * 1.0001);
}

function niceSteps(high) {
  const rough = high / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((it) => it * power).find((it) => it >= rough);
  return Array.from({ length: Math.floor(high / step) + 1 }, (_, i) => i * step);
}

/** A plot of lines `{ points: [[x, y]…], style, title }`; `log` makes the y axis logarithmic. */
function plot({ lines, xTitle, yTitle, log }) {
  const [width, height] = [640, 260];
  const [left, right, top, bottom] = [58, 16, 14, 42];
  const all = lines.flatMap((it) => it.points);
  const xMost = Math.max(...all.map((it) => it[0]), 1e-9);
  const ys = all.map((it) => it[1]).filter((it) => !log || it > 0);
  let [low, high] = [log ? Math.min(...ys) : 0, Math.max(...ys)];
  if (log) [low, high] = [10 ** Math.floor(Math.log10(low)), 10 ** Math.ceil(Math.log10(high * 1.0001))];
  const scaled = (y) => (log ? Math.log(Math.max(y, low) / low) / Math.log(high / low) : y / high);
  const x = (value) => left + ((width - left - right) * value) / xMost;
  const y = (value) => height - bottom - (height - top - bottom) * scaled(value);
  const svg = make("svg", { class: "plot", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${yTitle} over ${xTitle}` });
  for (const value of log ? decades(low, high) : niceSteps(high)) {
    svg.append(make("line", { class: "grid", x1: left, x2: width - right, y1: y(value), y2: y(value) }));
    svg.append(make("text", { x: left - 8, y: y(value) + 4, "text-anchor": "end" }, short(value)));
  }
  for (const value of niceSteps(xMost)) {
    svg.append(make("text", { x: x(value), y: height - bottom + 18, "text-anchor": "middle" }, short(value)));
  }
  svg.append(make("text", { x: (left + width - right) / 2, y: height - 6, "text-anchor": "middle" }, xTitle));
  svg.append(make("text", { class: "axis", x: left, y: top - 2 }, yTitle));
  for (const line of lines) {
    const points = line.points.map(([px, py]) => `${x(px).toFixed(1)},${y(py).toFixed(1)}`);
    svg.append(make("polyline", { class: `curve ${line.style}`, points: points.join(" ") }));
    for (const [px, py] of line.points) {
      const dot = make("circle", { class: `dot ${line.style}`, cx: x(px), cy: y(py), r: 3.5 });
      dot.append(make("title", {}, `${line.title}: ${short(py)}`));
      svg.append(dot);
    }
  }
  return svg;
}

/** Energy over steps, a line for each round; rounds of finer levels begin anew. */
function roundsPlot(rounds) {
  let steps = 0;
  const lines = rounds.map((it, i) => {
    const from = steps;
    steps += Math.max(1, it.iterations);
    const title = `Round ${i + 1}${it.correction ? " (correction)" : ""}, level ${it.level}`;
    return { title, style: it.correction ? "second" : "first", points: [[from, it.energy_start], [steps, it.energy_end]] };
  });
  return plot({ lines, xTitle: "steps of the optimiser", yTitle: "developability energy (lower is nearer to flat material)", log: true });
}
