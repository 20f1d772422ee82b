// The experiment: from a state to a run and to the statements about it. It needs no page.
import { PROGRAMS } from "../programs/programs.js";
import { Trace } from "../programs/trace.js";
import { reference } from "./reference.js";
import { sceneOfCase } from "./state.js";

// Return the scene of a state in the form that a port of the programs reads.
export function sceneOf(data, state) {
  const scene = sceneOfCase(data, state.case);
  return {
    ...scene,
    initial: { omega: state.omega0 ?? scene.initial.omega },
    run: { step_size: state.stepSize, steps: state.steps },
  };
}

// Return the result of the program of a state.
export function runOf(data, state, trace = null) {
  const active = new Set(state.active);
  const { run } = PROGRAMS[state.program];
  return run(sceneOf(data, state), active, state.lipschitz, state.stops, trace);
}

// Return the experiment of a state: its `scene`, the result of the program (`run`), the true
// `times` of all steps (s) and the solution at these times (`truth`, rad/s). `errors` has the error
// of each row by component, or null where there is no solution. `tests` has what the stop test
// compares in each step.
export function experiment(data, state) {
  const scene = sceneOf(data, state);
  const trace = new Trace(0);
  const run = runOf(data, state, trace);
  const times = Array.from({ length: state.steps }, (_, n) => (n + 1) * state.stepSize);
  const truth = reference(scene, times);
  const errors = run.rows.map((row, n) =>
    n < truth.length ? truth[n].map((value, axis) => Math.abs(row[axis + 1] - value)) : null,
  );
  return { state, scene, run, times, truth, errors, tests: trace.tests };
}

// Return the largest error of any component so far (rad/s), or null if no error is known.
export function largestError({ errors }) {
  const known = errors.flatMap((row) => row ?? []);
  return known.length > 0 ? known.reduce((most, each) => Math.max(most, each), 0) : null;
}

// Return a sentence that says how far the run came, and why it ended there.
export function ending({ state, scene, run }) {
  const { steps } = scene.run;
  if (run.ended === "overflow") {
    const next = run.rows.length + 1;
    return `Overflow in step ${next} of ${steps}: omega is not finite any more.`;
  }
  if (run.ended === "complete") return `Complete: ${counted(steps, "step")}.`;
  const { step, variable, quotient } = run.stop;
  const time = brief(step * state.stepSize);
  const found = Number.isFinite(quotient)
    ? `its slope changed by ${brief(quotient)} times its own change`
    : "its slope changed though its value did not";
  const limit = `the limit is ${brief(state.lipschitz)} (1/s)`;
  return `Stopped at step ${step} of ${steps}, at ${time} s, by ${variable}, ${told(variable)}: ${found}; ${limit}.`;
}

function told(variable) {
  if (variable === "U") return "the angular velocity";
  if (variable === "UV") return "angular velocity and velocity together";
  const what = variable.startsWith("U") ? "omega about" : "the velocity along";
  return `${what} axis ${variable[1]}`;
}

export function counted(number, what) {
  return `${number} ${what}${number === 1 ? "" : "s"}`;
}

// Format a number with few digits, for reading.
export function brief(value, digits = 3) {
  return String(Number(value.toPrecision(digits)));
}
