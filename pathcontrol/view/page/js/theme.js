// Light and dark: all colours are in the style sheet; who draws by script reads them from there.

const themed = []; // what is to be called when the theme has changed

function theme() {
  return document.documentElement.dataset.theme;
}

function setTheme(name) {
  if (!["light", "dark"].includes(name)) throw new RangeError(`theme "${name}": "light" or "dark"`);
  document.documentElement.dataset.theme = name;
  themed.forEach((repaint) => repaint());
}

function cssColor(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// at once, before anything is painted
const darkPreferred = matchMedia("(prefers-color-scheme: dark)");
setTheme(darkPreferred.matches ? "dark" : "light");
darkPreferred.addEventListener("change", () => setTheme(darkPreferred.matches ? "dark" : "light"));
