// Axes of charts, in the colours of the theme, with ticks as short as they can be.

const FONT = "12px system-ui, sans-serif";

function axis(settings) {
  return {
    stroke: () => cssColor("muted"),
    font: FONT,
    grid: { stroke: () => cssColor("line"), width: 1 },
    ticks: { show: false },
    gap: 4,
    ...settings,
  };
}

function timeAxis(duration) {
  const last = (i, all) => (i === all.length - 1 ? " s" : "");
  return axis({ size: 22, space: 48, values: (_, splits) => splits.map((at, i) => tick(at) + last(i, splits)) });
}

function valueAxis() {
  return axis({ size: widest, space: 26, values: (_, splits) => splits.map(tick) });
}

// as wide as the longest of its texts
function widest(_, texts) {
  return 12 + 6.8 * Math.max(3, ...(texts || []).map((text) => text.length));
}
