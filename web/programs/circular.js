// Sine and cosine (rad), correctly rounded in practice, in sums of two floats (hi + lo).
//
// An engine's own differ from the C library's in some 3 % of arguments. Correctly rounded ones
// differ in some 0.14 %, by one unit in the last place: those that the C library does not round to
// the nearest float.

const SPLITTER = 134217729; // 2^27 + 1
// pi/2 in three floats, to 160 bits.
const QUARTER_TURN = [1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33];
const TWO_OVER_PI = 0.6366197723675814;
// Beyond, turns are taken off by too few bits of pi/2; the engine's own function answers.
const LARGEST = 2 ** 30;
// Below, x is the float nearest to sin(x), and 1 to cos(x).
const SMALLEST = 2 ** -27;

function sum(x, y) {
  const hi = x + y;
  const part = hi - x;
  return [hi, x - (hi - part) + (y - part)];
}

function product(x, y) {
  const hi = x * y;
  const xs = SPLITTER * x;
  const x1 = xs - (xs - x);
  const x2 = x - x1;
  const ys = SPLITTER * y;
  const y1 = ys - (ys - y);
  const y2 = y - y1;
  return [hi, x1 * y1 - hi + x1 * y2 + x2 * y1 + x2 * y2];
}

function add([x, xl], [y, yl]) {
  const [s, e] = sum(x, y);
  const [t, f] = sum(xl, yl);
  const [u, g] = sum(s, e + t);
  return sum(u, g + f);
}

function multiply([x, xl], [y, yl]) {
  const [p, e] = product(x, y);
  return sum(p, e + (x * yl + xl * y));
}

function divide(pair, y) {
  const first = pair[0] / y;
  const [p, e] = product(first, y);
  return sum(first, (pair[0] - p - e + pair[1]) / y);
}

// 1, -1/(2 3), 1/(2 3 4 5), ... and 1, -1/2, 1/(2 3 4), ...
function alternating(first) {
  const terms = [[1, 0]];
  for (let n = first; terms.length < 15; n += 2) {
    const [hi, lo] = divide(divide(terms[terms.length - 1], n), n + 1);
    terms.push([-hi, -lo]);
  }
  return terms.reverse();
}
const SINE = alternating(2);
const COSINE = alternating(1);

function series(terms, square) {
  return terms.reduce((total, term) => add(multiply(total, square), term), [0, 0]);
}

function turned(x, quarters) {
  const turns = Math.round(x * TWO_OVER_PI);
  let rest = [x, 0];
  for (const part of QUARTER_TURN) {
    const [hi, lo] = product(-turns, part);
    rest = add(add(rest, [hi, 0]), [lo, 0]);
  }
  const quadrant = (((turns + quarters) % 4) + 4) % 4;
  const square = multiply(rest, rest);
  const [found] =
    quadrant % 2 ? series(COSINE, square) : multiply(rest, series(SINE, square));
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
