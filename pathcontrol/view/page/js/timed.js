// What is in the picture for a while only, such as a wall: from a time on, to an end or for good.

class Timed {
  constructor(node, from, to) {
    Object.assign(this, { node, from, to: to ?? Infinity });
  }

  show(time) {
    this.node.visible = this.from <= time && time < this.to;
  }
}

function timedParts(viewer, film) {
  return (film.header.timed || []).map(({ path, from, to }) => new Timed(nodeAt(viewer, path), from, to));
}
