"""The bounds of LEQT1F's errors: a theorem bounds them where its hypotheses hold."""

import math
from typing import Any

import pytest

from pyharness.checks.theory.collocation_matrices import solved
from pyharness.model import extension


def test_a_theorem_bounds_errors_only_where_its_hypotheses_hold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
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
