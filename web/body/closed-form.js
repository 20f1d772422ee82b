// The motion of a rigid body without torque in closed form: angular velocity and attitude at any
// time, without steps. Jacobi's elliptic functions give omega. A theta function of the same phase
// gives the rotation about the angular momentum. This module has the formulas of
// fortran/modern/torque_free_attitude.f90, and tests compare its numbers with those of that module.
//
// A unit quaternion q, scalar first, rotates body to space: v_space = q v_body q*, and
// q' = q (0, omega)/2. It is D(0)* D(t), where D = (rotation about axis 3) (shortest rotation of
// the angular momentum to axis 3). The axes of the orbit are its own: axis 2 has the middle moment,
// omega about axis 3 does not change its sign, and axes 1, 2, 3 are right-handed.
import {
  add,
  divide,
  longerTimes,
  multiply,
  productOf,
  root,
  sineCosine,
  subtract,
  sumOf,
  times,
} from "./double-double.js";
import { ellipticFunctions, startOfPhase, thetaSeries } from "./theta.js";

// The most levels of the arithmetic-geometric mean.
const MOST_LEVELS = 16;
// The remainder for which double-double is too short.
const CANCELLED = 1e-4;
// A difference whose square is negligible.
const FLAT = 1e-10;
// The last term of the sum; the means then differ by less.
const LAST = 1e-17;
// The phase that ends the path on the separatrix.
const ENDLESS = 20;

// Return Hamilton's product of two quaternions.
export function product(p, q) {
  return [
    p[0] * q[0] - p[1] * q[1] - (p[2] * q[2] + p[3] * q[3]),
    p[0] * q[1] + p[1] * q[0] + (p[2] * q[3] - p[3] * q[2]),
    p[0] * q[2] + p[2] * q[0] + (p[3] * q[1] - p[1] * q[3]),
    p[0] * q[3] + p[3] * q[0] + (p[1] * q[2] - p[2] * q[1]),
  ];
}

// Return a vector of the body in space.
export function inSpace(q, vector) {
  const conjugate = [q[0], -q[1], -q[2], -q[3]];
  return product(product(q, [0, ...vector]), conjugate).slice(1);
}

// Return the torque-free motion of a body, as { at, isSteady, axes, flipTime, flipAfter, span, peak,
// least }.
//
// `moments` (kg m2) and `omega0` (rad/s) are about the body's axes, which are parallel to those of
// space at time 0. The squares of ratios of the components of omega must not underflow. at(t) returns
// { omega, attitude } at t seconds. `flipTime` is the time (s) between sign changes of omega about
// the middle axis, infinite if there is none; flipAfter(t) is the time of the next one. `span` is a
// time (s) in which omega runs through its whole path in the body: the period, or on the separatrix
// the time outside of which omega is steady. If omega is not steady, `peak` is the largest omega
// about the middle axis (rad/s), and `least` the smallest about the axis that omega circles. `axes`
// has the numbers of the body's axes (0, 1, 2) in the order of the orbit.
export function torqueFree(moments, omega0) {
  const axes = [0, 1, 2].sort((a, b) => moments[b] - moments[a] || a - b);
  let gaps = gapsOf(moments, omega0, axes);
  // Omega about the other extreme axis keeps its sign.
  if (gaps.e2[0] < 0) gaps = gapsOf(moments, omega0, axes.reverse());
  const { w } = gaps;
  const signs = w.map((x) => (x < 0 ? -1 : 1));
  signs[1] = signs[0] * signs[2] * ((axes[0] + 1) % 3 === axes[1] ? 1 : -1);
  const start = w.map((x, i) => x * signs[i] + 0);

  const isSteady = [gaps.d23, gaps.e1, gaps.e3].some(([x]) => x === 0) || (w[0] === 0 && w[2] === 0);
  const orbit = isSteady ? steadyOrbit(start) : tumblingOrbit(start, gaps);
  const [scalar, ...vector] = turned(orbit, 0).turn;
  const before = [scalar, ...vector.map((x) => -x)];
  const at = (t) => {
    const [omega, attitude] = [[...omega0], [1, 0, 0, 0]];
    if (t === 0) return { omega, attitude };
    const { found, turn } = turned(orbit, t);
    const [q0, ...q] = product(before, turn);
    attitude[0] = q0;
    axes.forEach((axis, i) => {
      if (!isSteady) omega[axis] = signs[i] * found[i];
      attitude[1 + axis] = signs[i] * q[i];
    });
    return { omega, attitude };
  };
  const hasPeriod = !isSteady && orbit.theta.kind !== "endless";
  const { frequency, peak, least } = orbit;
  const flipTime = hasPeriod ? Math.PI / frequency[0] : Infinity;
  const flipAfter = (t) => {
    if (!hasPeriod) return Infinity;
    const offset = orbit.start[0] / frequency[0];
    // A time that is a flip, but for rounding, is followed by another flip.
    return (Math.floor((t + offset) / flipTime + 1e-7) + 1) * flipTime - offset;
  };
  let span = 2 * flipTime;
  if (!hasPeriod) span = isSteady ? 0 : ENDLESS / frequency[0];
  return { at, isSteady, axes, flipTime, flipAfter, span, peak, least };
}

