// Jacobi's cn, sn, dn of a phase, and an integral of the third kind, by theta series. Far from the
// separatrix they are series in sines of v = pi u/(2 K), near it in exponentials of
// x = pi u/(4 K'). This module has the formulas of fortran/modern/theta_functions.f90.
import { productOf, sineCosine, sumOf, times } from "./double-double.js";

// The most levels of the arithmetic-geometric mean.
const MOST_LEVELS = 16;
// A difference whose square is negligible.
const FLAT = 4e-9;
// The nome at which K = sqrt(2) K'.
const BALANCED = 0.1085;
// The number pi without its first 53 bits.
const PI_LOW = 1.2246467991473532e-16;
// Larger arguments make exponentials negligible.
const FAR = 340;

// Return the constants of the series that converges faster, for k^2 = pole[0] pole[1] and k'.
//
// The integral has 1 + pole[0] sn^2 in its denominator. It is arg(C + i S) + drift v, with C > 0.
// `size` has factors of cn, sn, dn, which the caller may multiply by amplitudes. `ratio` is x over
// v; the caller sets it if the kind is "hyperbolic". The kind "endless" is the separatrix, which has
// no period.
export function thetaSeries(pole, k, comodulus) {
  if (!(comodulus > 0)) return exponentials("endless", pole, 1, 0);
  let next = (2 * Math.sqrt(comodulus)) / (1 + comodulus);
  let overPole =
    (0.5 * pole[0] * pole[1] ** 2) /
    (1 + comodulus) ** 4 /
    ((1 + next) * (1 + Math.sqrt(next)) ** 2);
  let square = overPole * pole[0];
  if (square < 0.015) {
    next = 1 + square ** 4 * (2 + 15 * square ** 4);
    square *= next;
    overPole *= next;
  }
  if (square < BALANCED * BALANCED) return sines(pole, comodulus, square, overPole);
  square = (0.5 * comodulus ** 2) / ((1 + k) * (1 + Math.sqrt(k)) ** 2);
  square *= 1 + square ** 4 * (2 + 15 * square ** 4);
  return exponentials("hyperbolic", pole, k, square);
}

// Return the constants of the series in sines. `square` is the square of the nome q, and `overPole` is
// `square` over pole[0].
function sines(pole, comodulus, square, overPole) {
  const q = Math.sqrt(square);
  const powers = [2 * q, 2 * square ** 2, 2 * q * square ** 4, 2 * square ** 8];
  const theta2 = 1 + square * (1 + square ** 2 * (1 + square ** 3));
  const even = 1 + (powers[1] + powers[3]);
  const odd = powers[0] + powers[2];
  const [theta3, theta4] = [even + odd, even - odd];
  const { s, c } = descend(comodulus, 1, Math.sqrt(1 + pole[0]), Math.sqrt(1 + pole[1]));
  const both = (s + c) ** 2;
  // square exp(2 eta) and square exp(-2 eta), where i eta is the phase of the pole.
  const up = overPole * both;
  const down = (square * pole[0]) / both;
  const weight = (sign) => [
    -(up + sign * down),
    square ** 2 * (up ** 2 + sign * down ** 2),
    -(square ** 6) * (up ** 3 + sign * down ** 3),
  ];
  return {
    kind: "trigonometric",
    size: [theta4 / theta2, theta3 / theta2, theta4 / theta3],
    powers,
    even: [1 - square * (1 - square ** 2 * (1 - square ** 3)), 2 * square ** 3 * (1 - square ** 3)],
    odd: [2 * square * (1 - square ** 2 * (1 - square ** 3)), 2 * square ** 6],
    c: weight(1),
    s: weight(-1),
  };
}

// Return the constants of the series in exponentials. `square` is the square of the nome
// Q = exp(-pi K/(2 K')).
function exponentials(kind, pole, k, square) {
  const theta2 = 1 + square ** 2 * (1 + square ** 4);
  const theta3 = 1 + 2 * (square + square ** 4);
  const theta4 = 1 - 2 * (square - square ** 4);
  const start = Math.sqrt(pole[0]);
  const found = descend(k, 1, start, start * Math.sqrt((1 + pole[1]) / (1 + pole[0])));
  const e = 0.5 * Math.atan2(found.s, found.c);
  const nome = Math.sqrt(square);
  const [c, s] = [[], []];
  for (let n = 0, power = 1, step = nome; n <= 4; n++) {
    c.push(power * Math.cos((2 * n + 1) * e));
    s.push(power * Math.sin((2 * n + 1) * e));
    power *= step;
    step *= square;
  }
  return {
    kind,
    size: [(2 * theta2) / theta4, theta3 / theta4, (2 * theta2) / theta3],
    nome,
    powers: [square, square ** 2, square ** 4, square ** 6],
    c,
    s,
    ratio: [0, 0],
    drift: kind === "hyperbolic" ? (2 * e) / Math.PI : 0,
  };
}

