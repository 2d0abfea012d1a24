"use strict";
// Plays the scene of this page in Meshcat's viewer. "#t=2.5" behind the address shows that moment and waits there.
(() => {
  const FIELD_OF_VIEW = 35; // degrees, vertical: wide angles distort an arm
  const MARGIN = 1.08;

  function bytes(text) {
    return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  }

  // z is up in the scene and y in the viewer
  function viewerAxes([x, y, z]) {
    return [x, z, -y];
  }

  function fillPane(viewer, pane) {
    const resize = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = () => resize(pane.clientWidth, pane.clientHeight);
    viewer.set_3d_pane_size();
  }

  function look(viewer, pane, { target, direction, outline }) {
    const slope = Math.tan((FIELD_OF_VIEW / 2) * (Math.PI / 180));
    const aspect = pane.clientWidth / pane.clientHeight;
    const needed = ([right, up, near]) => near + (MARGIN * Math.max(Math.abs(up), Math.abs(right) / aspect)) / slope;
    const distance = Math.max(...outline.map(needed));
    const eye = target.map((coordinate, i) => coordinate + distance * direction[i]);
    viewer.camera.fov = FIELD_OF_VIEW;
    viewer.camera.position.set(...viewerAxes(eye));
    viewer.controls.target.set(...viewerAxes(target));
    viewer.set_dirty();
  }

  function showControls(viewer) {
    viewer.gui.open();
    viewer.gui.__folders["Scene"].close();
  }

  // the first picture takes long enough that the beginning would be missed
  function playOnceDrawn(animator) {
    requestAnimationFrame(() =>
      requestAnimationFrame(() => {
        animator.reset();
        animator.play();
      })
    );
  }

  function start(animator, hash) {
    const moment = /^#t=(\d+(?:\.\d+)?)$/.exec(hash);
    if (moment) {
      animator.pause();
      animator.seek(Number(moment[1]));
      animator.display_progress(Number(moment[1]));
    } else {
      playOnceDrawn(animator);
    }
  }

  const scene = JSON.parse(document.getElementById("scene").textContent);
  const pane = document.getElementById("meshcat-pane");
  try {
    const viewer = new MeshCat.Viewer(pane);
    fillPane(viewer, pane);
    scene.commands.forEach((command) => viewer.handle_command_bytearray(bytes(command)));
    look(viewer, pane, scene.camera);
    showControls(viewer);
    start(viewer.animator, window.location.hash);
  } catch (error) {
    pane.className = "message";
    pane.textContent = "The scene cannot be drawn; a browser with WebGL is needed. (" + error + ")";
    throw error;
  }
})();
