// Charts over time. While the film plays only a line across them moves; they are drawn anew for size and theme only.

const SYNC = "film"; // pointers of all charts go together
const VALUES_EVERY = 100; // ms: numbers that change faster cannot be read

class Chart {
  constructor(film, clock, chart) {
    Object.assign(this, { film, clock, chart, last: 0, time: 0, times: film.block(chart.times) });
    const shades = new Set(chart.lines.filter((line) => line.role === "value").map((line) => line.shade || 0)).size;
    this.styles = chart.lines.map((line) => lineStyle(film, line, shades));
    this.caption = new Caption(chart, this.styles, () => this.rescale());
    this.build();
    const values = chart.lines.map((line) => withGaps(film.block(line.values)));
    this.uplot = new uPlot(this.options(), [this.times, ...values], this.plot);
    this.addEvents();
    this.addPlayhead();
    scrubbable(this.uplot.over, clock, (event) => this.uplot.posToVal(event.clientX - this.left(), "x"));
    new ResizeObserver(() => this.resize()).observe(this.plot);
    themed.push(() => this.repaint());
  }

  build() {
    this.figure = document.createElement("figure");
    this.figure.className = "chart";
    this.plot = document.createElement("div");
    this.plot.className = "plot";
    this.figure.append(this.caption.element, this.plot);
    document.getElementById("charts").append(this.figure);
  }

  options() {
    return {
      width: Math.max(this.plot.clientWidth, 1),
      height: Math.max(this.plot.clientHeight, 1),
      padding: [10, 18, 0, 0],
      legend: { show: false },
      cursor: { y: false, sync: { key: SYNC }, drag: { x: true, y: false, setScale: true }, bind: { mousedown: withShift } },
      scales: { x: { time: false, range: (_, from, to) => this.span(from, to) }, y: { range: (u) => this.range(u) } },
      axes: [timeAxis(this.clock.duration), valueAxis()],
      series: [{}, ...this.styles.map(({ color, width, dash }) => ({ stroke: color, width, dash, points: { show: false } }))],
      hooks: { setCursor: [() => this.showValues()], setScale: [() => this.place()] },
    };
  }

  // all charts show the whole film, unless enlarged
  span(from, to) {
    const whole = from <= this.times[0] && to >= this.times[this.times.length - 1];
    return whole ? [0, Math.max(this.clock.duration, this.times[this.times.length - 1])] : [from, to];
  }

  range({ data, series }) {
    const { times, caption } = this;
    const [first, last] = series[0].idxs; // of what is shown
    const lines = (...roles) => data.slice(1).filter((_, k) => roles.includes(this.chart.lines[k].role));
    const whole = extent(lines("value", "reference"), first, last);
    const later = first === 0 && last === times.length - 1 ? indexAt(times, LATE * times[last]) : first;
    const late = extent(lines("value", "reference"), later, last);
    const clipped = isTransient(whole, late);
    caption.offer(clipped ? `peak ${written(largest(whole))}` : "");
    return padded(clipped && !caption.pressed ? widened(late) : whole, extent(lines("limit"), first, last));
  }

  // what happens during the film, from when to when
  addEvents() {
    this.events = (this.film.header.events || []).map(([from, to]) => {
      const element = document.createElement("div");
      element.className = "event";
      this.uplot.over.append(element);
      return { element, from, to };
    });
  }

  addPlayhead() {
    this.playhead = document.createElement("div");
    this.playhead.className = "playhead";
    this.uplot.over.append(this.playhead);
  }

  left() {
    return this.uplot.over.getBoundingClientRect().left;
  }

  show(time) {
    this.time = time;
    this.place();
    const now = performance.now();
    if (this.clock.playing && now - this.last < VALUES_EVERY) return;
    this.last = now;
    this.showValues();
  }

  place() {
    if (!this.playhead) return;
    const { min, max } = this.uplot.scales.x;
    this.playhead.hidden = this.time < min || this.time > max;
    this.playhead.style.transform = `translateX(${this.uplot.valToPos(this.time, "x").toFixed(2)}px)`;
    for (const { element, from, to } of this.events) {
      const [begin, end] = [from, to].map((time) => this.uplot.valToPos(Math.min(Math.max(time, min), max), "x"));
      Object.assign(element.style, { left: `${begin.toFixed(2)}px`, width: `${(end - begin).toFixed(2)}px` });
    }
  }

  // under the pointer, or else of the moment of the film
  showValues() {
    if (!this.uplot) return;
    const pointed = this.uplot.cursor.idx;
    const i = pointed ?? Math.max(indexAt(this.times, this.time), 0);
    this.size ??= largest(extent(this.uplot.data.slice(1), 0, this.times.length - 1));
    this.caption.outputs.forEach((output, k) => {
      output.textContent = written(withoutNoise(this.uplot.data[k + 1][i], this.size));
    });
  }

  resize() {
    this.uplot.setSize({ width: Math.max(this.plot.clientWidth, 1), height: Math.max(this.plot.clientHeight, 1) });
    this.place();
  }

  // the values' range is asked for again
  rescale() {
    const { min, max } = this.uplot.scales.x;
    this.uplot.setScale("x", { min, max });
  }

  repaint() {
    this.caption.mark();
    this.uplot.redraw(false, true);
  }
}

function charts(film, clock) {
  const found = film.header.charts || [];
  document.getElementById("charts").hidden = found.length === 0;
  const made = found.map((chart) => new Chart(film, clock, chart));
  if (made.length) new ResizeObserver(() => makeRoom(made[0].figure)).observe(made[0].figure);
  return made;
}

// the first row of charts is to be seen without scrolling: the picture leaves it as much of the window as it needs
function makeRoom(figure) {
  const stage = document.getElementById("stage");
  const below = figure.getBoundingClientRect().bottom - stage.getBoundingClientRect().bottom;
  const above = stage.getBoundingClientRect().top + scrollY;
  stage.style.setProperty("--row", `${Math.ceil(above + below + 10)}px`);
}

// uPlot leaves a gap where a value is null
function withGaps(values) {
  return values.some(Number.isNaN) ? Array.from(values, (value) => (Number.isNaN(value) ? null : value)) : values;
}

// without shift a drag goes through time instead
function withShift(_, __, handle) {
  return (event) => event.shiftKey && handle(event);
}
