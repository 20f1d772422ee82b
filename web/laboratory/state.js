// The state of the laboratory, and its words in the page's address, which are options of the
// command line.
//
// A state is { case, program, base, active, omega0, stepSize, steps, lipschitz, stops }. `base` is
// the listing that was chosen. `active` has the names of all active switches, for every program
// that has them. `omega0` is null if it is that of the case. `data` comes with the page: cases,
// programs, flags, limits.
import { StateError, numberFrom, oneOf, readerOf, shown, threeFrom, wordsIn } from "./address.js";

const LISTINGS = ["original", "corrected"];
const KINDS = ["defect", "reading", "conjecture"];

// Return the state of a page whose address specifies nothing.
export function defaultState(data) {
  const { case: number, program, listing } = data.defaults;
  return stateOf(data, number, program, listing);
}

function stateOf(data, number, program, base) {
  return {
    case: number,
    program,
    base,
    active: activeIn(data, base),
    omega0: null,
    stepSize: sceneOfCase(data, number).run.step_size,
    steps: sceneOfCase(data, number).run.steps,
    lipschitz: data.lipschitz,
    stops: true,
  };
}

export function sceneOfCase(data, number) {
  return data.scenes.find((scene) => scene.case === number);
}

// Return the names of a kind (defect, reading, conjecture) that a program has.
export function namesOf(data, program, kind) {
  return data.flags
    .filter((flag) => flag.kind === kind && flag.programs.includes(program))
    .map((flag) => flag.id);
}

// Return the names that are active in the listing `base`, for all programs.
export function activeIn(data, base) {
  return data.flags.filter((flag) => flag.in_original && base !== "corrected").map((flag) => flag.id);
}

// Return the listing that the switches of a program make: original, corrected, or some of the faults.
// Return what we supply, and on which the run of a state depends; "" for a start of the reader's.
export function suppliedIn(data, state) {
  if (state.omega0 !== null) return "";
  const isOriginal = listingOf(data, state) !== "corrected";
  const onCards = data.assumedInRuns[state.case][state.program].filter(
    ({ entry, active }) => isOriginal && state.active.includes(entry) === active,
  );
  return [data.assumed[state.case], ...onCards.map(({ what }) => what)].filter(Boolean).join("; ");
}

export function listingOf(data, { program, active }) {
  const own = KINDS.flatMap((kind) => namesOf(data, program, kind));
  const chosen = own.filter((name) => active.includes(name)).join();
  const usual = (base) => own.filter((name) => activeIn(data, base).includes(name)).join();
  return LISTINGS.find((base) => usual(base) === chosen) ?? "some";
}

// Return the words of a state, each as a name and its value; a switch has the value null. Case,
// program and listing are always included, other words only if they differ from the defaults.
export function wordsOf(data, state) {
  const { program, base, active, stops } = state;
  const usual = stateOf(data, state.case, program, base);
  const chosen = (kind) => namesOf(data, program, kind).filter((name) => active.includes(name));
  const words = [["case", String(state.case)], ["program", program], ["listing", base]];
  const add = (word, names) => names.length > 0 && words.push([word, names.join(",")]);

  if (base === "corrected") {
    // A reading or conjecture does not change a corrected statement, so one that is active is kept.
    add("keep", KINDS.flatMap(chosen));
  } else {
    const defects = namesOf(data, program, "defect");
    add("fix", defects.filter((name) => !active.includes(name)));
    add("reading", chosen("reading"));
    const conjectures = chosen("conjecture");
    const assumed = namesOf(data, program, "conjecture").filter((name) => usual.active.includes(name));
    if (conjectures.join() !== assumed.join()) {
      add("conjecture", conjectures.length > 0 ? conjectures : ["none"]);
    }
  }
  if (state.omega0 !== null) add("omega0", state.omega0.map(written));
  if (state.stepSize !== usual.stepSize) add("step-size", [state.stepSize]);
  if (state.steps !== usual.steps) add("steps", [state.steps]);
  if (hasStopTest(program)) {
    if (!stops) words.push(["no-stop", null]);
    else if (state.lipschitz !== usual.lipschitz) add("lipschitz", [state.lipschitz]);
  }
  return words;
}

// Return the shortest text that is read as the same number, with the sign of zero.
export function written(value) {
  return Object.is(value, -0) ? "-0" : String(value);
}

export function hasStopTest(program) {
  return program === "runge-kutta";
}

// Return the fragment of an address that names a state and, as its last word, the pinned state if
// there is one.
export function fragmentOf(data, state, pinned = null) {
  const words = wordsOf(data, state).map(([word, value]) => (value === null ? word : `${word}=${value}`));
  if (pinned !== null) words.push(`pin=${encodeURIComponent(fragmentOf(data, pinned))}`);
  return words.join("&");
}

