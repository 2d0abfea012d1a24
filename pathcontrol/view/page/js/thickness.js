// Lines and markers as thick as suits the view: from near they would hide what one came to see.

class Thickness {
  constructor(viewer, film) {
    const { tubes = [], on_top = [] } = film.header;
    this.tubes = tubes.map(({ path, sides }) => ({ sides, attribute: objectAt(viewer, path).geometry.attributes.position }));
    this.markers = on_top.map((path) => nodeAt(viewer, path));
    this.factor = 1;
  }

  set(factor) {
    if (factor === this.factor) return;
    for (const { sides, attribute } of this.tubes) swell(attribute, sides, factor / this.factor);
    for (const marker of this.markers) marker.scale.setScalar(factor);
    this.factor = factor;
  }
}

// every ring of a tube about its middle
function swell(attribute, sides, factor) {
  const p = attribute.array;
  for (let ring = 0; ring < p.length; ring += 3 * sides) {
    for (let axis = ring; axis < ring + 3; axis += 1) {
      let middle = 0;
      for (let i = axis; i < ring + 3 * sides; i += 3) middle += p[i] / sides;
      for (let i = axis; i < ring + 3 * sides; i += 3) p[i] = middle + factor * (p[i] - middle);
    }
  }
  attribute.needsUpdate = true;
}
