// Text over the picture: it stays beside what it names, however that moves and from wherever it is seen.

const RIM = 4; // px

class Label {
  constructor(viewer, { text, path, offset, color }) {
    Object.assign(this, { viewer, offset, node: nodeAt(viewer, path), point: new MeshCat.THREE.Vector3() });
    this.element = document.createElement("span");
    this.element.textContent = text;
    this.element.style.borderColor = rgb(color);
    document.getElementById("labels").append(this.element);
    this.half = [this.element.offsetWidth / 2 + RIM, this.element.offsetHeight / 2 + RIM];
  }

  // others: the labels that have their places
  place(width, height, others) {
    const { point, element, half } = this;
    point.fromArray(this.offset).applyMatrix4(this.node.matrixWorld).project(this.viewer.camera);
    this.seen = point.z < 1; // not behind the eye
    this.x = within(((1 + point.x) / 2) * width, half[0], width);
    this.y = beside(this, within(((1 - point.y) / 2) * height, half[1], height), others);
    element.style.visibility = this.seen ? "" : "hidden";
    element.style.transform = `translate(${this.x.toFixed(1)}px, ${this.y.toFixed(1)}px) translate(-50%, -50%)`;
  }
}

function placeLabels(labels, width, height) {
  labels.forEach((label, i) => label.place(width, height, labels.slice(0, i).filter((other) => other.seen)));
}

// the height y if no other label is there, else above or below the others
function beside({ x, half }, y, others) {
  const apart = (other, k) => half[k] + other.half[k] - RIM;
  const free = (at) => others.every((o) => Math.abs(o.x - x) >= apart(o, 0) || Math.abs(o.y - at) >= apart(o, 1) - 0.1);
  const above = others.map((other) => other.y - apart(other, 1)).filter((at) => at >= half[1]);
  const below = others.map((other) => other.y + apart(other, 1));
  return [y, ...above, ...below].find(free) ?? y;
}

// not cut off at the rim of the picture
function within(at, half, length) {
  return Math.min(Math.max(at, half), Math.max(length - half, half));
}

function labels(viewer, film) {
  return (film.header.labels || []).map((label) => new Label(viewer, label));
}

// what each colour of the picture is
function showLegend(film) {
  const list = document.getElementById("legend");
  list.classList.toggle("many", (film.header.legend || []).length > 10); // more than there is room for
  for (const entry of film.header.legend || []) {
    const item = document.createElement("li");
    if (entry.kind === "scale") item.append(...scaleOf(entry));
    else item.append(swatch(entry), textElement("span", entry.label));
    list.append(item);
  }
}

function swatch({ kind, color }) {
  const mark = document.createElement("i");
  mark.className = kind;
  if (kind === "dashed") mark.style.borderColor = rgb(color);
  else mark.style.background = rgb(color);
  return mark;
}

function scaleOf({ label, colors, from, to, unit }) {
  const mark = document.createElement("i");
  mark.className = "scale";
  mark.style.background = `linear-gradient(to right, ${colors.map(rgb).join(", ")})`;
  return [textElement("span", label), from, mark, textElement("b", `${to} ${unit}`.trim())];
}
