// On paper: white, and the picture as it is, which WebGL itself does not keep for a printer.

function printable(picture) {
  const copy = document.createElement("canvas");
  copy.className = "print";
  picture.pane.append(copy);
  let before = "light";
  addEventListener("beforeprint", () => {
    before = theme();
    setTheme("light");
    picture.render();
    const { domElement } = picture.viewer.renderer;
    Object.assign(copy, { width: domElement.width, height: domElement.height });
    copy.getContext("2d").drawImage(domElement, 0, 0);
  });
  addEventListener("afterprint", () => setTheme(before));
}