// Return the phase, a pair, that has these values of cn, sn, dn. `slope` is v over u, or x over u on
// the separatrix. Landen's transformation gives the phase, and the difference that the series then
// show its rounding error; near the separatrix it counts.
export function startOfPhase(theta, k, comodulus, slope, [cn, sn, dn]) {
  let phase;
  if (theta.kind === "endless") {
    phase = Math.sign(sn) * 0.5 * Math.log((1 + Math.abs(sn)) / dn);
  } else {
    const { s, c } = descend(comodulus, sn, cn, dn);
    phase = Math.atan2(s, c);
  }
  const { f } = ellipticFunctions(theta, [phase, 0]);
  return [phase, (slope * (sn * f[0] * f[2] - f[1] * cn * dn)) / (dn * dn + (k * sn * cn) ** 2)];
}

// Return sine and cosine of the phase with these sn, cn, dn when Landen's transformations have
// reduced the modulus to 0; sn and cn may have a common factor. Every sum has only positive terms.
function descend(comodulus, sn, cn, dn) {
  let [a, b, s, c, delta] = [1, comodulus, sn, cn, dn];
  for (let n = 0; n < MOST_LEVELS; n++) {
    const mean = 0.5 * (a + b);
    const double = 2 / (1 + delta);
    delta = Math.sqrt((0.5 * double * (b + a * delta)) / mean);
    s = (s * double * mean) / a;
    c = (c * double) / delta;
    if (Math.abs(a - b) <= FLAT * a) break;
    b = Math.sqrt(a * b);
    a = mean;
  }
  return { s, c };
}

// Return cn, sn, dn of a phase (a pair), times theta.size, and c, s, part of the integral, which is
// arg(c + i s) + part.
export function ellipticFunctions(theta, phase) {
  return theta.kind === "trigonometric" ? sumOfSines(theta, phase) : sumOfExponentials(theta, phase);
}

function sumOfSines(theta, phase) {
  const [sine, cosine] = sineCosine(phase);
  const s2 = 2 * sine * cosine;
  const c2 = 1 - 2 * sine * sine;
  const s4 = 2 * s2 * c2;
  const c4 = 1 - 2 * s2 * s2;
  const s6 = s2 * (1 + 2 * c4);
  const c6 = c2 * (2 * c4 - 1);
  const c8 = 1 - 2 * s4 * s4;
  const { size, powers, c, s } = theta;
  // Partial sums: multiples of 4 v, and the others.
  let even = 1 + (powers[1] * c4 + powers[3] * c8);
  let odd = powers[0] * c2 + powers[2] * c6;
  const inverse = 1 / (even - odd);
  const dn = size[2] * ((even + odd) * inverse);
  even = theta.even[0] + theta.even[1] * c4;
  odd = theta.odd[0] * c2 + theta.odd[1] * c6;
  const cn = size[0] * (cosine * (even + odd) * inverse);
  const sn = size[1] * (sine * (even - odd) * inverse);
  return {
    f: [cn, sn, dn],
    c: 1 + (c[0] * c2 + (c[1] * c4 + c[2] * c6)),
    s: s[0] * s2 + (s[1] * s4 + s[2] * s6),
    part: 0,
  };
}

// Every term that grows with |x| has a factor, a power of the nome, that keeps it below 1.
function sumOfExponentials(theta, phase) {
  const { size, powers, nome: q } = theta;
  const q2 = powers[0];
  let [x, xLow] = phase;
  // The sign of sn and cn after this number of half periods.
  let sense = 1;
  let part = 0;
  if (theta.kind === "hyperbolic") {
    const turns = Math.round(x / Math.PI);
    const [product, rest] = productOf(turns, Math.PI);
    const v = sumOf(x - product, xLow - rest - turns * PI_LOW);
    if (turns % 2 !== 0) sense = -1;
    part = v[0] * theta.drift;
    // Near the separatrix x is a large part of K, so that it must be a pair.
    [x, xLow] = times(theta.ratio, v[0]);
    xLow += theta.ratio[0] * v[1];
  }
  let g = Math.exp(-2 * Math.min(Math.abs(x), FAR));
  g -= 2 * g * (x < 0 ? -xLow : xLow);
  // This is Q exp(2 |x|), at most 1.
  const h = q > 0 ? q / g : 0;
  const [g2, h2] = [g * g, h * h];
  const [g4, h4] = [g2 * g2, h2 * h2];
  const inverse =
    1 / (1 + g2 + q2 * (h2 + q2 * g4) + powers[2] * (h4 + powers[1] * (g2 * g4)));
  const even = 1 + powers[1] * (h4 + powers[1] * g4);
  const odd = h2 + q2 * g2 + powers[3] * (h2 * h4);
  const cn = sense * size[0] * (g * (even - odd) * inverse);
  const dn = size[2] * (g * (even + odd) * inverse);
  const sn = 1 - g2 - q2 * (h2 - q2 * g4) + powers[2] * (h4 - powers[1] * (g2 * g4));
  const terms = [
    [1, g],
    [h, q * g2],
    [h2, q2 * g * g2],
    [h * h2, q2 * q * g4],
    [h4, 0],
  ];
  let [c, s] = [0, 0];
  for (let n = 4; n >= 0; n--) {
    c += theta.c[n] * (terms[n][0] + terms[n][1]);
    s += theta.s[n] * (terms[n][0] - terms[n][1]);
  }
  // So far everything is for |x|, and s has the opposite sign.
  const side = x < 0 ? -1 : 1;
  return { f: [cn, side * sense * size[1] * (sn * inverse), dn], c, s: -side * s, part };
}
