"""Tests of polynomials through values at Chebyshev points."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from pyharness.model.dense_output import nodes, points, to_coefficients


@pytest.mark.parametrize("count", [2, 3, 4, 9, 16, 33])
def test_coefficients_are_those_of_the_polynomial_through_the_values(count: int) -> None:
    at = points(count)
    assert (at[0], at[-1]) == (-1.0, 1.0)
    np.testing.assert_allclose(
        at, np.cos(np.pi * np.arange(count - 1, -1, -1) / (count - 1)), atol=1e-15
    )
    np.testing.assert_array_equal(at, -at[::-1])
    wanted = np.random.default_rng(count).normal(size=count)
    found = to_coefficients(count) @ chebyshev.chebval(at, wanted)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=4e-15 * np.abs(wanted).sum())


def test_nodes_begin_and_end_at_the_ends_of_the_intervals() -> None:
    low, high = np.array([0.1, -3.0]), np.array([0.3, 7.7])
    found = nodes(low, high, points(5))
    assert (found[:, 0].tolist(), found[:, -1].tolist()) == (low.tolist(), high.tolist())
    np.testing.assert_allclose(found[:, 2], [0.2, 2.35])
    assert (np.diff(found, axis=1) > 0.0).all()
