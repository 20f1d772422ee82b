"""Heavy tops: the solution of Lagrange, and the integrals of Kovalevskaya and Chaplygin."""

from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import Scene, solve

WEIGHT = 1.5  # times the distance of the centre of mass from the fixed point, N m
ATTITUDE = (0.85, 0.45, 0.2, 0.1)


def _vertical(q: Any) -> Any:
    w, x, y, z = q
    return np.array([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z])


def _top(moments: Any, arm: Any, omega: Any, attitude: Any = ATTITUDE) -> Scene:
    def gravity(t: Any, omega: Any, q: Any) -> Any:
        return -WEIGHT * np.cross(arm, _vertical(q))

    return Scene("top", omega, moments=moments, torque=gravity, attitude=attitude)


def _solved(scene: Scene, end: float, tolerance: float) -> tuple[Any, Any]:
    found: Any = solve(scene, np.linspace(0.0, end, 101), tolerance=tolerance, attitude=True)
    assert found.has_all_rows
    return found.omega.T, _vertical(found.attitude.T)


def test_cosine_of_the_tilt_is_that_of_the_elliptic_solution() -> None:
    """A spinning top that is released falls from its largest cosine (Whittaker, section 71)."""
    a, c, spin, tilt = 2.0, 1.0, 4.0, 0.9
    scene = _top((a, a, c), (0, 0, 1), (0, 0, spin), (np.cos(tilt / 2), np.sin(tilt / 2), 0, 0))
    _, vertical = _solved(scene, 20.0, 1e-12)
    u0 = float(np.cos(tilt))
    along, beta = c * spin / a, 2.0 * WEIGHT / a
    # u'^2 = beta (u0 - u) (1 - u^2) - along^2 (u0 - u)^2 has the other roots:
    lowest, highest = sorted(float(x) for x in np.roots([beta, -(along**2), along**2 * u0 - beta]))
    modulus = (u0 - lowest) / (highest - lowest)
    rate = mpmath.sqrt(beta * (highest - lowest)) / 2
    quarter = mpmath.ellipk(modulus)
    wanted = [
        float(lowest + (u0 - lowest) * mpmath.ellipfun("sn", quarter + rate * t, m=modulus) ** 2)
        for t in np.linspace(0.0, 20.0, 101)
    ]
    assert vertical[2] == pytest.approx(wanted, abs=2e-12)


def test_integral_of_kovalevskaya_is_kept() -> None:
    omega, g = _solved(_top((2.0, 2.0, 1.0), (1, 0, 0), (0.7, 0.3, 0.9)), 20.0, 1e-15)
    x, y, _ = omega
    kept = np.abs((x + 1j * y) ** 2 - WEIGHT * (g[0] + 1j * g[1])) ** 2
    assert np.abs(kept / kept[0] - 1.0).max() < 2e-14


def test_integral_of_goryachev_and_chaplygin_is_kept() -> None:
    up = _vertical(np.array(ATTITUDE) / np.linalg.norm(ATTITUDE))
    level = -4.0 * (0.7 * up[0] + 0.3 * up[1]) / up[2]
    (x, y, z), g = _solved(_top((4.0, 4.0, 1.0), (1, 0, 0), (0.7, 0.3, level)), 20.0, 1e-15)
    kept = z * (x * x + y * y) - WEIGHT * x * g[2]
    assert np.abs(kept / kept[0] - 1.0).max() < 2e-14
