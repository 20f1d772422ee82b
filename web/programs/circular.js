// Sine and cosine (rad), by sums of two floats (hi + lo), to 0.5000013 units in the last place
// (proved in tests/campaigns/function_errors); almost all are therefore correctly rounded.
//
// The functions of an engine differ from those of the C library in some 3 % of arguments. Correctly
// rounded functions differ from those of the C library in some 0.14 %, by one unit in the last
// place. There the C library does not round to the nearest float.

const SPLITTER = 134217729; // 2^27 + 1
// pi/2 as the sum of three floats, to 160 bits.
const QUARTER_TURN = [1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33];
const TWO_OVER_PI = 0.6366197723675814;
// Above it, pi/2 has too few bits for the reduction, so that the engine's own function is used.
const LARGEST = 2 ** 30;
// Below it, x is the float nearest to sin(x), and 1 is the float nearest to cos(x).
const SMALLEST = 2 ** -27;

// A function whose result is two floats returns the first and leaves the second here. A sine takes
// some 500 such operations, and half of its time was spent on an array for each.
const low = new Float64Array(1);

function sum(x, y) {
  const hi = x + y;
  const part = hi - x;
  low[0] = x - (hi - part) + (y - part);
  return hi;
}

function product(x, y) {
  const hi = x * y;
  const xs = SPLITTER * x;
  const x1 = xs - (xs - x);
  const x2 = x - x1;
  const ys = SPLITTER * y;
  const y1 = ys - (ys - y);
  const y2 = y - y1;
  low[0] = x1 * y1 - hi + x1 * y2 + x2 * y1 + x2 * y2;
  return hi;
}

function add(x, xl, y, yl) {
  const s = sum(x, y);
  const e = low[0];
  const t = sum(xl, yl);
  const f = low[0];
  const u = sum(s, e + t);
  return sum(u, low[0] + f);
}

function multiply(x, xl, y, yl) {
  const p = product(x, y);
  return sum(p, low[0] + (x * yl + xl * y));
}

function divide(x, xl, y) {
  const first = x / y;
  const p = product(first, y);
  return sum(first, (x - p - low[0] + xl) / y);
}

// Return 1, -1/(2 3), 1/(2 3 4 5), ... or 1, -1/2, 1/(2 3 4), ...; the last is first, as it is
// added first.
function alternating(first) {
  const terms = [[1, 0]];
  for (let n = first; terms.length < 15; n += 2) {
    const [x, xl] = terms[0];
    const half = divide(x, xl, n);
    const hi = divide(half, low[0], n + 1);
    terms.unshift([-hi, -low[0]]);
  }
  return Float64Array.from(terms.flat());
}
const SINE = alternating(2);
const COSINE = alternating(1);

function series(terms, x, xl) {
  let hi = 0;
  low[0] = 0;
  for (let i = 0; i < terms.length; i += 2) {
    hi = multiply(hi, low[0], x, xl);
    hi = add(hi, low[0], terms[i], terms[i + 1]);
  }
  return hi;
}

function turned(x, quarters) {
  const turns = Math.round(x * TWO_OVER_PI);
  let rest = x;
  let restLow = 0;
  for (const part of QUARTER_TURN) {
    const hi = product(-turns, part);
    const lo = low[0];
    rest = add(rest, restLow, hi, 0);
    rest = add(rest, low[0], lo, 0);
    restLow = low[0];
  }
  const quadrant = (((turns + quarters) % 4) + 4) % 4;
  const square = multiply(rest, restLow, rest, restLow);
  let found;
  if (quadrant % 2) {
    found = series(COSINE, square, low[0]);
  } else {
    found = series(SINE, square, low[0]);
    found = multiply(rest, restLow, found, low[0]);
  }
  return quadrant < 2 ? found : -found;
}

export function sine(x) {
  if (!(Math.abs(x) < LARGEST)) return Math.sin(x);
  return Math.abs(x) < SMALLEST ? x : turned(x, 0);
}

export function cosine(x) {
  if (!(Math.abs(x) < LARGEST)) return Math.cos(x);
  return Math.abs(x) < SMALLEST ? 1 : turned(x, 1);
}
