// Runge-Kutta: the third program of the appendix, Jacobs 1982, eq. 31 and IV.3.
//
// The stop test applies the Lipschitz condition (eq. 19) as the thesis does: a run ends when the
// right-hand sides change by more than the constant times the change of the unknowns.
import {
  Record,
  accelerations,
  allFinite,
  eulerCoefficients,
  initialTorque,
  normalizedTorque,
  velocityRate,
} from "./equations.js";

const STOP_VARIABLES = ["U1", "U2", "U3", "V1", "V2", "V3"];

// `lipschitz` is in 1/s; without `mayStop` there is no stop test. `watch` is called in every step with
// the changes that the stop test compares.
export function run(scene, listing, lipschitz = 500, mayStop = true, watch = null) {
  const [a, b, c] = eulerCoefficients(scene);
  const acceleration = accelerations(scene, listing);
  const { step_size: dt, steps } = scene.run;
  let time = 0;
  let base = [...scene.initial.omega, 0, 0, 0];
  // Stage i is evaluated, and stored, under the index that the program gives it: 1, 2, 3, 4.
  const zero = [0, 0, 0, 0, 0, 0];
  const point = { 1: base, 2: zero, 3: zero, 4: zero };
  const slope = { 1: zero, 2: zero, 3: zero, 4: zero };
  const third = listing.has("do-variable") ? 4 : 3;
  const record = new Record();
  const first = listing.has("initial-torque") ? initialTorque(scene) : null;

  for (let step = 0; step < steps; step++) {
    const begin = step * dt;
    time = time + dt;
    let torque;
    if (step === 0 && first !== null) {
      torque = { 1: first, 2: first, 3: first, 4: first };
    } else if (listing.has("torque-held")) {
      const held = normalizedTorque(scene, time);
      torque = { 1: held, 2: held, 3: held, 4: held };
    } else {
      const middle = normalizedTorque(scene, begin + 0.5 * dt);
      torque = {
        1: normalizedTorque(scene, begin),
        2: middle,
        3: middle,
        4: normalizedTorque(scene, begin + dt),
      };
    }
    const firstPoint = point[1];

    const evaluate = (stage, at) => {
      const u = point[at].slice(0, 3);
      const v = point[at].slice(3);
      const [r1, r2, r3] = torque[stage];
      const omegaRates = [r1 + a * u[1] * u[2], r2 + b * u[2] * u[0], r3 + c * u[0] * u[1]];
      slope[stage] = [...omegaRates, ...velocityRate(acceleration, u, v)];
    };
    const store = (stage, before, length) => {
      const start = listing.has("stage-base") ? point[before] : base;
      point[stage] = start.map((x, i) => x + length * slope[stage][i]);
    };

    evaluate(1, 1);
    store(1, 1, 0.5 * dt);
    evaluate(2, 1);
    store(2, 1, 0.5 * dt);
    evaluate(third, 2);
    store(third, 2, dt);
    evaluate(4, 3);
    // eq. 31
    const result = base.map(
      (x, i) =>
        x + (dt / 6) * (slope[1][i] + 2 * (slope[2][i] + slope[3][i]) + slope[4][i]),
    );
    if (!allFinite(result.slice(0, 3))) return record.trajectory("overflow", null, false);
    record.add(time, result.slice(0, 3), result.slice(3));

    const changeU = listing.has("lipschitz-mismatched-pairs")
      ? distances(result, base)
      : distances(point[3], firstPoint);
    const changeK = distances(slope[4], slope[1]);
    watch?.({ changeK, changeU });
    if (mayStop) {
      const found = lipschitzTest(listing, changeK, changeU, lipschitz);
      if (found !== null) {
        return record.trajectory("stopped", { step: step + 1, ...found }, false);
      }
    }

    point[4] = result;
    base = result;
    if (!listing.has("base-not-restored")) point[1] = result;
  }
  return record.trajectory("complete", null, false);
}

// Return the variable that violates the condition of eq. 19 and its quotient, or null.
function lipschitzTest(listing, changeK, changeU, lipschitz) {
  const velocityCounts = listing.has("lipschitz-tests-velocity");
  const last = velocityCounts ? 6 : 3;
  let tests;
  if (listing.has("lipschitz-per-component")) {
    const found = STOP_VARIABLES.slice(0, last).map((name, i) => [name, changeK[i], changeU[i]]);
    tests = [...found.slice(3), ...found.slice(0, 3)]; // the velocity first
  } else {
    const name = velocityCounts ? "UV" : "U";
    tests = [[name, norm(changeK.slice(0, last)), norm(changeU.slice(0, last))]];
  }
  for (const [variable, change, by] of tests) {
    if (change > by * lipschitz) {
      return { variable, quotient: by === 0 ? Infinity : change / by };
    }
  }
  return null;
}

function distances(x, y) {
  return x.map((p, i) => Math.abs(p - y[i]));
}

function norm(x) {
  let total = 0;
  for (const each of x) total = total + each * each;
  return Math.sqrt(total);
}
