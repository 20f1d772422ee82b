"""The bounds of LEQT1F's errors: a theorem bounds them where its hypotheses hold."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import lu

from pyharness.checks.theory.collocation_matrices import PARTS, solved, solver_roundings
from pyharness.model import extension
from tests.conftest import Patch


def test_a_theorem_bounds_errors_only_where_its_hypotheses_hold(monkeypatch: Patch) -> None:
    assert solved("four-term", 1e-2).residual <= 1.0
    compiled = extension.extension()

    class Wrong:
        """The compiled solver, whose factors are changed after the solution."""

        def __init__(self, change: Any) -> None:
            """Store the function that changes the factors."""
            self.change = change

        def solve_linear(self, *given: Any) -> tuple[Any, ...]:
            """Return changed factors with the solution and the error code."""
            factors, *rest = compiled.solve_linear(*given)
            return self.change(factors.copy()), *rest

    # A factor that is wrong by 1e-12, and one outside the range in which nothing underflows.
    def off(factors: Any) -> Any:
        factors[-1, -1] *= 1.0 + 1e-12
        return factors

    def tiny(factors: Any) -> Any:
        factors[-1, -1] = 1e-60
        return factors

    for change in (off, tiny):
        monkeypatch.setattr(extension, "extension", lambda change=change: Wrong(change))
        found = solved("four-term", 1e-2)
        assert (found.residual, found.forward, found.increment) == (math.inf,) * 3


@pytest.mark.parametrize("program", PARTS)
def test_bounds_follow_from_the_factors_that_scipy_finds(program: str) -> None:
    step = 1e-3
    times = step * np.array([float(part) for part in PARTS[program]])
    order = np.arange(len(times))
    powers, possible = 3 * len(times) * step**order, []
    # Two pivots of four terms are equal but for rounding; LAPACK chooses one or the other.
    for row in range(len(times)):
        matrix = (order + 1) * times[:, None] ** order  # of the derivatives of t, t**2, ...
        matrix[row, 2:] *= 1.0 + 1e-12
        exchanged, lower, upper = lu(matrix)
        reach = abs(np.linalg.inv(matrix))
        sizes = reach @ exchanged @ abs(lower) @ abs(upper)
        possible.append((powers @ sizes[:, 0], powers @ (sizes @ reach).sum(axis=1)))
    found = pytest.approx(solver_roundings(program), rel=1e-9)
    assert any(each == found for each in possible), possible
