"""The stand-in for LEQT1F: Fortran and twin agree bit for bit, and solve as a solver must."""

import numpy as np
import pytest

from pyharness.model.extension import extension
from pyharness.thesis.linear_solver import SINGULAR, leqt1f


def _both(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, int]:
    """Solve in both languages, require the same bits, and return the solution and IER."""
    _, compiled, ier = extension().solve_linear(np.asfortranarray(a), np.asfortranarray(b))
    columns, twin_ier = leqt1f(a.tolist(), b.T.tolist())
    assert ier == twin_ier
    np.testing.assert_array_equal(compiled, np.array(columns).T)
    return compiled, ier


@pytest.mark.bitwise
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8])
def test_random_unsymmetric_systems(n: int) -> None:
    """Unsymmetric matrices show a transposed index; each has several right-hand sides."""
    generator = np.random.default_rng(n)
    for _ in range(200):
        a = generator.normal(size=(n, n)) * 10.0 ** generator.integers(-3, 4, size=(n, 1))
        b = generator.normal(size=(n, 6))
        x, ier = _both(a, b)
        assert ier == 0
        bound = 1e-13 * np.linalg.cond(a / np.abs(a).max(axis=1, keepdims=True))
        np.testing.assert_allclose(x, np.linalg.solve(a, b), rtol=0, atol=bound * np.abs(x).max())


@pytest.mark.parametrize("a", [
    [[1.0, 2.0], [2.0, 4.0]],
    [[0.0, 0.0], [1.0, 1.0]],
    [[1.0, 1e-17], [1.0, 0.0]],
    # n + pivot must differ from n = 2, whose neighbour above is 4.4e-16 away.
    [[1.0, 1.0], [1.0, 1.0 + 2.220446049250313e-16]],
], ids=range(4))  # fmt: skip
def test_singular_matrix_leaves_the_right_hand_sides(a: list[list[float]]) -> None:
    b = np.array([[1.0, 2.0], [3.0, 4.0]])
    x, ier = _both(np.array(a), b)
    assert ier == SINGULAR
    np.testing.assert_array_equal(x, b)
    # A pivot just above the working precision is not singular.
    assert _both(np.array([[1.0, 1.0], [1.0, 1.0 + 1e-15]]), np.ones((2, 1)))[1] == 0


def test_rows_are_scaled_and_the_first_of_equal_maxima_is_the_pivot() -> None:
    """Without scaling, row 2 would be the pivot and the small solution would be lost."""
    x, _ = _both(np.array([[1.0, 1.0], [1e10, 1e25]]), np.array([[2.0], [1e25]]))
    np.testing.assert_allclose(x[:, 0], [1.0, 1.0], rtol=1e-14)
    # No exchange of equal candidates: the factors show which row was taken.
    equal = np.asfortranarray([[3.0, 1.0], [-3.0, 2.0]])
    factors, _, _ = extension().solve_linear(equal, np.ones((2, 1), order="F"))
    np.testing.assert_array_equal(factors, [[3.0, 1.0], [-1.0, 3.0]])
