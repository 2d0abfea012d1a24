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

  place(width, height) {
    const { point, element, half } = this;
    point.fromArray(this.offset).applyMatrix4(this.node.matrixWorld).project(this.viewer.camera);
    const x = within(((1 + point.x) / 2) * width, half[0], width);
    const y = within(((1 - point.y) / 2) * height, half[1], height);
    element.style.visibility = point.z < 1 ? "" : "hidden"; // behind the eye
    element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
  }
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
