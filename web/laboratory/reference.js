// The reference solution for a run: the Taylor series of equations 13 to 15, in binary64.
//
// Its error over the largest |omega| of the trajectory is below 1e-15 times the error
// amplification. It is 2e-16 in 300 steps of the seven cases (docs/explanation/laboratory.md; tests/edition
// compares it with 40-digit arithmetic). The reference shares only the sines of the torque and A,
// B, C with the programs.
import { cosine, sine } from "../programs/circular.js";
import { eulerCoefficients } from "../programs/equations.js";

const ORDER = 25;
// Largest size of the last terms over omega, far below a rounding error.
const LAST_TERM = 1e-18;
// Work limit: the number of series. A spin of 1e5 turns per step would take minutes.
const MOST_SERIES = 20_000;

// Return omega (rad/s) at each of `times` (s), which increase from 0. The rows end early if the
// solution grows without bound or takes too many series.
export function reference(scene, times) {
  const coefficients = eulerCoefficients(scene);
  const terms = [0, 1, 2].map(() => new Float64Array(ORDER + 1));
  const torque = [0, 1, 2].map(() => new Float64Array(ORDER));
  let omega = [...scene.initial.omega];
  let rest = [0, 0, 0]; // rounding error of omega
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

// Compute the coefficients of torque over moment in powers of the time from `begin`, into `torque`.
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
    const turns = [s, c, -s, -c]; // a derivative advances the phase by a quarter turn
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

// Compute the coefficients of omega in powers of time, into `terms`. By equations 13 to 15, n + 1
// times coefficient n + 1 is coefficient n of the torque plus that of the product of the other two
// components.
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

// Return the time (s) over which the last three terms stay small. A term that is zero by symmetry
// does not count as small. For a motion from rest they are compared with term 1, otherwise with
// term 0.
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

// Return omega at `time` from the beginning of the series, and its rounding error.
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
