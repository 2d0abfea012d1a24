// The chart of a plane, with the same scale on both axes: the path, and what has been drawn of it by now.

const REACH = 6; // px: as near as the nearest
const DASH = [4, 4]; // px, of rapids

class Plane {
  constructor(film, clock, plane) {
    Object.assign(this, { film, clock, plane, time: 0 });
    const read = ({ times, rapid, x, y, ...rest }) => ({
      ...rest,
      times: times && film.block(times),
      rapid: rapid && film.block(rapid),
      x: film.block(x),
      y: film.block(y),
    });
    this.desired = plane.desired.map(read);
    this.traces = plane.traces.map((trace) => ({ ...read(trace), upTo: 0, guess: 0, drawnTo: null, length: 0 }));
    this.points = plane.points.map((point) => ({ ...read(point), guess: 0 }));
    this.moving = [...this.points, ...this.traces];
    this.box = boxOf([...this.desired, ...this.traces, ...this.points]);
    this.build();
    scrubbable(this.plot, clock, (event) => this.momentAt(event));
    new ResizeObserver(() => this.resize()).observe(this.plot);
    themed.push(() => this.resize());
  }

  build() {
    const place = document.getElementById("plane");
    place.hidden = false;
    const figure = document.createElement("figure");
    figure.className = "chart";
    const caption = document.createElement("figcaption");
    caption.append(heading(this.plane));
    this.plot = document.createElement("div");
    this.plot.className = "plot plane";
    [this.ground, this.drawn] = [0, 1].map(() => this.plot.appendChild(document.createElement("canvas")));
    for (const point of this.points) point.dot = this.dot(point, "dot desired");
    for (const trace of this.traces) trace.dot = this.dot(trace, "dot");
    figure.append(caption, this.plot);
    place.append(figure);
  }

  dot({ run }, className) {
    const dot = this.plot.appendChild(document.createElement("div"));
    const color = rgb(this.film.header.runs[run].color);
    dot.className = className;
    if (className === "dot") dot.style.background = color;
    else dot.style.borderColor = color;
    return dot;
  }

  resize() {
    const [width, height] = [this.plot.clientWidth, this.plot.clientHeight];
    if (!width || !height) return;
    this.map = mapOf(this.box, width, height);
    for (const canvas of [this.ground, this.drawn]) {
      const ratio = devicePixelRatio;
      Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
      Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
      canvas.getContext("2d").scale(ratio, ratio);
    }
    drawAxes(this.ground.getContext("2d"), this.map, this.plane);
    this.drawDesired(this.ground.getContext("2d"));
    this.clear();
    this.show(this.time);
  }

  drawDesired(context) {
    for (const { x, y, kind } of this.desired) {
      context.strokeStyle = cssColor("muted");
      context.globalAlpha = kind === "rapid" ? 0.6 : 0.5;
      context.lineWidth = kind === "rapid" ? 1 : 4;
      context.setLineDash(kind === "rapid" ? DASH : []);
      this.line(context, x, y, 0, x.length - 1);
    }
  }

  line(context, x, y, first, last) {
    const { map } = this;
    context.beginPath();
    context.moveTo(map.x(x[first]), map.y(y[first]));
    for (let i = first + 1; i <= last; i += 1) context.lineTo(map.x(x[i]), map.y(y[i]));
    context.stroke();
  }

  show(time) {
    if (time < this.time) this.clear();
    this.time = time;
    if (!this.map) return;
    for (const moving of this.moving) {
      moving.guess = indexAt(moving.times, time, moving.guess);
      moving.tip = [this.map.x(valueAt(moving.times, moving.x, time, moving.guess)), this.map.y(valueAt(moving.times, moving.y, time, moving.guess))];
      moving.dot.style.transform = `translate(${moving.tip[0].toFixed(1)}px, ${moving.tip[1].toFixed(1)}px)`;
    }
    for (const trace of this.traces) this.extend(trace);
  }

  // time went back, or the size is another: what was drawn goes
  clear() {
    this.drawn.getContext("2d").clearRect(0, 0, this.plot.clientWidth, this.plot.clientHeight);
    for (const trace of this.traces) Object.assign(trace, { upTo: 0, drawnTo: null, length: 0 });
  }

  // on from where the line ends, to where the dot is; dashes go on where those of the last picture ended
  extend(trace) {
    const { x, y, rapid, guess, upTo, tip, drawnTo } = trace;
    if (guess < 0) return;
    const context = this.drawn.getContext("2d");
    Object.assign(context, { strokeStyle: inked(this.film.header.runs[trace.run].color), lineJoin: "round" });
    let last = drawnTo ?? [this.map.x(x[0]), this.map.y(y[0])];
    let dashed = null;
    for (let i = upTo + 1; i <= guess + 1; i += 1) {
      const next = i <= guess ? [this.map.x(x[i]), this.map.y(y[i])] : tip;
      const now = Boolean(rapid && rapid[Math.min(i, rapid.length - 1)]);
      if (now !== dashed) {
        if (dashed !== null) context.stroke();
        context.beginPath();
        context.moveTo(...last);
        Object.assign(context, { lineWidth: now ? 1 : 1.5, lineDashOffset: trace.length });
        context.setLineDash(now ? DASH : []);
        dashed = now;
      }
      context.lineTo(...next);
      trace.length += Math.hypot(next[0] - last[0], next[1] - last[1]);
      last = next;
    }
    context.stroke();
    Object.assign(trace, { upTo: guess, drawnTo: tip });
  }

  // the moment at which the tool was nearest to the pointer; of several laps the one nearest to now
  momentAt(event) {
    const { left, top } = this.plot.getBoundingClientRect();
    const [px, py] = [event.clientX - left, event.clientY - top];
    const away = ({ x, y }, i) => Math.hypot(this.map.x(x[i]) - px, this.map.y(y[i]) - py);
    let nearest = Infinity;
    for (const trace of this.traces) trace.x.forEach((_, i) => (nearest = Math.min(nearest, away(trace, i))));
    let moment = this.clock.time;
    let wait = Infinity;
    for (const trace of this.traces) {
      trace.times.forEach((time, i) => {
        const from = Math.abs(time - this.clock.time);
        if (from < wait && away(trace, i) <= nearest + REACH) [wait, moment] = [from, time];
      });
    }
    return moment;
  }
}

// none or one
function plane(film, clock) {
  return film.header.plane ? [new Plane(film, clock, film.header.plane)] : [];
}
