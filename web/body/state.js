// The state of the page and its words in the page's address.
//
// A state is { moments, omega0, time, speed }, in kg m2, rad/s, s, and s per second. `data` comes
// with the page: bodies, speeds, and the latest time.

const WORDS = ["body", "moments", "omega0", "time", "speed"];
const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;
// Within these limits no product overflows or underflows.
const MOMENTS = [1e-6, 1e6];
const OMEGA = [1e-9, 1000];

// An error whose message says in a line what is wrong with a value.
export class StateError extends Error {}

export function stateOfBody(data, id) {
  const { moments, omega } = data.bodies.find((body) => body.id === id);
  return { moments: [...moments], omega0: [...omega], time: 0, speed: 1 };
}

// Return the body of the page that the state has, or undefined.
export function bodyOf(data, { moments, omega0 }) {
  return data.bodies.find((body) => isSame(body.moments, moments) && isSame(body.omega, omega0));
}

function isSame(first, second) {
  return first.every((x, i) => Object.is(x, second[i]));
}

// Return the shortest text that is read as the same number, with the sign of zero.
export function written(value) {
  return Object.is(value, -0) ? "-0" : String(value);
}

export function listed(values) {
  return values.map(written).join(",");
}

export function fragmentOf(data, state) {
  const body = bodyOf(data, state);
  const words = body
    ? [`body=${body.id}`]
    : [`moments=${listed(state.moments)}`, `omega0=${listed(state.omega0)}`];
  if (state.time !== 0) words.push(`time=${written(state.time)}`);
  if (state.speed !== 1) words.push(`speed=${state.speed}`);
  return words.join("&");
}

// Return the command that computes the state, and the scene file that it reads, or "" if the body
// is that of a case.
export function commandOf(data, { moments, omega0, time }) {
  const known = data.bodies.find((body) => body.case && isSame(body.moments, moments));
  const words = ["pyharness run", known ? `--case ${known.case}` : "--scene body.toml"];
  if (known && !isSame(known.omega, omega0)) words.push(`--omega0=${listed(omega0)}`);
  words.push(`--method closed-form --attitude quaternion --times ${written(time)}`);
  const file = [
    "[body]",
    `moments = [${moments.map(written).join(", ")}]`,
    "[initial]",
    `omega = [${omega0.map(written).join(", ")}]`,
  ];
  return { command: words.join(" "), file: known ? "" : file.join("\n") };
}

// Return the state that an address specifies, and a message for each of its words that is invalid;
// the default replaces such a word.
export function stateFrom(data, fragment) {
  const problems = [];
  const given = new Map();
  for (const part of fragment.replace(/^#/, "").split("&").filter((each) => each !== "")) {
    const [word, ...values] = decoded(part).split("=");
    if (WORDS.includes(word)) given.set(word, values.join("="));
    else problems.push(`unknown word '${shown(word)}'; allowed: ${WORDS.join(", ")}`);
  }
  const read = (word, reader, otherwise) => {
    if (!given.has(word)) return otherwise;
    try {
      return reader(given.get(word), word);
    } catch (error) {
      if (!(error instanceof StateError)) throw error;
      problems.push(error.message);
      return otherwise;
    }
  };
  const ids = data.bodies.map((body) => body.id);
  const state = stateOfBody(data, read("body", (text) => oneOf("body", text, ids), data.first));
  state.moments = read("moments", momentsFrom, state.moments);
  state.omega0 = read("omega0", omegaFrom, state.omega0);
  state.time = read("time", timeFrom(data), 0);
  const speeds = data.speeds.map(String);
  state.speed = Number(read("speed", (text) => oneOf("speed", text, speeds), 1));
  return { state, problems };
}

// Decode an address. A text with a percent sign that begins no character is returned unchanged.
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

// Return the beginning of a typed text, short enough for a line.
function shown(text) {
  return [...text].slice(0, 40).join("");
}

function oneOf(word, text, allowed) {
  if (allowed.includes(text)) return text;
  throw new StateError(`${word}: unknown '${shown(text)}'; allowed: ${allowed.join(", ")}`);
}

function numberFrom(text, word) {
  const trimmed = text.trim();
  if (NUMBER.test(trimmed)) return Number(trimmed);
  throw new StateError(`${word}: '${shown(text)}' where a number belongs`);
}

function threeFrom(text, word) {
  const parts = text.split(",");
  if (parts.length === 3) return parts.map((part) => numberFrom(part, word));
  throw new StateError(`${word}: ${parts.length} numbers; allowed: three, as in 40,30,20`);
}

export function momentsFrom(text, word = "moments") {
  const moments = threeFrom(text, word);
  const [least, most] = MOMENTS;
  for (const each of moments) {
    if (each >= least && each <= most) continue;
    throw new StateError(`${word}: ${written(each)}; allowed: numbers from ${least} to ${most}`);
  }
  const [low, middle, high] = [...moments].sort((a, b) => a - b);
  if (high <= low + middle) return moments;
  const sum = `${low} + ${middle} is less than ${high}`;
  throw new StateError(
    `${word}: ${sum}; no body has these moments, as its mass would have to be less than nothing ` +
      "somewhere: each moment is at most the sum of the other two",
  );
}

export function omegaFrom(text, word = "omega0") {
  const omega = threeFrom(text, word);
  const [least, most] = OMEGA;
  for (const each of omega) {
    const size = Math.abs(each);
    if (size === 0 || (size >= least && size <= most)) continue;
    const allowed = `0, or numbers from ${least} to ${most} of either sign`;
    throw new StateError(`${word}: ${written(each)}; allowed: ${allowed}`);
  }
  return omega;
}

export function timeFrom(data) {
  return (text, word = "time") => {
    const time = numberFrom(text, word);
    if (time >= 0 && time <= data.longest) return time + 0;
    throw new StateError(`${word}: ${written(time)}; allowed: a number from 0 to ${data.longest}`);
  };
}