// Return differences that determine the orbit with these axes, the middle moment between the others:
// d12, d13, d23 of the moments, without sign, e1 = d13 I1 omega1^2 + d23 I2 omega2^2 and e3 alike,
// e2 = d23 I3 omega3^2 - d12 I1 omega1^2.
function gapsOf(moments, omega0, axes) {
  const moment = axes.map((axis) => moments[axis]);
  const w = axes.map((axis) => omega0[axis]);
  const energies = w.map((x, i) => times(productOf(x, x), moment[i]));
  const gap = (x, y) => sumOf(Math.max(x, y), -Math.min(x, y));
  const d12 = gap(moment[0], moment[1]);
  const d13 = gap(moment[0], moment[2]);
  const d23 = gap(moment[1], moment[2]);
  const e1 = add(multiply(energies[0], d13), multiply(energies[1], d23));
  const e3 = add(multiply(energies[2], d13), multiply(energies[1], d12));
  let e2 = subtract(multiply(energies[2], d23), multiply(energies[0], d12));
  if (Math.abs(e2[0]) <= CANCELLED * energies[2][0] * d23[0]) {
    e2 = narrowGap(moment, w, energies, d12, d23);
  }
  return { moment, w, energies, d12, d13, d23, e1, e2, e3 };
}

// Return e2 near the separatrix, where nearly all of it cancels, from products in triple-double.
function narrowGap(moment, w, energies, d12, d23) {
  const triple = (i, gap) =>
    longerTimes(longerTimes([...productOf(w[i], w[i]), 0], moment[i]), gap[0]);
  const [x, y] = [triple(2, d23), triple(0, d12)];
  const parts = x.map((each, i) => sumOf(each, -y[i]));
  const low = subtract(times(energies[2], d23[1]), times(energies[0], d12[1]));
  return add(add(add(parts[0], parts[1]), parts[2]), low);
}

function steadyOrbit(w) {
  const squares = w.map((x) => productOf(x, x));
  const square = add(add(squares[0], squares[1]), squares[2]);
  if (!(square[0] > 0)) return { isSteady: true, halfRate: [0, 0], direction: [0, 0, 0] };
  const speed = root(square);
  return { isSteady: true, halfRate: times(speed, 0.5), direction: w.map((x) => x / speed[0]) };
}

// Return rates, phase and theta series of a motion that is not steady.
function tumblingOrbit(w, gaps) {
  const { moment, energies, d12, d13, d23, e1, e2, e3 } = gaps;
  const squares = energies.map((energy, i) => times(energy, moment[i]));
  const momentum = root(add(add(squares[0], squares[1]), squares[2]));
  const inertia = root(times(productOf(moment[0], moment[1]), moment[2]));
  const pole = [
    (d12[0] * moment[2]) / (d23[0] * moment[0]),
    (e1[0] * moment[0]) / (e3[0] * moment[2]),
  ];
  const k = Math.sqrt(pole[0] * pole[1]);
  const largest = [
    Math.sqrt(e1[0] / (moment[0] * d13[0])),
    Math.sqrt(e1[0] / (moment[1] * d23[0])),
    Math.sqrt(e3[0] / (moment[2] * d13[0])),
  ];
  const sense = moment[2] < moment[0] ? -1 : 1;
  const orbit = { isSteady: false, sense, direction: moment.map((x) => x / momentum[0]) };
  // lambda and lambda k', times `inertia`; u' = lambda.
  const upper = root(multiply(d23, e3));
  let comodulus = 0;
  if (e2[0] > 0) {
    const lower = root(multiply(d13, e2));
    comodulus = lower[0] / upper[0];
    Object.assign(orbit, ratesOf(gaps, momentum, inertia, upper, lower, pole, sense));
  } else {
    orbit.frequency = times(divide(upper, inertia), 0.5);
    orbit.halfRate = times(divide(momentum, [moment[1], 0]), 0.5);
  }
  const slope = (orbit.frequency[0] * inertia[0]) / upper[0];
  const theta = thetaSeries(pole, k, comodulus);
  if (theta.kind === "hyperbolic") {
    // K/(2 K'): half the mean of 1 and k, over the mean of 1 and k'.
    const mean = meanOf(upper, root(multiply(d12, e1)));
    theta.ratio = divide(times(mean, 0.5), multiply(orbit.frequency, inertia));
  }
  const values = [w[0] / largest[0], (sense * w[1]) / largest[1], w[2] / largest[2]];
  orbit.start = startOfPhase(theta, k, comodulus, slope, values);
  const sizes = [largest[0], sense * largest[1], largest[2]];
  const size = theta.size.map((x, i) => x * sizes[i]);
  return { ...orbit, theta: { ...theta, size }, peak: largest[1], least: largest[2] * comodulus };
}

