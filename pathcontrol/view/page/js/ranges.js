// Which values a chart shows: all of them, with a margin; a transient at the beginning on request.

const NEAR = 1.3; // a limit is shown if values get this near to it
const LATE = 0.3; // of the film: what is over by then is a transient …
const TRANSIENT = 6; // … if it is so many times as large as what follows
const WIDER = 1.8; // shown of what follows, so that the end of the transient is seen

// least and largest value of lines between two indices; a gap is null
function extent(lines, first, last) {
  let [low, high] = [Infinity, -Infinity];
  for (const values of lines) {
    for (let i = Math.max(first, 0); i <= last; i += 1) {
      const value = values[i];
      if (value !== null && value < low) low = value;
      if (value !== null && value > high) high = value;
    }
  }
  return [low, high];
}

function largest([low, high]) {
  return Math.max(Math.abs(low), Math.abs(high));
}

function isTransient(whole, late) {
  return late[1] > late[0] && largest(whole) > TRANSIENT * largest(late);
}

function widened([low, high]) {
  const more = ((WIDER - 1) * (high - low)) / 2;
  return [low >= 0 ? 0 : low - more, high <= 0 ? 0 : high + more];
}

// a little more than the values take, 0 included, so that what is small looks small, and limits that values come near to
function padded([low, high], [floor, ceiling]) {
  if (!(low <= high)) [low, high] = floor <= ceiling ? [floor, ceiling] : [0, 1];
  const near = (limit) => Number.isFinite(limit) && Math.abs(limit) <= NEAR * largest([low, high]);
  if (near(floor)) low = Math.min(low, floor);
  if (near(ceiling)) high = Math.max(high, ceiling);
  low = Math.min(low, 0);
  high = Math.max(high, 0);
  const more = 0.05 * (high - low) || Math.abs(high) / 10 || 1;
  return [low === 0 ? 0 : low - more, high === 0 ? 0 : high + more];
}
