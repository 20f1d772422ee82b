"""Bodies at rest, whose first step must guess the size of omega, against closed forms."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, prepare, solve, solve_many

OfTime = Callable[[Any], Any]
_MOMENTS = (1.0, 2.0, 3.0)


def check(omega: OfTime, rate: OfTime, end: float, tolerance: float) -> None:
    """Compare omega about the third axis, and an own state with the same rate."""
    times = np.linspace(0.0, end, 41)[1:]
    size = np.abs(omega(np.linspace(0.0, end, 2001))).max()
    plain = Scene("rest", (0, 0, 0), _MOMENTS, torque=lambda t, w: (0 * t, 0 * t, 3 * rate(t)))
    own = Scene("own", (0, 0, 1), _MOMENTS, states={"x": 0.0},
                torque=lambda t, w, states: (0 * w, {"x": rate(t)}))  # fmt: skip
    for scene, unknown in ((plain, 2), (own, 3)):
        found: Any = solve(scene, times, tolerance=tolerance, dense_output=True)
        for rows in (found.y, found.sol(times)):
            assert np.abs(rows[unknown] - omega(times)).max() <= tolerance * size, scene
    rows = [prepare(plain, tolerance=tolerance)(plain.omega, end)]
    rows += [solve_many([plain] * 3, end, tolerance=tolerance).omega[1]]
    assert np.array(rows)[:, 2] == pytest.approx(float(omega(end)), rel=0.0, abs=tolerance * size)


@pytest.mark.parametrize(("a", "n", "end", "tolerance"), [
    (3.0, 16, 2.6, 1.1e-6), (3.1, 13, 2.9, 4.3e-6), (3.9, 14, 2.7, 7.2e-5),
    (4.5, 21, 1.7, 2.6e-6), (10.9, 8, 1.5, 1.15e-4),
])  # fmt: skip
def test_terms_that_cancel_do_not_make_omega_large(
    a: float, n: int, end: float, tolerance: float
) -> None:
    def rate(t: Any) -> Any:
        x = 1 - t / 2
        return a * np.cos(a * t) * x**n - n / 2 * np.sin(a * t) * x ** (n - 1)

    check(lambda t: np.sin(a * t) * (1 - t / 2) ** n, rate, end, tolerance)


@pytest.mark.parametrize(("switched", "push", "size", "a", "end", "tolerance"), [
    (3.4e-3, 0.11, 1.0, 24.1, 5.14, 5.6e-4), (1.2e-3, 24.0, 0.5, 16.3, 4.84, 1.3e-6),
    (1.7e-3, 21.0, 0.3, 9.2, 5.1, 1.1e-3), (1.6e-3, 0.15, 0.7, 19.1, 3.88, 5.8e-4),
])  # fmt: skip
def test_a_push_that_a_switch_ends_does_not_make_omega_large(
    switched: float, push: float, size: float, a: float, end: float, tolerance: float
) -> None:
    reached = push * switched

    def omega(t: Any) -> Any:
        later = t - switched
        return np.where(
            later < 0, push * t, reached * (1 + size * np.sin(a * later) * np.exp(-later))
        )

    def rate(t: Any) -> Any:
        later = t - switched
        wave = (a * np.cos(a * later) - np.sin(a * later)) * np.exp(-later)
        return np.where(later < 0, push, reached * size * wave)

    check(omega, rate, end, tolerance)