export function commandOf(data, state) {
  const options = wordsOf(data, state).map(([word, value]) =>
    value === null ? `--${word}` : `--${word} ${value}`,
  );
  return ["pyharness run", ...options].join(" ");
}

// Return the state that an address specifies, the pinned state or null, and a message for each word
// that is invalid; the default replaces such a word.
export function stateFrom(data, fragment) {
  const problems = [];
  const given = wordsIn(fragment, problems, [...WORDS, "pin"]);
  const state = stateOfWords(data, given, problems);
  if (!given.has("pin")) return { state, pinned: null, problems };
  const told = [];
  const pinned = stateOfWords(data, wordsIn(given.get("pin") ?? "", told, WORDS), told);
  problems.push(...told.map((each) => `pin: ${each}`));
  return { state, pinned, problems };
}

function stateOfWords(data, given, problems) {
  const read = readerOf(given, problems);
  const { case: number, program: usual } = data.defaults;

  const cases = data.scenes.map((scene) => String(scene.case));
  const chosen = Number(read("case", (text) => oneOf("case", text, cases), number));
  const program = read("program", (text) => oneOf("program", text, data.programs), usual);
  const list = (kind) => (text, word) => namesIn(text, word, kind, namesOf(data, program, kind));
  const every = KINDS.flatMap((kind) => namesOf(data, program, kind));
  const switches = (text, word) => namesIn(text, word, "defect", every);
  const fix = read("fix", switches, []);
  let keep = read("keep", switches, []);
  const both = keep.filter((name) => fix.includes(name));
  if (both.length > 0) {
    problems.push(`'${both[0]}' is given to both fix and keep; give it to one`);
    keep = [];
  }
  // As on the command line, `keep` alone corrects all others.
  const unsaid = keep.length > 0 && fix.length === 0 ? "corrected" : data.defaults.listing;
  const base = read("listing", (text) => oneOf("listing", text, LISTINGS), unsaid);
  const state = stateOf(data, chosen, program, base);

  const conjectures = namesOf(data, program, "conjecture");
  const assumed = conjectures.filter((name) => state.active.includes(name));
  const noneOr = (text, word) => (text === "none" ? [] : list("conjecture")(text, word));
  const readings = read("reading", list("reading"), []);
  const chosenConjectures = read("conjecture", noneOr, assumed);
  const own = [
    ...state.active.filter((name) => !conjectures.includes(name)),
    ...readings,
    ...chosenConjectures,
  ].filter((name) => !fix.includes(name));
  // A corrected statement has its intended form under every reading and conjecture.
  const active = new Set([...(base === "corrected" ? [] : own), ...keep]);
  state.active = data.flags.map((flag) => flag.id).filter((name) => active.has(name));
  state.omega0 = read("omega0", omegaFrom, null);
  state.stepSize = read("step-size", positiveFrom, state.stepSize);
  state.steps = read("steps", stepsFrom(data), state.steps);
  for (const word of ["lipschitz", "no-stop"]) {
    if (given.has(word) && !hasStopTest(program)) {
      problems.push(`${word} has no meaning with program=${program}`);
      given.delete(word);
    }
  }
  state.stops = read("no-stop", noValue, true);
  if (given.has("lipschitz") && !state.stops) {
    problems.push("lipschitz has no meaning with no-stop");
    given.delete("lipschitz");
  }
  state.lipschitz = read("lipschitz", positiveFrom, state.lipschitz);
  return state;
}

const WORDS = [
  ...["case", "program", "listing", "fix", "keep", "reading", "conjecture", "omega0", "step-size"],
  ...["steps", "lipschitz", "no-stop"],
];

function namesIn(text, word, kind, allowed) {
  const names = (text ?? "").split(",").map((name) => name.trim());
  for (const name of names) {
    if (!allowed.includes(name)) {
      const known = allowed.join(", ") || "none";
      throw new StateError(`${word}: unknown ${kind} '${shown(name)}'; allowed: ${known}`);
    }
  }
  return names;
}

export function omegaFrom(text, word = "omega0") {
  return threeFrom(text, word, "0,1,10");
}

export function positiveFrom(text, word) {
  const value = numberFrom(text, word);
  if (value > 0) return value;
  throw new StateError(`${word}: ${shown(text)}; allowed: a number above 0`);
}

// Return a reader of numbers of steps, up to the number that a page draws at once.
export function stepsFrom(data) {
  return (text, word) => {
    const value = /^[-+]?\d+$/.test((text ?? "").trim()) ? Number(text) : NaN;
    if (value >= 1 && value <= data.most_steps) return value;
    const allowed = `a whole number from 1 to ${data.most_steps}`;
    throw new StateError(`${word}: '${shown(text)}'; allowed: ${allowed}`);
  };
}

function noValue(text, word) {
  if (text === null) return false;
  throw new StateError(`${word}: '${shown(text)}' where no value belongs`);
}
