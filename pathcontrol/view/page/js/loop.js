// One frame after the other, as long as there is something new to see; else the page rests.

class Loop {
  constructor(clock) {
    Object.assign(this, { clock, followers: [], picture: null, pending: 0, last: null, shown: null });
    this.frame = this.frame.bind(this);
  }

  wake() {
    if (!this.pending && this.picture) this.pending = requestAnimationFrame(this.frame);
  }

  // somebody has changed something: all that follows looks again
  refresh() {
    this.shown = null;
    this.wake();
  }

  frame(now) {
    this.pending = 0;
    const { clock } = this;
    if (this.last !== null) clock.advance((now - this.last) / 1000);
    this.last = clock.playing ? now : null;
    this.settle();
    if (this.picture.dirty) this.picture.render();
    if (clock.playing) this.wake();
  }

  // all that follows the clock is where the clock is
  settle() {
    if (this.shown === this.clock.time) return;
    this.shown = this.clock.time;
    for (const follower of this.followers) follower.show(this.shown);
  }

  render() {
    this.settle();
    this.picture.render();
  }
}
