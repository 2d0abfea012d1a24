// From the plane of a chart to pixels, with the same scale on both axes, and its axes with ticks.

const EDGE = { left: 54, right: 10, top: 10, bottom: 42 }; // px around the drawing, for ticks and names
const AROUND = 0.06; // of the extent, left free around it
const TICKS_APART = 56; // px, at least

function boxOf(lines) {
  const box = { x: [Infinity, -Infinity], y: [Infinity, -Infinity] };
  for (const line of lines) {
    for (const axis of ["x", "y"]) {
      for (const value of line[axis]) {
        if (value < box[axis][0]) box[axis][0] = value;
        if (value > box[axis][1]) box[axis][1] = value;
      }
    }
  }
  return box;
}

// from the plane's unit to pixels
function mapOf({ x: [left, right], y: [bottom, top] }, width, height) {
  const [across, up] = [width - EDGE.left - EDGE.right, height - EDGE.top - EDGE.bottom];
  const least = 1e-3 * Math.max(Math.abs(left), Math.abs(right), Math.abs(bottom), Math.abs(top)) || 1; // of a point
  const extent = (length) => (1 + 2 * AROUND) * Math.max(length, least);
  const scale = Math.min(across / extent(right - left), up / extent(top - bottom));
  const [x0, y0] = [EDGE.left + across / 2, EDGE.top + up / 2];
  const [xm, ym] = [(left + right) / 2, (bottom + top) / 2];
  return {
    x: (value) => x0 + scale * (value - xm),
    y: (value) => y0 - scale * (value - ym),
    xs: ticksBetween(xm - across / 2 / scale, xm + across / 2 / scale, TICKS_APART / scale),
    ys: ticksBetween(ym - up / 2 / scale, ym + up / 2 / scale, TICKS_APART / scale),
    left: EDGE.left,
    top: EDGE.top,
    right: width - EDGE.right,
    bottom: height - EDGE.bottom,
  };
}

// round numbers, 1, 2 or 5 times a power of ten apart
function ticksBetween(from, to, apart) {
  const power = 10 ** Math.floor(Math.log10(apart));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= apart * (1 - 1e-9));
  const first = Math.ceil(from / step - 1e-9);
  const count = Math.floor(to / step + 1e-9) - first + 1;
  return Array.from({ length: Math.max(count, 0) }, (_, i) => (first + i) * step);
}

function drawAxes(context, map, { x_label, y_label, unit }) {
  Object.assign(context, { strokeStyle: cssColor("line"), fillStyle: cssColor("muted"), lineWidth: 1, font: FONT });
  const named = (label) => (unit ? `${label} [${unit}]` : label);
  context.beginPath();
  for (const value of map.xs) context.rect(Math.round(map.x(value)) + 0.5, map.top, 0, map.bottom - map.top);
  for (const value of map.ys) context.rect(map.left, Math.round(map.y(value)) + 0.5, map.right - map.left, 0);
  context.stroke();
  Object.assign(context, { textAlign: "center", textBaseline: "top" });
  for (const value of map.xs) context.fillText(tick(value), map.x(value), map.bottom + 5);
  context.fillText(named(x_label), (map.left + map.right) / 2, map.bottom + 22);
  Object.assign(context, { textAlign: "right", textBaseline: "middle" });
  for (const value of map.ys) context.fillText(tick(value), map.left - 6, map.y(value));
  context.save();
  context.translate(9, (map.top + map.bottom) / 2);
  context.rotate(-Math.PI / 2);
  context.textAlign = "center";
  context.fillText(named(y_label), 0, 0);
  context.restore();
}
