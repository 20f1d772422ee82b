// The limit of a program: the omega to which it converges as its step size goes to zero.
//
// docs/article/article.md derives the limits of the original programs, and
// pyharness/history/limits.py computes them independently.
import { eulerCoefficients, normalizedTorque } from "../programs/equations.js";
import { reference } from "./reference.js";

// Substeps of a step for the limit equation of the two-term program.
const SUBSTEPS = 40;

// A limit that differs from the solution by less than this part of its size is the solution.
const SAME = 1e-9;

// Return the limit of an experiment's program without its stop test: its `kind` (solution,
// half-speed, equation, nothing or unknown), a sentence, and omega (rad/s) at the experiment's times,
// or null if it is the solution or not known. The rows of omega end where the limit grows without
// bound.
export function limitOf(data, { state, scene, times, truth }) {
  const kind = kindOf(data, state, scene);
  const omega = { "half-speed": halfSpeed, equation: extrapolated }[kind]?.(scene, times) ?? null;
  const sentence = SENTENCES[kind === "half-speed" && varies(scene) ? "half-speed, torque" : kind];
  if (omega === null || !same(omega, truth)) return { kind, sentence, omega };
  return { kind, sentence: `${sentence} In this case both are the same function.`, omega: null };
}

function same(omega, truth) {
  const size = truth.flat().reduce((most, each) => Math.max(most, Math.abs(each)), 0);
  return (
    omega.length === truth.length &&
    omega.every((row, n) => row.every((value, axis) => Math.abs(value - truth[n][axis]) <= SAME * size))
  );
}

const SENTENCES = {
  solution:
    "As the step size goes to zero, this program converges to the solution. The limit is the dashed curve.",
  "half-speed":
    "As the step size goes to zero, this program does not converge to the solution y(t), but to 2 y(t/2) - y(0): " +
    "time runs at half speed.",
  equation:
    "As the step size goes to zero, this program does not converge to the solution, but to the solution of another " +
    "equation: w' = F(w) - (2/9) t^2 Q(F(w)), where F is the right-hand side of Euler's equations and Q its quadratic part.",
  nothing:
    "As the step size goes to zero, this program converges to no function: it reads the torque at its variable TIME, " +
    "which grows without bound.",
  "half-speed, torque":
    "As the step size goes to zero, this program does not converge to the solution: omega responds at half speed to a " +
    "torque that varies at full speed.",
  unknown: "We have not worked out the limit for this combination of switches.",
};

function kindOf(data, state, scene) {
  const own = data.flags.filter((flag) => flag.programs.includes(state.program));
  const active = own.filter((flag) => state.active.includes(flag.id));
  const has = (name) => active.some((flag) => flag.id === name);
  if (active.some((flag) => flag.kind === "reading")) return "unknown";
  if (state.program === "runge-kutta") {
    return has("stage-base") && has("base-not-restored") ? "half-speed" : "solution";
  }
  if (!has("dt-accumulates")) return "solution";
  if (varies(scene)) return has("torque-held") ? "nothing" : "unknown";
  return state.program === "four-term" ? "solution" : "equation";
}

function varies({ torque }) {
  return [torque.rate, ...[...torque.sines, ...torque.cosines].map((wave) => wave.amplitude)]
    .flat()
    .some((value) => value !== 0);
}

// Return 2 q(t/2) - omega(0), where q solves Euler's equations with the torque at twice the time.
// With a constant torque, q is the solution.
function halfSpeed(scene, times) {
  const faster = (wave) => ({ ...wave, frequency: 2 * wave.frequency });
  const { torque, initial } = scene;
  const slowed = {
    ...scene,
    torque: {
      ...torque,
      rate: torque.rate.map((value) => 2 * value),
      sines: torque.sines.map(faster),
      cosines: torque.cosines.map(faster),
    },
  };
  const half = reference(slowed, times.map((time) => time / 2));
  return half.map((row) => row.map((value, axis) => 2 * value - initial.omega[axis]));
}

// Integrate the limit equation of the two-term program by the classical Runge-Kutta method.
function extrapolated(scene, times) {
  const coefficients = eulerCoefficients(scene);
  const torque = normalizedTorque(scene, 0);
  const products = ([x, y, z]) => [y * z, x * z, x * y].map((value, axis) => coefficients[axis] * value);
  const rate = (t, omega) => {
    const slope = products(omega).map((value, axis) => torque[axis] + value);
    return products(slope).map((value, axis) => slope[axis] - (2 / 9) * t * t * value);
  };
  const bound = 1e6 * Math.max(1, ...scene.initial.omega.map(Math.abs));
  const along = (omega, length, slope) => omega.map((value, axis) => value + length * slope[axis]);
  let omega = scene.initial.omega;
  let begin = 0;
  const rows = [];
  for (const time of times) {
    const h = (time - begin) / SUBSTEPS;
    for (let n = 0; n < SUBSTEPS; n++) {
      const t = begin + n * h;
      const first = rate(t, omega);
      const second = rate(t + h / 2, along(omega, h / 2, first));
      const third = rate(t + h / 2, along(omega, h / 2, second));
      const fourth = rate(t + h, along(omega, h, third));
      omega = omega.map(
        (value, axis) =>
          value + (h / 6) * (first[axis] + 2 * (second[axis] + third[axis]) + fourth[axis]),
      );
    }
    if (!omega.every((value) => Math.abs(value) < bound)) break;
    rows.push(omega);
    begin = time;
  }
  return rows;
}