// Return the frequency of the phase, from the arithmetic-geometric mean, and half the rate of the
// rotation about the angular momentum. The rate is an integral of the third kind, by the sum that
// accompanies the mean (Gauss).
function ratesOf({ moment, d12, d13, d23, e1, e3 }, momentum, inertia, upper, lower, pole, sense) {
  // Use the pole that is nearer to 0.
  const byMoments = pole[0] < pole[1];
  let p = byMoments
    ? root(divide(times(multiply(d13, e3), moment[1]), [moment[0], 0]))
    : multiply(momentum, root(divide(multiply(d13, d23), [moment[2], 0])));
  let [a, g, share, total] = [upper, lower, [1, 0], [1, 0]];
  let mean = a;
  for (let n = 0; n < MOST_LEVELS; n++) {
    mean = times(add(a, g), 0.5);
    const both = multiply(a, g);
    const other = divide(both, p);
    share = times(multiply(share, divide(subtract(p, other), add(p, other))), 0.5);
    total = add(total, share);
    if (Math.abs(share[0]) <= LAST) break;
    p = times(add(p, other), 0.5);
    a = mean;
    g = root(both);
  }
  // One more level would subtract the following term.
  const half = mean[0] - g[0] + (mean[1] - g[1]);
  mean = [mean[0], mean[1] - (half * half) / (4 * mean[0])];
  const frequency = divide(mean, inertia);
  if (byMoments) {
    const part = subtract([2 * moment[1], 0], times(multiply(d12, total), sense));
    const both = times(productOf(moment[0], moment[1]), 4);
    const rate = divide(multiply(momentum, part), both);
    return { frequency, halfRate: subtract(rate, times(frequency, 0.5 * sense)) };
  }
  const square = times(multiply(momentum, momentum), 2);
  const part = add(square, times(multiply(e1, total), sense));
  return { frequency, halfRate: divide(part, times(momentum, 4 * moment[2])) };
}

function meanOf(larger, smaller) {
  let [a, g] = [larger, smaller];
  for (let n = 0; n < MOST_LEVELS; n++) {
    const mean = times(add(a, g), 0.5);
    if (Math.abs(a[0] - g[0]) <= FLAT * a[0]) return mean;
    g = root(multiply(a, g));
    a = mean;
  }
  return a;
}

// Return omega and the rotation D at a time, in axes of the orbit.
function turned(orbit, t) {
  const angle = times(orbit.halfRate, t);
  if (orbit.isSteady) {
    const [sine, cosine] = sineCosine(angle);
    return { turn: [cosine, ...orbit.direction.map((x) => x * sine)] };
  }
  const advance = times(orbit.frequency, t);
  const [phase, rest] = sumOf(orbit.start[0], advance[0]);
  const { f, c, s: plain, part } = ellipticFunctions(orbit.theta, [
    phase,
    rest + (advance[1] + orbit.start[1]),
  ]);
  const [total, error] = sumOf(angle[0], part * orbit.sense);
  const [sine, cosine] = sineCosine([total, angle[1] + error]);
  // The direction of the angular momentum.
  const m = f.map((x, i) => x * orbit.direction[i]);
  const s = plain * orbit.sense;
  const inverse = 1 / Math.sqrt((c * c + s * s) * (2 + 2 * m[2]));
  const along = (cosine * c - sine * s) * inverse;
  const across = (sine * c + cosine * s) * inverse;
  const turn = [
    along * (1 + m[2]),
    along * m[1] + across * m[0],
    across * m[1] - along * m[0],
    across * (1 + m[2]),
  ];
  return { found: f, turn };
}
