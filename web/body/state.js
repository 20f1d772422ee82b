// The state of the page and its words in the page's address.
//
// A state is { moments, omega0, time }, in kg m2, rad/s and s. `data` comes with the page: bodies, and
// the latest time.
import { StateError, numberFrom, oneOf, readerOf, threeFrom, wordsIn } from "../laboratory/address.js";

const WORDS = ["body", "moments", "omega0", "time"];
// Within these limits no product overflows or underflows.
const MOMENTS = [1e-6, 1e6];
const OMEGA = [1e-9, 1000];

export function stateOfBody(data, id) {
  const { moments, omega } = data.bodies.find((body) => body.id === id);
  return { moments: [...moments], omega0: [...omega], time: 0 };
}

// Return the body of the page that the state has, or undefined.
export function bodyOf(data, { moments, omega0 }) {
  return data.bodies.find((body) => isSame(body.moments, moments) && isSame(body.omega, omega0));
}

function isSame(first, second) {
  return first.every((x, i) => x === second[i]);
}

export function listed(values) {
  return values.join(", ");
}

export function fragmentOf(data, state) {
  const { moments, omega0, time } = state;
  const body = bodyOf(data, state);
  const words = body ? `body=${body.id}` : `moments=${moments}&omega0=${omega0}`;
  return time === 0 ? words : `${words}&time=${time}`;
}

// Return the command that computes the state, and the scene file that it reads, or "" if the body
// is that of a case.
export function commandOf(data, { moments, omega0, time }) {
  const known = data.bodies.find((body) => body.case && isSame(body.moments, moments));
  const start = known && !isSame(known.omega, omega0) ? ` --omega=${omega0}` : "";
  const scene = known ? `--case ${known.case}${start}` : "--scene body.toml";
  const command = `pyharness run ${scene} --method closed-form --attitude quaternion --times ${time}`;
  const file = `[body]\nmoments = [${listed(moments)}]\n[initial]\nomega = [${listed(omega0)}]`;
  return { command, file: known ? "" : file };
}

// Return the state that an address specifies, and a message for each of its words that is invalid;
// the default replaces such a word.
export function stateFrom(data, fragment) {
  const problems = [];
  const read = readerOf(wordsIn(fragment, problems, WORDS), problems);
  const ids = data.bodies.map((body) => body.id);
  const idFrom = (text) => oneOf("body", text, ids);
  const state = stateOfBody(data, read("body", idFrom, data.first));
  state.moments = read("moments", momentsFrom, state.moments);
  state.omega0 = read("omega0", omegaFrom, state.omega0);
  state.time = read("time", timeFrom(data), 0);
  return { state, problems };
}

function check(word, values, isAllowed, allowed) {
  const found = values.find((x) => !isAllowed(x));
  if (found !== undefined) throw new StateError(`${word}: ${found}; allowed: ${allowed}`);
}

export function momentsFrom(text, word = "moments") {
  const moments = threeFrom(text, word, "40,30,20");
  const [least, most] = MOMENTS;
  check(word, moments, (x) => x >= least && x <= most, `numbers from ${least} to ${most}`);
  const [low, middle, high] = [...moments].sort((a, b) => a - b);
  // As in pyharness/model/scene.py.
  if ((high - middle - low) * 2 ** 50 <= high) return moments;
  const told = `${low} + ${middle} is less than ${high}`;
  throw new StateError(`${word}: ${told}; each moment is at most the sum of the other two`);
}

export function omegaFrom(text, word = "omega0") {
  // No -0.
  const omega = threeFrom(text, word, "40,30,20").map((x) => x + 0);
  const [least, most] = OMEGA;
  const isAllowed = (x) => x === 0 || (Math.abs(x) >= least && Math.abs(x) <= most);
  check(word, omega, isAllowed, `0, or numbers from ${least} to ${most} of either sign`);
  return omega;
}

export function timeFrom(data) {
  return (text, word = "time") => {
    const time = numberFrom(text, word) + 0;
    const isAllowed = (x) => x >= 0 && x <= data.longest;
    check(word, [time], isAllowed, `a number from 0 to ${data.longest}`);
    return time;
  };
}
