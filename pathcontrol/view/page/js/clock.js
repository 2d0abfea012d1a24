// Time in the film: it runs, at some speed, over and over.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const LONGEST_STEP = 0.25; // s: after a pause of the browser's own the film goes on where it was

class Clock {
  constructor(duration, changed) {
    Object.assign(this, { duration, changed, time: 0, playing: false, held: false, rate: 1 });
  }

  advance(seconds) {
    if (!this.playing || this.held) return;
    const next = this.time + Math.min(seconds, LONGEST_STEP) * this.rate;
    this.time = next > this.duration ? next % this.duration : next;
  }

  seek(time) {
    if (!Number.isFinite(time)) throw new RangeError(`time ${time}: a number of seconds`);
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.changed();
  }

  play(playing = true) {
    this.playing = playing && this.duration > 0;
    this.changed();
  }

  // while a finger is on a slider time does not run on
  hold(held) {
    this.held = held;
    this.changed();
  }

  get speed() {
    return this.rate;
  }

  set speed(rate) {
    if (!(rate > 0 && Number.isFinite(rate))) throw new RangeError(`speed ${rate}: a number above 0`);
    this.rate = rate;
    this.changed();
  }

  // the next of the usual speeds
  shift(faster) {
    const next = faster ? SPEEDS.find((s) => s > this.rate) : SPEEDS.findLast((s) => s < this.rate);
    if (next) this.speed = next;
  }
}
