// What is in the picture: Meshcat's commands, copies of what is there already, and how it is seen.

const ON_TOP = 100; // order of drawing, from here on
const BEHIND_GHOST = -1;
const NEARER = 800; // steps of depth: about 0.5 % of the distance from which the picture is taken

// as Meshcat splits them
function parts(path) {
  return path.split("/").filter((name) => name.length > 0);
}

function nodeAt(viewer, path) {
  return viewer.scene_tree.find(parts(path)).object;
}

function objectAt(viewer, path) {
  return viewer.scene_tree.find([...parts(path), "<object>"]).object;
}

function buildScene(viewer, film) {
  for (const entry of film.header.scene) {
    if ("copy" in entry) copyObject(viewer, entry);
    else viewer.handle_command_bytearray(film.block(entry));
  }
  viewer.scene.traverse((object) => object.material && object.material.opacity < 1 && seeThrough(object));
  (film.header.on_top || []).forEach((path, i) => drawOnTop(nodeAt(viewer, path), ON_TOP + i));
}

// the geometry is shared, so that it is sent and kept once
function copyObject(viewer, { copy, to, color }) {
  const object = objectAt(viewer, copy).clone();
  if (color) {
    object.material = object.material.clone();
    object.material.vertexColors = false;
    object.material.color.setRGB(...color.slice(0, 3));
    object.material.opacity = color[3];
  }
  viewer.set_object(parts(to), object);
}

// Only the nearest surface of a ghost is to be seen, not its inside: its depth is drawn first, without colour.
// Where it is as near as something solid, the solid is seen: else all that two arms have in common would be tinted.
function seeThrough(object) {
  Object.assign(object.material, { transparent: true, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: NEARER });
  if (!object.isMesh || object.isDepthOnly) return;
  const depth = new MeshCat.THREE.Mesh(object.geometry, object.material.clone());
  depth.material.colorWrite = false;
  depth.renderOrder = BEHIND_GHOST;
  depth.isDepthOnly = true;
  object.add(depth);
}

function drawOnTop(node, order) {
  node.traverse((object) => {
    if (!object.material) return;
    object.renderOrder = order;
    Object.assign(object.material, { depthTest: false, depthWrite: false, transparent: true });
  });
}

function paint(viewer) {
  const { Color } = MeshCat.THREE;
  viewer.set_property(["Background"], "top_color", new Color(cssColor("sky")).toArray());
  viewer.set_property(["Background"], "bottom_color", new Color(cssColor("floor")).toArray());
  const grid = new Color(cssColor("grid"));
  nodeAt(viewer, "/meshcat/ground").traverse((object) => object.material && object.material.color.copy(grid));
  objectAt(viewer, "/Lights/AmbientLight").intensity = Number(cssColor("ambient"));
  viewer.set_dirty();
}
