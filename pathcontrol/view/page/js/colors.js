// Colours of lines. Okabe and Ito's can be told apart by almost everyone.

const PALETTE = [
  [0, 114, 178],
  [213, 94, 0],
  [0, 158, 115],
  [204, 121, 167],
  [86, 180, 233],
  [230, 159, 0],
  [127, 107, 201],
].map((color) => color.map((channel) => channel / 255));
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3], [12, 4], [4, 4], [1, 3]];

function rgb(color) {
  return `rgb(${color.slice(0, 3).map((channel) => Math.round(255 * channel)).join(", ")})`;
}

// on a dark ground a little lighter than in the picture
function inked(color) {
  return rgb(theme() === "dark" ? color.map((channel) => channel + 0.25 * (1 - channel)) : color);
}

// what a line of a chart looks like; colours that belong to the theme are asked for whenever it is drawn
function lineStyle(film, { run, role, shade = 0 }, shades) {
  const { runs } = film.header;
  if (role === "limit") return { color: () => cssColor("warning"), width: 1, dash: [3, 3] };
  if (role === "reference") return { color: () => cssColor("muted"), width: 1.5, dash: [6, 4] };
  if (runs.length === 1 && shades > 1) {
    const color = PALETTE[shade % PALETTE.length];
    return { color: () => inked(color), width: 1.5, dash: DASHES[Math.floor(shade / PALETTE.length)] };
  }
  return { color: () => inked(runs[run || 0].color), width: 1.75, dash: DASHES[shade % DASHES.length] };
}
