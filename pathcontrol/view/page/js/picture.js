// The picture: Meshcat's viewer in its pane, without its own panel and its own loop.

class Picture {
  constructor(film, onDirty) {
    this.pane = document.getElementById("pane");
    this.viewer = openViewer(this.pane);
    this.viewer.set_dirty = () => {
      this.viewer.needs_render = true;
      onDirty();
    };
    this.views = [film.header.camera, film.header.camera.near].filter(Boolean);
    this.view = 0;
    buildScene(this.viewer, film);
    this.growing = growingLines(this.viewer, film);
    this.moving = [...tracks(this.viewer, film), ...timedParts(this.viewer, film), ...this.growing.values()];
    this.thickness = new Thickness(this.viewer, film);
    this.labels = labels(this.viewer, film);
    paint(this.viewer);
    themed.push(() => paint(this.viewer));
    this.follow();
  }

  // the view that shows all is kept for any shape of the window until someone has turned it
  follow() {
    this.measure();
    this.reset();
    this.viewer.controls.addEventListener("start", () => (this.turned = true));
    new ResizeObserver(() => {
      this.measure();
      if (!this.turned) this.reset();
      this.render(); // now: a canvas that has been resized is empty
    }).observe(this.pane);
  }

  measure() {
    this.viewer.set_3d_pane_size();
    this.width = this.pane.clientWidth;
    this.height = this.pane.clientHeight;
  }

  reset() {
    this.turned = false;
    look(this.viewer, this.pane, this.views[this.view]);
    this.thickness.set(this.views[this.view].thickness ?? 1);
  }

  // the whole scene, or the path from near
  approach() {
    this.view = (this.view + 1) % this.views.length;
    this.reset();
    return this.view > 0;
  }

  show(time) {
    for (const moving of this.moving) moving.show(time);
    this.viewer.set_dirty();
  }

  get dirty() {
    return this.viewer.needs_render;
  }

  render() {
    this.viewer.render();
    placeLabels(this.labels, this.width, this.height);
  }

  // column-major, in the base frame with z up
  transform(path) {
    const { scene } = this.viewer;
    const node = nodeAt(this.viewer, path);
    scene.updateMatrixWorld(true);
    return scene.matrixWorld.clone().invert().multiply(node.matrixWorld).toArray();
  }

  drawn(path) {
    if (!this.growing.has(path)) throw new RangeError(`no line "${path}": ${[...this.growing.keys()].join(", ")}`);
    return this.growing.get(path).drawn;
  }
}

function openViewer(pane) {
  const viewer = new MeshCat.Viewer(pane, false);
  viewer.gui.domElement.remove();
  viewer.renderer.setPixelRatio(Math.min(devicePixelRatio, 2)); // more costs much and shows little
  const resize = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = () => resize(Math.max(pane.clientWidth, 1), Math.max(pane.clientHeight, 1));
  viewer.set_3d_pane_size();
  viewer.renderer.domElement.addEventListener("webglcontextrestored", () => viewer.set_dirty());
  return viewer;
}
