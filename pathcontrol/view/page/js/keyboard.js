// Keys. What has the focus comes first: a button wants its space, a list its arrows, a text field everything.

const OWN_KEYS = {
  BUTTON: [" ", "Enter"],
  SUMMARY: [" ", "Enter"],
  A: ["Enter"],
  SELECT: [" ", "Enter", "ArrowLeft", "ArrowRight", "Home", "End"],
};

function keyboard(clock, controls, picture) {
  const shifted = (event) => (event.shiftKey ? 1 : 0.1);
  const timed = {
    " ": () => clock.play(!clock.playing),
    ArrowLeft: (event) => clock.seek(clock.time - shifted(event)),
    ArrowRight: (event) => clock.seek(clock.time + shifted(event)),
    Home: () => clock.seek(0),
    End: () => clock.seek(clock.duration),
    "+": () => clock.shift(true),
    "=": () => clock.shift(true),
    "-": () => clock.shift(false),
    "−": () => clock.shift(false),
  };
  const always = { r: () => picture.reset(), c: () => controls.approach(), t: () => controls.otherTheme(), "?": () => controls.keys.showModal() };
  const actions = new Map(Object.entries(clock.duration > 0 ? { ...timed, ...always } : always));
  document.addEventListener("keydown", (event) => {
    const action = actions.get(event.key.length === 1 ? event.key.toLowerCase() : event.key);
    if (!action || event.ctrlKey || event.altKey || event.metaKey || isTaken(event)) return;
    event.preventDefault();
    action(event);
  });
}

function isTaken({ key, target }) {
  if (target.closest("dialog, [contenteditable], textarea")) return true;
  if (target.tagName === "INPUT") return target.id !== "scrubber";
  return (OWN_KEYS[target.tagName] || []).includes(key);
}
