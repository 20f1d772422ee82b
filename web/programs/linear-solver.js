// Stand-in for LEQT1F of the IMSL library, which solves A X = B for several right-hand sides.
//
// A is factored into L and U in Crout's order, with implicit row scaling and partial pivoting.

const SINGULAR = 129;

// Return [x of A x = b for every b, IER]; neither A nor any b is changed. If A is algorithmically
// singular, each b is returned unchanged, with IER = SINGULAR; otherwise IER is 0.
export function leqt1f(matrix, rightHandSides) {
  const factors = matrix.map((row) => [...row]);
  const pivots = factor(factors);
  if (pivots === null) return [rightHandSides.map((b) => [...b]), SINGULAR];
  return [rightHandSides.map((b) => substitute(factors, pivots, b)), 0];
}

// Overwrite `a` by its factors. Return the row exchanged at each column, or null if `a` is
// singular.
function factor(a) {
  const n = a.length;
  const pivots = [];
  const scale = [];
  for (const row of a) {
    let biggest = Math.abs(row[0]);
    for (const element of row) {
      if (Math.abs(element) > biggest) biggest = Math.abs(element);
    }
    if (biggest === 0) return null;
    scale.push(1 / biggest);
  }

  for (let j = 0; j < n; j++) {
    for (let i = 0; i < n; i++) {
      const row = a[i];
      let total = row[j];
      for (let k = 0; k < Math.min(i, j); k++) total = total - row[k] * a[k][j];
      row[j] = total;
    }

    // On and below the diagonal these are the candidates for the pivot; the first maximum is taken.
    let biggest = 0;
    let pivot = j;
    for (let i = j; i < n; i++) {
      const scaled = scale[i] * Math.abs(a[i][j]);
      if (scaled > biggest) {
        biggest = scaled;
        pivot = i;
      }
    }
    if (n + biggest === n) return null;

    if (pivot !== j) {
      [a[j], a[pivot]] = [a[pivot], a[j]];
      scale[pivot] = scale[j];
    }
    pivots.push(pivot);
    for (let i = j + 1; i < n; i++) a[i][j] = a[i][j] / a[j][j];
  }
  return pivots;
}

// Substitute forward through L, then backward through U.
function substitute(a, pivots, b) {
  const n = a.length;
  const x = [...b];
  for (let i = 0; i < n; i++) {
    let total = x[pivots[i]];
    x[pivots[i]] = x[i];
    for (let k = 0; k < i; k++) total = total - a[i][k] * x[k];
    x[i] = total;
  }
  for (let i = n - 1; i >= 0; i--) {
    let total = x[i];
    for (let k = i + 1; k < n; k++) total = total - a[i][k] * x[k];
    x[i] = total / a[i][i];
  }
  return x;
}
