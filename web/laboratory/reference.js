// The solution to hold a run against: the Taylor series of equations 13 to 15, in binary64.
//
// Its error over the largest |omega| on the way is below 1e-15 times what the motion makes of a small
// difference: 2e-16 in 300 steps of the seven cases (docs/laboratory.md; tests/edition holds it
// against 40-digit arithmetic). It shares torque's sines and A, B, C with the programs, no more.
import { cosine, sine } from "../programs/circular.js";
import { eulerCoefficients } from "../programs/equations.js";

const ORDER = 25;
// What the last terms may be, over omega: far below a rounding.
const LAST_TERM = 1e-18;
// Series that are computed before giving up: a spin of 1e5 turns a step would take minutes.
const MOST_SERIES = 20_000;

// omega (rad/s) at every one of `times` (s), which rise from 0; where the solution leaves every
// bound or takes too many series the rows end before.
export function reference(scene, times) {
  const coefficients = eulerCoefficients(scene);
  const terms = [0, 1, 2].map(() => new Float64Array(ORDER + 1));
  const torque = [0, 1, 2].map(() => new Float64Array(ORDER));
  let omega = [...scene.initial.omega];
  let rest = [0, 0, 0]; // what rounding took from omega
  let begin = 0;
  const rows = [];

  for (let count = 0; count < MOST_SERIES && rows.length < times.length; count++) {
    torqueTerms(scene, begin, torque);
    series(coefficients, omega, torque, terms);
    const reach = reachOf(terms);
    if (Number.isNaN(reach) || begin + reach === begin) break;

    let at = begin;
    let found = [omega, rest];
    while (rows.length < times.length && times[rows.length] <= begin + reach) {
      at = times[rows.length];
      found = valuesAt(terms, rest, at - begin);
      if (!found[0].every(Number.isFinite)) return rows;
      rows.push(found[0]);
    }
    if (at === begin) {
      at = begin + reach;
      found = valuesAt(terms, rest, at - begin);
    }
    [omega, rest] = found;
    begin = at;
  }
  return rows;
}

// Coefficients of torque over moment in powers of the time from `begin`, into `torque`.
function torqueTerms(scene, begin, torque) {
  const { constant, rate, sines, cosines } = scene.torque;
  for (let axis = 0; axis < 3; axis++) {
    torque[axis].fill(0);
    torque[axis][0] = constant[axis] + rate[axis] * begin;
    torque[axis][1] = rate[axis];
  }
  const waves = [...sines.map((wave) => [wave, 0]), ...cosines.map((wave) => [wave, 1])];
  for (const [{ amplitude, frequency }, quarters] of waves) {
    const s = sine(frequency * begin);
    const c = cosine(frequency * begin);
    const turns = [s, c, -s, -c]; // every derivative is a quarter turn on
    let factor = 1; // frequency^n / n!
    for (let n = 0; n < ORDER; n++) {
      const value = factor * turns[(n + quarters) % 4];
      for (let axis = 0; axis < 3; axis++) torque[axis][n] += amplitude[axis] * value;
      factor = (factor * frequency) / (n + 1);
    }
  }
  const { moments } = scene.body;
  if (!moments) return;
  torque.forEach((values, axis) => {
    for (let n = 0; n < ORDER; n++) values[n] /= moments[axis];
  });
}

// The coefficients of omega in powers of time, into `terms`: n + 1 times the next one is that of
// the torque and of the product of the other two.
function series([a, b, c], omega, torque, terms) {
  const [x, y, z] = terms;
  omega.forEach((value, axis) => {
    terms[axis][0] = value;
  });
  for (let n = 0; n < ORDER; n++) {
    let yz = 0;
    let xz = 0;
    let xy = 0;
    for (let k = 0; k <= n; k++) {
      yz += y[k] * z[n - k];
      xz += x[k] * z[n - k];
      xy += x[k] * y[n - k];
    }
    x[n + 1] = (torque[0][n] + a * yz) / (n + 1);
    y[n + 1] = (torque[1][n] + b * xz) / (n + 1);
    z[n + 1] = (torque[2][n] + c * xy) / (n + 1);
  }
}

// How far (s) the last three terms stay small; some are zero by symmetry, not by being small. A
// motion from rest is measured by what its first terms make of it.
function reachOf(terms) {
  const sizes = Array.from({ length: ORDER + 1 }, (_, n) =>
    Math.max(...terms.map((values) => Math.abs(values[n]))),
  );
  if (!sizes.every(Number.isFinite)) return NaN;
  let reach = Infinity;
  for (let n = ORDER - 2; n <= ORDER; n++) {
    if (sizes[n] === 0) continue;
    for (let m = 0; m < 2; m++) {
      if (sizes[m] === 0) continue;
      reach = Math.min(reach, ((LAST_TERM * sizes[m]) / sizes[n]) ** (1 / (n - m)));
      break;
    }
  }
  return reach;
}

// Omega at `time` from the beginning of the series, and what rounding took from it.
function valuesAt(terms, rest, time) {
  const omega = [];
  const lost = [];
  terms.forEach((values, axis) => {
    let change = 0;
    for (let n = ORDER; n > 0; n--) change = (change + values[n]) * time;
    change += rest[axis];
    const value = values[0] + change;
    omega.push(value);
    const part = value - values[0];
    lost.push(values[0] - (value - part) + (change - part));
  });
  return [omega, lost];
}
