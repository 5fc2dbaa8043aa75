// Colours. Nothing is told by hue alone: neighbouring pieces differ in lightness or along blue and yellow, which people who
// confuse red and green see; scales run in lightness.

/** From OKLCH (lightness, chroma, hue in degrees) to sRGB bytes (B. Ottosson, "A perceptual color space", 2020). */
function oklch(lightness, chroma, hue) {
  const angle = (hue * Math.PI) / 180;
  return oklab(lightness, chroma * Math.cos(angle), chroma * Math.sin(angle));
}

function oklab(lightness, a, b) {
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  const linear = [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
  return linear.map((it) => {
    const clamped = Math.min(1, Math.max(0, it));
    const encoded = clamped <= 0.0031308 ? 12.92 * clamped : 1.055 * clamped ** (1 / 2.4) - 0.055;
    return Math.round(255 * encoded);
  });
}

const css = ([r, g, b]) => `rgb(${r} ${g} ${b})`;

/** Colours of surfaces: lightness, chroma, hue. */
const SURFACES = [
  [0.88, 0.09, 92],
  [0.74, 0.1, 240],
  [0.8, 0.1, 160],
  [0.75, 0.1, 340],
  [0.69, 0.1, 290],
  [0.86, 0.07, 10],
  [0.65, 0.08, 205],
  [0.92, 0.03, 250],
];
const PLAIN = oklch(0.9, 0.015, 85);
/** Kept for what is chosen; no surface has it. */
const SELECTED = oklch(0.66, 0.19, 45);
const INK = [32, 38, 48];

/** How far apart two surfaces look to somebody who confuses red and green. */
function apart(a, b) {
  const place = ([lightness, chroma, hue]) => {
    const angle = (hue * Math.PI) / 180;
    return [lightness, 0.25 * chroma * Math.cos(angle), chroma * Math.sin(angle)];
  };
  const [p, q] = [place(a), place(b)];
  return Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
}

/** A colour for each of `count` things of which `pairs` are neighbours: each as far from its neighbours as can be, the rarest
 *  of those first. */
function spread(count, pairs) {
  const neighbours = Array.from({ length: count }, () => []);
  for (const [a, b] of pairs) {
    if (a !== b) {
      neighbours[a].push(b);
      neighbours[b].push(a);
    }
  }
  const chosen = new Array(count).fill(-1);
  const used = SURFACES.map(() => 0);
  for (let i = 0; i < count; i++) {
    const around = neighbours[i].map((it) => chosen[it]).filter((it) => it >= 0);
    const score = (k) => {
      const nearest = Math.min(0.25, ...around.map((it) => apart(SURFACES[k], SURFACES[it])));
      return nearest - 0.012 * used[k] - 0.0001 * k;
    };
    const best = SURFACES.keys().reduce((a, b) => (score(b) > score(a) ? b : a));
    chosen[i] = best;
    used[best]++;
  }
  return chosen.map((it) => oklch(...SURFACES[it]));
}

/** 256 colours of a scale. */
function ramp(kind) {
  return Array.from({ length: 256 }, (_, i) => {
    const share = i / 255;
    if (kind === "diverging") {
      const side = Math.abs(2 * share - 1);
      return oklch(0.95 - 0.42 * side, 0.01 + 0.14 * side, share < 0.5 ? 250 : 55);
    }
    return oklch(0.95 - 0.68 * share, 0.05 + 0.1 * Math.sin(Math.PI * share), 95 + 190 * share);
  });
}
