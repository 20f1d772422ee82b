// Double-double arithmetic, accurate to some 1e-31: a number is a pair [high, low], where `low` is
// the rounding error of `high`.

// 2^27 + 1.
const SPLITTER = 134217729;

// Return the pair that is exactly x + y (Knuth).
export function sumOf(x, y) {
  const total = x + y;
  const part = total - x;
  return [total, x - (total - part) + (y - part)];
}

// Return the pair that is exactly x y, unless it underflows (Dekker).
export function productOf(x, y) {
  const product = x * y;
  const xs = SPLITTER * x;
  const xh = xs - (xs - x);
  const xl = x - xh;
  const ys = SPLITTER * y;
  const yh = ys - (ys - y);
  const yl = y - yh;
  return [product, xh * yh - product + xh * yl + xl * yh + xl * yl];
}

export function add(x, y) {
  const [total, error] = sumOf(x[0], y[0]);
  const rest = error + (x[1] + y[1]);
  // The high parts may have cancelled.
  const high = total + rest;
  return [high, rest - (high - total)];
}

export function subtract(x, y) {
  return add(x, [-y[0], -y[1]]);
}

export function multiply(x, y) {
  const [high, low] = productOf(x[0], y[0]);
  return [high, low + (x[0] * y[1] + x[1] * y[0])];
}

// Return the product of a pair and a number.
export function times(x, factor) {
  const [high, low] = productOf(x[0], factor);
  return [high, low + x[1] * factor];
}

export function divide(x, y) {
  const high = x[0] / y[0];
  const [product, rest] = productOf(high, y[0]);
  return [high, (x[0] - product + (x[1] - rest - high * y[1])) / y[0]];
}

export function root(x) {
  const high = Math.sqrt(x[0]);
  const [square, rest] = productOf(high, high);
  return [high, (x[0] - square + (x[1] - rest)) / (high + high)];
}

// Return the product of a triple-double and a number: each number of a triple is the rounding error
// of the one before it.
export function longerTimes(x, factor) {
  const [first, error] = productOf(x[0], factor);
  const [middle, rest] = productOf(x[1], factor);
  const [second, left] = sumOf(error, middle);
  return [first, second, left + (rest + x[2] * factor)];
}

// Return sine and cosine of an angle (rad), which is a pair.
export function sineCosine([angle, low]) {
  const [s, c, sl, cl] = [Math.sin(angle), Math.cos(angle), Math.sin(low), Math.cos(low)];
  return [s * cl + c * sl, c * cl - s * sl];
}
