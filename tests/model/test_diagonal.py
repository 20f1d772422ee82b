"""Principal moments and axes to a high relative accuracy, checked without rounding."""

import itertools
import math
import random
from fractions import Fraction

import numpy as np
import pytest

from pyharness import Scene
from pyharness.model.inertia import Matrix, diagonalised, principal_frame

_ACCURATE = Fraction(1, 1 << 100)


def _symmetric(a: float, b: float, c: float, d: float, e: float, f: float) -> Matrix:
    return (a, b, c), (b, d, e), (c, e, f)


def _tilted(source: random.Random, values: list[float], power: float = 0.0) -> Matrix:
    """Return a matrix about tilted axes with some moments, times a random factor."""
    turn, _ = np.linalg.qr([[source.gauss(0.0, 1.0) for _ in range(3)] for _ in range(3)])
    matrix = turn @ np.diag(values) @ turn.T * 10.0 ** source.uniform(-power, power)
    (a, b, c), (_, d, e), (_, _, f) = matrix.tolist()
    return _symmetric(a, b, c, d, e, f)


def _drawn(source: random.Random) -> Matrix:
    """Return a matrix about tilted axes, whose moments may differ as much as 1 and 1e-15."""
    values = [10.0 ** -source.uniform(0.0, 15.0), 1.0, 1.0 + 10.0 ** -source.uniform(0.0, 16.0)]
    source.shuffle(values)
    return _tilted(source, values, 5.0)


@pytest.mark.parametrize("matrix", [
    *(_drawn(random.Random(f"diagonal/{k}")) for k in range(30)),
    _symmetric(1.0, 5e-324, 0.0, 1.0, 0.0, 1e-200),
    _symmetric(1e308, 1e292, 0.0, 1.0, 0.0, 1e300),
    _symmetric(2.0, 1.0, 1.0, 2.0, 1.0, 2.0),
    _symmetric(3.0, 0.0, 0.0, 1.0, 0.0, 2.0),
])  # fmt: skip
def test_each_eigenvalue_is_good_to_its_own_size(matrix: Matrix) -> None:
    values, vectors = diagonalised(matrix)
    exact = [[Fraction(x) for x in row] for row in matrix]
    least = min(map(abs, values))
    for value, vector in zip(values, vectors, strict=True):
        for row, x in zip(exact, vector, strict=True):
            rest = sum((a * v for a, v in zip(row, vector, strict=True)), -value * x)
            # For a symmetric matrix, `value` is at most this far from an eigenvalue.
            assert abs(rest) <= _ACCURATE * least
    for i, j in itertools.product(range(3), repeat=2):
        product = sum((x * y for x, y in zip(vectors[i], vectors[j], strict=True)), Fraction(0))
        assert abs(product - (i == j)) <= _ACCURATE


def test_a_diagonal_matrix_is_returned_as_it_is() -> None:
    values, vectors = diagonalised(_symmetric(3.0, 0.0, 0.0, 1e-300, 0.0, 2e300))
    assert values == (Fraction(3), Fraction(1e-300), Fraction(2e300))
    assert [list(map(float, each)) for each in vectors] == np.eye(3).tolist()


def test_the_moments_are_rounded_to_nearest_and_the_axes_are_a_frame() -> None:
    for k in range(40):
        frame = principal_frame(_drawn(random.Random(f"frame/{k}")))
        parts = frame.exact_moments, frame.moments, frame.moments_low
        for exact, high, low in zip(*parts, strict=True):
            assert high == float(exact)
            assert abs(exact - Fraction(high) - Fraction(low)) <= Fraction(1, 1 << 104) * abs(exact)
        assert frame.axes.T @ frame.axes == pytest.approx(np.eye(3), abs=4e-16)
        assert np.linalg.det(frame.axes) == pytest.approx(1.0)


def test_a_thin_body_is_seen_without_rounding() -> None:
    thin = _symmetric(1.0, 1.0 - 2.0**-53, 0.0, 1.0, 0.0, 1.0)
    assert min(principal_frame(thin).moments) == 2.0**-53


def test_a_flat_body_about_tilted_axes_is_possible() -> None:
    source = random.Random("flat")
    for _ in range(50):
        first, second = source.uniform(0.1, 1.0), source.uniform(0.1, 1.0)
        for excess, is_impossible in ((0.0, False), (1e-13, True)):
            values = [first, second, (first + second) * (1.0 + excess)]
            scene = Scene("", (1.0, 2.0, 3.0), inertia=_tilted(source, values))
            assert scene.is_impossible is is_impossible


def test_moments_beyond_the_range_of_numbers_are_infinite() -> None:
    moments = principal_frame(_symmetric(1.7e308, 1e308, 0.0, 1.7e308, 0.0, 1.0)).moments
    assert sorted(moments)[2] == math.inf
