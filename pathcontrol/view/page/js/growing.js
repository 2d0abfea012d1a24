// Lines that are drawn by and by: of the rings of a tube those that the tool has reached.

class Growing {
  constructor(geometry, times, indices) {
    Object.assign(this, { geometry, times, indices, ring: 0 });
  }

  show(time) {
    this.ring = indexAt(this.times, time, this.ring);
    this.geometry.setDrawRange(0, this.drawn);
  }

  get drawn() {
    return this.indices * Math.max(this.ring, 0);
  }
}

// by the path of the line
function growingLines(viewer, film) {
  const line = ({ path, times, indices }) => new Growing(objectAt(viewer, path).geometry, film.block(times), indices);
  return new Map((film.header.growing || []).map((entry) => [entry.path, line(entry)]));
}
