"""Predicted truncation and rounding errors at the end of a run with fixed steps.

The state-transition matrix propagates the steps' errors to the end. Truncation errors come from
`schemes`.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from pyharness.checks.theory.collocation_matrices import PARTS, singular_below, solver_roundings
from pyharness.checks.theory.conditioning import ROUNDING, Conditioning, conditioning, sampled
from pyharness.checks.theory.schemes import SCHEMES, TERMS, collocation_singular, local_error
from pyharness.engine.methods.linearised import jacobians, propagators
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

_FEWEST_NODES, _MOST_NODES = 200, 20_000
# Mean rounding error of a step, as an assumed fraction of the largest. Independent errors add up
# like the square root of their number.
_MEAN_ROUNDING = 1.0 / 3.0
# Largest accepted ratio of the last term of a power series to its sum.
_CONVERGED = 1e-3
FORECAST = Basis(
    "derived",
    "error at the end of a run with a fixed step",
    "twice the propagated local errors, whose power series is truncated, and rounding errors "
    "(`theory/step_errors.py`)",
)
"""Basis of `bound` of a `Forecast`."""


@dataclass(frozen=True, eq=False)
class Path:
    """A scene's solution, with the final omega's sensitivity to earlier perturbations."""

    scene: Scene  # with constant torque
    times: Array  # shape (n,), s: from 0 to the end
    omega: Array  # shape (n, 3), rad/s
    propagators: Array  # shape (n, 3, 3): state-transition matrices from each time to the end
    flow: Conditioning  # sensitivity of omega at the end
    turned: float  # integral over time of the Jacobian's row-sum norm
    fastest: float  # largest row-sum norm of the Jacobian (1/s)

    @property
    def norms(self) -> Array:
        """The row-sum norms of `propagators`, shape (n,)."""
        return np.asarray(np.abs(self.propagators).sum(axis=2).max(axis=1))

    def over_time(self, values: Array) -> Array:
        """Return the integral over time (s) of `values`, which has a row for each time."""
        return np.asarray(np.trapezoid(values, self.times, axis=0))


@dataclass(frozen=True)
class Forecast:
    """Predicted final errors of a fixed-step run, relative to the largest omega."""

    truncation: float  # expected truncation error, largest of the components
    # Bound on the sum of truncation and rounding error, infinite for too large steps.
    bound: float
    rounding: float  # bound on the rounding error
    wandering: float  # expected rounding error if the steps' errors are independent


def path(scene: Scene, time: float) -> Path:
    from pyharness.engine.solve import solve

    flow = conditioning(scene, time)

    def sample(times: Array) -> tuple[float, tuple[Array, Array]]:
        omega = np.vstack([scene.omega, solve(scene, times[1:].tolist(), "taylor", 1e-13).omega])
        speeds = np.abs(jacobians(scene, omega)).sum(axis=2).max(axis=1)
        return float(speeds.max()), (omega, speeds)

    times, (omega, speeds) = sampled(sample, time, _FEWEST_NODES, _MOST_NODES)
    turned, fastest = float(np.trapezoid(speeds, times)), float(speeds.max())
    return Path(scene, times, omega, propagators(scene, times, omega), flow, turned, fastest)


class Forecaster:
    def __init__(self, along: Path, method: str) -> None:
        self._path = along
        self.method = SCHEMES[method]
        self._missed = cache(self._series)
        # Mean relative final error from the rounding of one step. Components that never change have
        # no rounding error.
        changes = (self._rates() != 0.0).any(axis=0)
        carried = along.propagators * (along.omega * changes)[:, None, :]
        squares = along.over_time(np.square(carried).sum(axis=2)) / float(along.times[-1])
        size = math.sqrt(float(squares.max())) / along.flow.largest
        self._wandering = _MEAN_ROUNDING * ROUNDING * self.method.roundings * size

    def predict(self, steps: int) -> Forecast:
        here = self._path
        h = float(here.times[-1]) / steps
        largest = here.flow.largest
        singular = self.method.name in PARTS and h <= singular_below(self.method.name)
        order = 1 if singular else self.method.order
        terms = self._missed(singular) * (h ** np.arange(TERMS))[:, None, None]
        local = terms.sum(axis=0)
        carried = np.einsum("nij,nj->ni", here.propagators, local)
        truncation = float(np.abs(here.over_time(carried)).max()) / h / largest
        worst = float(here.over_time(here.norms * np.abs(local).max(axis=1))) / h / largest
        last = float(np.abs(terms[-1]).max())
        known = last <= _CONVERGED * float(np.abs(local).max())
        # Later steps do not start on the exact solution, so that errors and amplification may be
        # larger; the bound allows for a factor of 2.
        off = 2.0 * worst * (here.turned + 2.0 * (order + 2))
        if not (known and off <= math.log(2.0)):
            worst = math.inf
        norms, mean = here.norms, float(here.over_time(here.norms)) / float(here.times[-1])
        rounding = here.flow.rounding + self.method.roundings * ROUNDING * steps * mean
        if self.method.name in PARTS:
            rates = self._rates()
            constant, varying = solver_roundings(self.method.name)
            travelled = float(here.over_time(norms * np.abs(rates).max(axis=1))) / largest
            # Bound on the relative change of the right-hand sides in a step.
            differing = min(1.0, h * here.fastest)
            rounding += ROUNDING * travelled * (constant + varying * differing)
        wandering = self._wandering * math.sqrt(steps)
        return Forecast(truncation, 2.0 * worst + rounding, rounding, wandering)

    def crossing(self, smallest: float) -> float:
        """Return the step size (s) below which expected rounding exceeds the truncation error."""
        time = float(self._path.times[-1])
        high = max(1, math.floor(time / smallest))
        low = 1
        while high > low + 1:
            middle = min(max(round(math.sqrt(low * high)), low + 1), high - 1)
            found = self.predict(middle)
            is_above = found.truncation > found.wandering
            low, high = (middle, high) if is_above else (low, middle)
        return time / high

    def _rates(self) -> Array:
        on = self._path.scene.right_hand_side()
        return np.array([on(0.0, omega) for omega in self._path.omega.tolist()])

    def _series(self, singular: bool) -> Array:
        scheme, order = self.method.scheme, self.method.order
        if singular:
            scheme, order = collocation_singular(self.method.name), 1
        missed = local_error(scheme, self._path.scene, self._path.omega)
        # By the scheme's order, these terms are zero except for rounding.
        missed[: order + 1] = 0.0
        return missed
