// Where the picture is taken from: so that the outline of the scene fills it, whatever its shape.

const FIELD_OF_VIEW = 35; // degrees, vertical: wide angles distort an arm
const MARGIN = 1.08;

// z is up in the scene and y in the viewer
function viewerAxes([x, y, z]) {
  return [x, z, -y];
}

function look(viewer, pane, { target, direction, outline }) {
  const slope = Math.tan((FIELD_OF_VIEW / 2) * (Math.PI / 180));
  const aspect = pane.clientWidth / pane.clientHeight;
  const needed = ([right, up, near]) => near + (MARGIN * Math.max(Math.abs(up), Math.abs(right) / aspect)) / slope;
  const distance = Math.max(...outline.map(needed));
  const eye = target.map((coordinate, i) => coordinate + distance * direction[i]);
  const { camera, controls } = viewer;
  camera.fov = FIELD_OF_VIEW;
  camera.zoom = 1;
  camera.near = distance / 100;
  camera.far = distance * 100;
  camera.position.set(...viewerAxes(eye));
  controls.target.set(...viewerAxes(target));
  controls.update();
  viewer.set_dirty();
}
