// Numbers: where a time is among sorted times, and how a number is written.

// the last i with times[i] <= time, or -1; `guess` is where it was last, which is mostly where it is or one before
function indexAt(times, time, guess = 0) {
  const t = Math.fround(time); // as the times are: else the end could lie a rounding error before the last of them
  for (let i = Math.max(guess, 0); i <= guess + 1 && i < times.length; i += 1) {
    if (times[i] <= t && !(times[i + 1] <= t)) return i;
  }
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

// how far `time` is from times[i] to times[i + 1], from 0 to 1
function share(times, i, time) {
  const span = times[i + 1] - times[i];
  return span > 0 ? Math.min(Math.max((time - times[i]) / span, 0), 1) : 0;
}

// a value at a time, linear between samples and constant before the first and behind the last
function valueAt(times, values, time, i) {
  if (i < 0) return values[0];
  if (i + 1 >= times.length) return values[times.length - 1];
  return values[i] + (values[i + 1] - values[i]) * share(times, i, time);
}

function minus(text) {
  return text.replace(/-/g, "\u2212");
}

const NOISE = 1e-7; // of the largest value: the last digit in single precision

// what is rounding beside the largest value of its chart is 0
function withoutNoise(value, largest) {
  return value !== null && Math.abs(value) < NOISE * largest ? 0 : value;
}

function written(value, digits = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return minus(value.toExponential(digits - 1));
  const decimals = size === 0 ? digits - 1 : Math.max(digits - 1 - Math.floor(Math.log10(size)), 0);
  return minus(value.toFixed(Math.min(decimals, 6)));
}

// the shortest text for a round number, as at the ticks of an axis
function tick(value) {
  const text = Number(value.toPrecision(6));
  return minus(Math.abs(text) >= 1e5 || (text !== 0 && Math.abs(text) < 1e-4) ? text.toExponential() : String(text));
}
