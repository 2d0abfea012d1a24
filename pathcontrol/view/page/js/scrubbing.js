// A press or a drag on something is a moment of the film.

// `moment` says which, from a pointer's event; while the pointer is down, time stands still
function scrubbable(element, clock, moment) {
  const held = (event) => element.hasPointerCapture(event.pointerId);
  const go = (event) => held(event) && clock.seek(moment(event));
  element.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || event.shiftKey) return; // shift enlarges
    element.setPointerCapture(event.pointerId);
    clock.hold(true);
    if (event.pointerType !== "touch") go(event); // a finger may be about to scroll the page
  });
  element.addEventListener("pointermove", go);
  element.addEventListener("pointerup", go);
  element.addEventListener("lostpointercapture", () => clock.hold(false));
}
