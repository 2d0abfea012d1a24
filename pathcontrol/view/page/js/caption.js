// What stands above a chart: its title, what its lines are and what they are worth now, and a button for its peak.

class Caption {
  constructor({ title, unit, lines }, styles, onPress) {
    Object.assign(this, { styles, pressed: false, element: document.createElement("figcaption") });
    const shown = lines.filter((line) => line.role !== "limit");
    const entries = lines.map((line, k) => this.entry(shown.length > 1 ? line.label : "", styles[k]));
    this.outputs = entries.map((entry) => entry.lastChild);
    this.peak = this.button(onPress);
    this.element.append(heading({ title, unit }), ...entries.filter((_, k) => shown.includes(lines[k])), this.peak);
    this.element.classList.toggle("many", shown.length > 4);
    this.element.classList.toggle("crowd", shown.length > 10); // the legend of the picture names them
    this.mark();
  }

  entry(label, style) {
    const entry = textElement("span", "");
    entry.className = "entry";
    entry.title = label;
    style.mark = document.createElement("i");
    const output = document.createElement("output");
    output.setAttribute("aria-live", "off");
    entry.append(style.mark, textElement("span", label), output);
    return entry;
  }

  // in the colours of the theme
  mark() {
    for (const { mark, color, dash } of this.styles) {
      mark.style.borderColor = color();
      mark.style.borderTopStyle = dash && dash.length ? "dashed" : "solid";
    }
  }

  // a transient at the beginning would make all that comes after it a flat line: it is shown on request
  button(onPress) {
    const button = Object.assign(textElement("button", ""), { type: "button", className: "peak", title: "Show the peak" });
    button.setAttribute("aria-pressed", false);
    button.addEventListener("click", () => {
      this.pressed = !this.pressed;
      button.setAttribute("aria-pressed", this.pressed);
      onPress();
    });
    return button;
  }

  offer(text) {
    this.peak.hidden = !text;
    this.peak.textContent = text;
  }
}

function heading({ title, unit }) {
  const name = textElement("b", title);
  if (unit) name.append(textElement("small", ` [${unit}]`));
  return name;
}
