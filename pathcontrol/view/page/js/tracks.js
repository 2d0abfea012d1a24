// How what moves moves: poses at key frames, linear between them.

class Track {
  constructor(node, times, positions, quaternions) {
    Object.assign(this, { node, times, positions, quaternions, key: 0 });
  }

  // nothing is made anew for a frame, so that there is nothing to collect while the film plays
  show(time) {
    const found = indexAt(this.times, time, this.key);
    const i = (this.key = Math.max(found, 0));
    const part = found < 0 || i === this.times.length - 1 ? 0 : share(this.times, i, time);
    const p = this.positions;
    const q = this.quaternions;
    this.node.position.set(mixed(p, 3 * i, 3, part), mixed(p, 3 * i + 1, 3, part), mixed(p, 3 * i + 2, 3, part));
    this.node.quaternion
      .set(mixed(q, 4 * i, 4, part), mixed(q, 4 * i + 1, 4, part), mixed(q, 4 * i + 2, 4, part), mixed(q, 4 * i + 3, 4, part))
      .normalize();
  }
}

// of a key and the next one, which is `width` numbers on
function mixed(values, at, width, part) {
  return part === 0 ? values[at] : values[at] * (1 - part) + values[at + width] * part;
}

function tracks(viewer, film) {
  return (film.header.tracks || []).map(
    ({ path, times, positions, quaternions }) =>
      new Track(nodeAt(viewer, path), film.block(times), film.block(positions), film.block(quaternions))
  );
}
