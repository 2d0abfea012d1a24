// Buttons, the slider of time and the choice of speed.

class Controls {
  constructor(clock, picture, events = []) {
    Object.assign(this, { clock, picture, events, said: -1 });
    for (const id of ["play", "scrubber", "time", "speed", "camera", "near", "theme", "help", "keys"]) {
      this[id] = document.getElementById(id);
    }
    this.digits = clock.duration >= 100 ? 1 : 2 - Math.min(Math.floor(Math.log10(clock.duration || 1)), 0);
    this.connect();
    if (clock.duration > 0) this.connectTime();
    else this.keys.querySelectorAll(".timed").forEach((line) => (line.hidden = true));
  }

  connect() {
    this.camera.hidden = this.theme.disabled = this.help.disabled = false;
    this.camera.addEventListener("click", () => this.picture.reset());
    this.near.hidden = this.picture.views.length < 2;
    this.keys.querySelectorAll(".near").forEach((line) => (line.hidden = this.near.hidden));
    this.near.addEventListener("click", () => this.approach());
    this.theme.addEventListener("click", () => this.otherTheme());
    this.help.addEventListener("click", () => this.keys.showModal());
    document.getElementById("close-keys").addEventListener("click", () => this.keys.close());
  }

  connectTime() {
    const { clock, scrubber, speed } = this;
    document.getElementById("panel").hidden = false;
    scrubber.max = clock.duration;
    scrubber.parentElement.append(...this.events.map((event) => this.band(...event.map((t) => Math.min(1, t / clock.duration)))));
    scrubber.addEventListener("input", () => clock.seek(Number(scrubber.value)));
    scrubber.addEventListener("pointerdown", () => clock.hold(true));
    for (const end of ["pointerup", "pointercancel"]) scrubber.addEventListener(end, () => clock.hold(false));
    this.play.addEventListener("click", () => clock.play(!clock.playing));
    for (const rate of SPEEDS) speed.add(new Option(`${rate}×`, rate));
    speed.addEventListener("change", () => (clock.speed = Number(speed.value)));
    this.time.append(textElement("span", ""), textElement("small", ` / ${this.seconds(clock.duration)} s`));
  }

  // what happens during the film, from a share of its time to another; the knob of the slider stays within its ends
  band(from, to) {
    const element = document.createElement("div");
    element.className = "event";
    element.style.left = `calc(8px + (100% - 16px) * ${from})`;
    element.style.width = `calc((100% - 16px) * ${to - from})`;
    return element;
  }

  approach() {
    this.near.setAttribute("aria-pressed", this.picture.approach());
  }

  otherTheme() {
    setTheme(theme() === "dark" ? "light" : "dark");
  }

  seconds(time) {
    return time.toFixed(this.digits);
  }

  // what the buttons say; called when somebody has changed something, not for every frame
  update() {
    const { clock, play, speed, scrubber } = this;
    play.classList.toggle("playing", clock.playing);
    play.setAttribute("aria-label", clock.playing ? "Pause" : "Play");
    play.title = `${clock.playing ? "Pause" : "Play"} (space)`;
    speed.value = String(clock.speed);
    if (!clock.playing) this.say();
  }

  show(time) {
    if (!this.clock.duration) return;
    this.scrubber.value = time;
    this.time.firstChild.textContent = this.seconds(time);
    if (Math.abs(time - this.said) >= 1) this.say();
  }

  // a screen reader could not follow every frame
  say() {
    this.said = this.clock.time;
    this.scrubber.setAttribute("aria-valuetext", `${this.seconds(this.said)} of ${this.seconds(this.clock.duration)} seconds`);
  }
}
