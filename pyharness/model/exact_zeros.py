"""Exact first zeros of polynomials of time."""

import math
import sys
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import pairwise

# A zero is located to this fraction of its distance from time 0.
_CLOSE = Fraction(1, 1 << 60)
_LARGEST = Fraction(sys.float_info.max)


def _product(first: Sequence[Fraction], second: Sequence[Fraction]) -> list[Fraction]:
    found = [Fraction(0)] * (len(first) + len(second))
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            found[i + j] += a * b
    return found


def determinant(elements: Sequence[Sequence[Sequence[float]]]) -> list[Fraction]:
    """Return the determinant of a symmetric matrix of polynomials, as exact coefficients."""
    (a, f, e), (_, b, d), (_, _, c) = ([[Fraction(x) for x in p] for p in row] for row in elements)
    terms = ((1, (a, b, c)), (2, (d, e, f)), (-1, (a, d, d)), (-1, (b, e, e)), (-1, (c, f, f)))
    products = [[sign * each for each in _product(_product(x, y), z)] for sign, (x, y, z) in terms]
    return [sum(column, Fraction(0)) for column in zip(*products, strict=True)]


def first_zeros(polynomial: Iterable[float | Fraction]) -> tuple[float, float]:
    """Return a polynomial's zeros (s) nearest before and after 0; -inf or inf if missing.

    At 0, the polynomial must be positive.
    """
    exact = [Fraction(c) for c in polynomial]
    backward = [-c if n % 2 else c for n, c in enumerate(exact)]
    return -_first_zero(backward), _first_zero(exact)


def _first_zero(polynomial: Sequence[Fraction]) -> float:
    if min(polynomial) >= 0:
        return math.inf
    divisor = math.lcm(*(c.denominator for c in polynomial))
    whole = [int(c * divisor) for c in polynomial]
    while not whole[-1]:
        whole.pop()
    exponent = _bound(whole)
    # No positive zero exceeds 2**exponent s; the unknown is time divided by this bound.
    least = min(0, exponent * (len(whole) - 1))
    row = _bernstein([c << (exponent * n - least) for n, c in enumerate(whole)])
    unit = Fraction(2) ** exponent
    # A polynomial is positive in an interval if its coefficients in Bernstein's basis are positive
    # (Farouki 2012, Computer Aided Geometric Design 29). Other intervals are halved.
    pieces = [(Fraction(0), Fraction(1), row)]
    while pieces:
        begin, end, row = pieces.pop()
        if begin * unit > _LARGEST:
            return math.inf
        if min(row) > 0:
            continue
        if row[0] <= 0 or end - begin <= _CLOSE * begin:
            return float(begin * unit)
        middle = (begin + end) / 2
        early, late = _halves(row)
        pieces += [(middle, end, late), (begin, middle, early)]
    return math.inf


def _bound(polynomial: Sequence[int]) -> int:
    """Return log2 of a bound on positive zeros (Kioustelidis 1986, J. Comput. Appl. Math. 16)."""
    degree, last = len(polynomial) - 1, polynomial[-1]
    return 1 + max(
        -((last.bit_length() - 1 - c.bit_length()) // (degree - n))
        for n, c in enumerate(polynomial[:-1])
        if c * last < 0
    )


def _bernstein(polynomial: Sequence[int]) -> list[int]:
    degree = len(polynomial) - 1
    factor = math.lcm(*(math.comb(degree, j) for j in range(degree + 1)))
    parts = [c * (factor // math.comb(degree, j)) for j, c in enumerate(polynomial)]
    return [
        sum(math.comb(k, j) * part for j, part in enumerate(parts[: k + 1]))
        for k in range(degree + 1)
    ]


def _halves(row: list[int]) -> tuple[list[int], list[int]]:
    """Return Bernstein coefficients for both halves, times 2**degree (de Casteljau)."""
    degree = len(row) - 1
    early, late = [row[0] << degree], [row[-1] << degree]
    for n in range(degree - 1, -1, -1):
        row = [a + b for a, b in pairwise(row)]
        early.append(row[0] << n)
        late.append(row[-1] << n)
    return early, late[::-1]
