// Puts the page together when its text is there, and offers the film to scripts as `window.film`.
// "#t=2.5" behind the address shows that moment and waits there; "#t=2.5&bare" shows the picture only.

function missing() {
  if (!("DecompressionStream" in window)) return "This browser is too old for this page; one from 2023 or later shows it.";
  const canvas = document.createElement("canvas");
  if (!canvas.getContext("webgl2") && !canvas.getContext("webgl")) return "The picture needs WebGL, which this browser does not offer here.";
  return "";
}

function say(text) {
  const message = document.getElementById("message");
  message.textContent = text;
  message.hidden = !text;
}

// what the address asks for: a moment [s] or null, and whether the picture stands alone
function asked() {
  const moment = /^#t=(\d+(?:\.\d+)?)(?:&|$)/.exec(location.hash);
  return { moment: moment && Number(moment[1]), bare: /[#&]bare(&|$)/.test(location.hash) };
}

function obey(clock) {
  const { moment, bare } = asked();
  document.documentElement.classList.toggle("bare", bare);
  if (moment === null) return false;
  clock.play(false);
  clock.seek(moment);
  return true;
}

function offer(clock, loop, picture) {
  const settled = (read) => (path) => {
    loop.settle();
    return read(path);
  };
  Object.assign(window.film, {
    duration: clock.duration,
    seek: (time) => clock.seek(time),
    play: () => clock.play(true),
    pause: () => clock.play(false),
    render: () => loop.render(),
    transform: settled((path) => picture.transform(path)),
    drawn: settled((path) => picture.drawn(path)),
  });
  const property = (name, get, set) => Object.defineProperty(window.film, name, { get, set, enumerable: true });
  property("time", () => clock.time);
  property("playing", () => clock.playing);
  property("speed", () => clock.speed, (rate) => (clock.speed = rate));
  property("theme", theme, setTheme);
}

async function start() {
  const lack = missing();
  if (lack) throw new Error(lack);
  const [film] = await Promise.all([readFilm(), loadViewer()]);
  document.documentElement.classList.toggle("charted", (film.header.charts || []).length > 0);
  document.documentElement.classList.toggle("bare", asked().bare);
  let loop = null;
  let controls = null;
  const clock = new Clock(film.header.duration, () => {
    controls?.update();
    loop?.refresh();
  });
  loop = new Loop(clock);
  const planes = plane(film, clock);
  const picture = new Picture(film, () => loop.wake());
  controls = new Controls(clock, picture, film.header.events);
  loop.picture = picture;
  loop.followers = [picture, controls, ...planes, ...charts(film, clock)];
  showLegend(film);
  tables(film);
  keyboard(clock, controls, picture);
  printable(picture);
  offer(clock, loop, picture);
  begin(clock, loop);
}

// the first picture takes long: it is drawn before time runs, or the beginning would be missed
function begin(clock, loop) {
  const waits = obey(clock);
  addEventListener("hashchange", () => obey(clock));
  loop.render();
  say("");
  if (!waits && !matchMedia("(prefers-reduced-motion: reduce)").matches) clock.play(true);
  clock.changed();
}

window.film = {
  ready: new Promise((resolve, reject) => {
    document.addEventListener("DOMContentLoaded", () => start().then(resolve, reject));
  }),
};
window.film.ready.catch((error) => {
  say(`The film cannot be shown. ${error.message}`);
  console.error(error);
});
