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
import { UNKNOWNS, noteAll } from "./trace.js";

const LETTERS = ["F", "G", "H", "X", "Y", "Z"];

// `lipschitz` is in 1/s; without `mayStop` there is no stop test. `trace` is a Trace or null.
export function run(scene, listing, lipschitz = 500, mayStop = true, trace = null) {
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
    const note = trace?.recorder(step + 1) ?? null;
    if (note) noteStart(note, time, point[1], base);
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
      if (note) noteSlopes(note, stage, torque[stage], slope[stage]);
    };
    const store = (stage, before, length) => {
      const start = listing.has("stage-base") ? point[before] : base;
      point[stage] = start.map((x, i) => x + length * slope[stage][i]);
      if (note) noteAll(note, unknownsAt(stage), point[stage]);
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
    if (note) noteAll(note, unknownsAt(4), result);

    const changeU = listing.has("lipschitz-mismatched-pairs")
      ? distances(result, base)
      : distances(point[3], firstPoint);
    const changeK = distances(slope[4], slope[1]);
    const tests = lipschitzTests(listing, changeK, changeU);
    if (note) noteTests(note, changeK, changeU, lipschitz, tests);
    trace?.tests.push(tests);
    if (mayStop) {
      const found = violated(tests, lipschitz);
      if (found !== null) {
        return record.trajectory("stopped", { step: step + 1, ...found }, false);
      }
    }

    point[4] = result;
    base = result;
    if (!listing.has("base-not-restored")) point[1] = result;
    if (note) noteEnd(note, point[1], base);
  }
  return record.trajectory("complete", null, false);
}

// Return what the condition of eq. 19 compares: for each test the variable, the change of its slope,
// and its own change.
function lipschitzTests(listing, changeK, changeU) {
  const velocityCounts = listing.has("lipschitz-tests-velocity");
  const last = velocityCounts ? 6 : 3;
  if (listing.has("lipschitz-per-component")) {
    const found = UNKNOWNS.slice(0, last).map((name, i) => [name, changeK[i], changeU[i]]);
    return [...found.slice(3), ...found.slice(0, 3)]; // the velocity first
  }
  const name = velocityCounts ? "UV" : "U";
  return [[name, norm(changeK.slice(0, last)), norm(changeU.slice(0, last))]];
}

// Return the first variable that violates the condition, and its quotient, or null.
function violated(tests, lipschitz) {
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
  return Math.sqrt(squares(x));
}

function squares(x) {
  let total = 0;
  for (const each of x) total = total + each * each;
  return total;
}

// Return the names of the unknowns of a stage, as in U1(2).
function unknownsAt(stage) {
  return UNKNOWNS.map((name) => `${name}(${stage})`);
}

function noteStart(note, time, firstPoint, base) {
  noteAll(note, UNKNOWNS.map((name) => `before ${name}(1)`), firstPoint);
  noteAll(note, UNKNOWNS.map((name) => `before ${name[0]}${name}`), base);
  note("TIME", time);
  noteAll(note, [1, 2, 3, 4, 5, 6].map((n) => `P${n}`), firstPoint);
}

function noteSlopes(note, stage, torque, slopes) {
  noteAll(note, ["R1", "R2", "R3"], torque);
  noteAll(note, LETTERS.map((letter) => `K${letter}(${stage})`), slopes);
}

function noteTests(note, changeK, changeU, lipschitz, tests) {
  noteAll(note, LETTERS.map((letter) => `${letter}L2`), changeU);
  noteAll(note, LETTERS.map((letter) => `${letter}L1`), changeK);
  note("LIP", lipschitz);
  for (const [name, change] of [["SK", changeK], ["SU", changeU]]) {
    note(name, squares(change.slice(0, 3)));
    if (tests[0][0] === "UV") note(name, squares(change));
  }
}

function noteEnd(note, firstPoint, base) {
  noteAll(note, UNKNOWNS.map((name) => `${name[0]}${name}`), base);
  noteAll(note, unknownsAt(1), firstPoint);
}
