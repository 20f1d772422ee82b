// The answer to "Why did it stop?", in sentences that are computed from the run.
import { brief } from "./experiment.js";
import { hasStopTest } from "./state.js";

const NAMES = ["U1", "U2", "U3", "V1", "V2", "V3"];
// A change in a step that is smaller than this part of the greatest one counts as hardly any.
const HARDLY = 0.1;

// Return the quotient of each test of the stop test, by step and variable: the change of the slope
// over the change of the unknown (1/s). It is null where neither changes.
export function quotientsOf(tests) {
  return tests.map((step) =>
    step.map(([variable, change, by]) => [variable, change === 0 && by === 0 ? null : change / by]),
  );
}

// Return two or three sentences on how an experiment ended.
export function whyEnded({ state, scene, run, truth, errors, tests }) {
  if (run.ended === "overflow") return overflow(run, truth);
  if (run.ended === "complete") return complete(state, tests);
  const { step, variable, quotient } = run.stop;
  const rule =
    "After each step, the stop test divides the change of a slope by the change of its variable. " +
    `It ends the run where this quotient exceeds ${brief(state.lipschitz)} (1/s).`;
  return `${rule} ${cause(scene, run, tests, step, variable, quotient)} ${meaning(variable, errors[step - 1])}`;
}

function cause(scene, run, tests, step, variable, quotient) {
  const [, change, by] = tests[step - 1].find(([name]) => name === variable);
  const numbers = Number.isFinite(quotient)
    ? `the quotient is ${brief(quotient, 4)}`
    : "the quotient is infinite";
  const axis = NAMES.indexOf(variable);
  if (axis < 0) {
    const what = variable === "U" ? "omega" : "omega and the velocity together";
    return `In step ${step} the slope of ${what} changed by ${brief(change)} and the compared values by ${brief(by)}: ${numbers}.`;
  }
  const unit = variable[0] === "U" ? "rad/s" : "m/s";
  const starts = [...scene.initial.omega, 0, 0, 0];
  const values = [starts[axis], ...run.rows.map((row) => row[axis + 1])];
  const changes = values.slice(1).map((value, n) => value - values[n]);
  const greatest = changes.reduce((most, each) => Math.max(most, Math.abs(each)), 0);
  const [before, now] = [changes[step - 2] ?? 0, changes[step - 1]];
  const turned = before * now < 0;
  const hardly = Math.abs(now) < HARDLY * greatest;
  const moved = `${variable} went from ${values[step - 1].toPrecision(4)} to ${values[step].toPrecision(4)} ${unit}`;
  if (turned || hardly) {
    const where = turned ? "had just passed a turning point" : "was near a turning point";
    return (
      `In step ${step} ${variable} ${where}: ${moved}, a change of ${brief(Math.abs(now))}. ` +
      `It hardly changed while its slope changed by ${brief(change)}, so ${numbers}.`
    );
  }
  return `In step ${step} ${moved}, and its slope changed by ${brief(change)}, so ${numbers}.`;
}

function meaning(variable, errors) {
  const error = errors ? ` In that step omega had an error of ${brief(Math.max(...errors))} rad/s.` : "";
  if (variable.startsWith("V")) {
    return `${variable} is a velocity, on which omega does not depend.${error}`;
  }
  return error.trim();
}

function overflow(run, truth) {
  const sizes = run.rows.map((row) => Math.max(...row.slice(1, 4).map(Math.abs)));
  const last = sizes.length;
  const grown = sizes.findLastIndex((size, n) => n < last - 1 && size < sizes[last - 1] / 1e6);
  const during = last - 1 - grown;
  const time = during === 1 ? "In its last step alone" : `In its last ${during} steps`;
  const speed = grown < 0 ? "" : ` ${time} it grew more than a million times.`;
  const finite = truth.length > last ? " The solution is finite there: the growth is an error of the program." : "";
  return `Omega grew until it exceeded the largest number of the computer's arithmetic, about 1.8e308.${speed}${finite}`;
}

function complete(state, tests) {
  if (!hasStopTest(state.program)) {
    return "This program has no stop test, so it runs all its steps, right or wrong.";
  }
  const found = quotientsOf(tests).flatMap((step, n) => step.map(([name, value]) => [n + 1, name, value]));
  const above = found.find(([, , value]) => value > state.lipschitz);
  if (!state.stops && above) {
    return (
      "The stop test is switched off. " +
      `With it, the run would have ended at step ${above[0]}, where the quotient of ${above[1]} is ${brief(above[2], 4)}.`
    );
  }
  const known = found.filter(([, , value]) => value !== null);
  if (known.length === 0) return "No slope changed, so that there was nothing to test.";
  const most = known.reduce((one, other) => (other[2] > one[2] ? other : one));
  return (
    `No quotient exceeded the limit of ${brief(state.lipschitz)} (1/s). ` +
    `The largest was ${brief(most[2])}, in step ${most[0]}, for ${most[1]}.`
  );
}
