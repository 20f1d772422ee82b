"""Ten textbook problems for `scipy.integrate.solve_ivp`, and their solutions."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from tests.engine.independent import step_of

MASS_RATIO = 0.012277471  # of the moon to the earth and moon
CHAIN = 30  # bodies


@dataclass(frozen=True)
class Problem:
    """An initial value problem y' = fun(t, y), from time 0 to `end`."""

    name: str
    fun: Callable[[Any, Any], Any]
    y0: tuple[float, ...]
    end: float


def lorenz(t: Any, y: Any) -> Any:
    """Return the Lorenz equations (Lorenz 1963, Journal of the Atmospheric Sciences 20)."""
    return np.array([10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3])


def kepler(t: Any, y: Any) -> Any:
    """Return the motion of a planet in its plane."""
    r2 = y[0] ** 2 + y[1] ** 2
    return np.array([y[2], y[3], -y[0] / (r2 * np.sqrt(r2)), -y[1] / (r2 * np.sqrt(r2))])


def arenstorf(t: Any, y: Any) -> Any:
    """Return the restricted three-body problem (Hairer, Norsett and Wanner 1993, II.0)."""
    mu, nu = MASS_RATIO, 1.0 - MASS_RATIO
    first = (y[0] + mu) ** 2 + y[1] ** 2
    second = (y[0] - nu) ** 2 + y[1] ** 2
    a, b = nu / (first * np.sqrt(first)), mu / (second * np.sqrt(second))
    return np.array([
        y[2], y[3],
        y[0] + 2 * y[3] - a * (y[0] + mu) - b * (y[0] - nu),
        y[1] - 2 * y[2] - a * y[1] - b * y[1],
    ])  # fmt: skip


def van_der_pol(t: Any, y: Any) -> Any:
    """Return Van der Pol's oscillator with the parameter 5."""
    return np.array([y[1], 5 * (1 - y[0] ** 2) * y[1] - y[0]])


def pendulum(t: Any, y: Any) -> Any:
    return np.array([y[1], -np.sin(y[0])])


def brusselator(t: Any, y: Any) -> Any:
    """Return the Brusselator (Hairer, Norsett and Wanner 1993, I.16)."""
    product = y[0] ** 2 * y[1]
    return np.array([1 + product - 4 * y[0], 3 * y[0] - product])


def chain(t: Any, y: Any) -> Any:
    """Return a chain of bodies and springs with a cubic term, between two walls."""
    x, v = y[:CHAIN], y[CHAIN:]
    zero = 0 * x[:1]
    stretch = np.concatenate([x, zero]) - np.concatenate([zero, x])
    force = stretch + stretch**3 / 4
    return np.concatenate([v, force[1:] - force[:-1]])


def henon_heiles(t: Any, y: Any) -> Any:
    """Return the Henon-Heiles system (1964, Astronomical Journal 69)."""
    return np.array([y[2], y[3], -y[0] - 2 * y[0] * y[1], -y[1] - y[0] ** 2 + y[1] ** 2])


def predator_and_prey(t: Any, y: Any) -> Any:
    """Return the Lotka-Volterra equations with a season."""
    season = 1 + np.cos(t) / 4
    return np.array([y[0] * (season - y[1]), y[1] * (y[0] - 1)])


def pleiades(t: Any, y: Any) -> Any:
    """Return seven stars in a plane (Hairer, Norsett and Wanner 1993, II.10)."""
    x, z = y[:7], y[7:14]
    rates = []
    for one in (x, z):
        for i in range(7):
            total = 0
            for j in range(7):
                if j != i:
                    r2 = (x[i] - x[j]) ** 2 + (z[i] - z[j]) ** 2
                    total = total + (j + 1) * (one[j] - one[i]) / (r2 * np.sqrt(r2))
            rates.append(total)
    return np.concatenate([y[14:], np.array(rates)])


PROBLEMS = (
    Problem("Lorenz", lorenz, (1.0, 1.0, 1.0), 10.0),
    Problem("Kepler, eccentricity 0.6", kepler, (0.4, 0.0, 0.0, 2.0), 60.0),
    Problem(
        "Arenstorf orbit", arenstorf, (0.994, 0.0, 0.0, -2.00158510637908252240537862224), 17.0
    ),
    Problem("Van der Pol", van_der_pol, (2.0, 0.0), 30.0),
    Problem("pendulum", pendulum, (3.0, 0.0), 50.0),
    Problem("Brusselator", brusselator, (1.5, 3.0), 20.0),
    Problem(f"chain of {CHAIN} bodies", chain, (1.0,) + (0.0,) * (2 * CHAIN - 1), 30.0),
    Problem("Henon-Heiles", henon_heiles, (0.1, 0.2, 0.3, 0.2), 50.0),
    Problem("predator and prey", predator_and_prey, (1.5, 0.5), 40.0),
    Problem(
        "Pleiades", pleiades,
        (3.0, 3.0, -1.0, -3.0, 2.0, -2.0, 2.0, 3.0, -3.0, 2.0, 0.0, 0.0, -4.0, 4.0,
         0.0, 0.0, 0.0, 0.0, 0.0, 1.75, -1.5, 0.0, 0.0, 0.0, -1.25, 1.0, 0.0, 0.0), 2.0,
    ),
)  # fmt: skip


@cache
def solution(problem: Problem) -> tuple[float, ...]:
    """Return the state at the end, by extrapolation with 64-bit significands.

    Raise ArithmeticError if two results with different steps differ by more than 1e-11.
    """
    found, other = (_integrated(problem, local) for local in (1e-18, 1e-17))
    difference = float(np.abs(found - other).max() / np.abs(found).max())
    if not difference <= 1e-11:
        raise ArithmeticError(f"{problem.name}: results differ by {difference:.1e}")
    return tuple(found.astype(float).tolist())


def _integrated(problem: Problem, local: float) -> Any:
    """Return the state at the end, with relative errors below `local` in each step."""
    y, end = np.array(problem.y0, dtype=np.longdouble), np.longdouble(problem.end)
    t, h = 0 * end, end / 1024
    while t < end:
        h = min(h, end - t)
        found, columns = step_of(problem.fun, t, y, h, np.inf, local)
        if found is not None:
            t, y = t + h, found
        h = h * (0.5 if found is None else 0.8 if columns > 9 else 1.4 if columns < 8 else 1.0)
    return y
