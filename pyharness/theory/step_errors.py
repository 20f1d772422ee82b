"""What a step size costs, foretold: truncation and rounding of fixed steps at the end of a scene.

Truncation is what each step misses (`schemes`), carried to the end by the flow; rounding is that
of each step, carried likewise. No method is run.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from pyharness.methods.linearised import jacobians, propagators
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.theory.collocation_matrices import PARTS, singular_below, solver_roundings
from pyharness.theory.conditioning import ROUNDING, Conditioning, conditioning
from pyharness.theory.schemes import SCHEMES, TERMS, collocation_singular, local_error

_NODES_PER_RADIAN = 12.0
_FEWEST_NODES, _MOST_NODES = 200, 20_000
# Roundings of many steps in directions of their own add up as their root; a third of the worst
# one is the mean.
_MEAN_ROUNDING = 1.0 / 3.0
# What the last term kept of a series may be of the whole.
_CONVERGED = 1e-3


@dataclass(frozen=True, eq=False)
class Path:
    """The solution, and what the flow makes until the end of an error made on the way.

    Attributes
    ----------
    scene : Scene
        Torque constant.
    times : ndarray, shape (n,)
        s, from 0 to the end.
    omega : ndarray, shape (n, 3)
        rad/s.
    propagators : ndarray, shape (n, 3, 3)
        From each time to the end.
    flow : Conditioning
        Of the same scene and time.
    turned : float
        Integral over time of the largest row sum of the Jacobian.
    fastest : float
        Largest of these row sums (1/s).
    """

    scene: Scene
    times: Array
    omega: Array
    propagators: Array
    flow: Conditioning
    turned: float
    fastest: float

    @property
    def norms(self) -> Array:
        """Row-sum norms of the propagators."""
        return np.asarray(np.abs(self.propagators).sum(axis=2).max(axis=1))

    def over_time(self, values: Array) -> Array:
        """Return the integral of values along the first axis."""
        return np.asarray(np.trapezoid(values, self.times, axis=0))


@dataclass(frozen=True)
class Forecast:
    """Errors at the end over the largest omega.

    Attributes
    ----------
    truncation : float
        To be expected; the largest component.
    bound : float
        Of truncation and rounding; infinite where steps are too large to say.
    rounding : float
        Of rounding alone, at the worst.
    wandering : float
        Rounding to be expected.
    """

    truncation: float
    bound: float
    rounding: float
    wandering: float


def path(scene: Scene, time: float) -> Path:
    """Follow the solution and its linearised flow.

    Raises
    ------
    InputError
        Where the solution leaves every bound before `time` (s).
    """
    from pyharness.methods.solve import solve

    flow = conditioning(scene, time)
    count = _FEWEST_NODES
    while True:
        times = np.linspace(0.0, time, count + 1)
        omega = np.vstack([scene.omega, solve(scene, times[1:].tolist(), "taylor", 1e-13).omega])
        speeds = np.abs(jacobians(scene, omega)).sum(axis=2).max(axis=1)
        wanted = math.ceil(float(speeds.max()) * time * _NODES_PER_RADIAN)
        if count >= min(wanted, _MOST_NODES):
            break
        count = min(wanted, _MOST_NODES)
    turned = float(np.trapezoid(speeds, times))
    return Path(
        scene, times, omega, propagators(scene, times, omega), flow, turned, float(speeds.max())
    )


class Forecaster:
    """Forecasts for one method on one path, at any step."""

    def __init__(self, along: Path, method: str) -> None:
        """Take the path and a name in `pyharness.theory.schemes.SCHEMES`."""
        self._path = along
        self.method = SCHEMES[method]
        self._missed = cache(self._series)
        self._wandering = self._of_one_step()

    def at(self, steps: int) -> Forecast:
        """Return the forecast for a number of equal steps."""
        here = self._path
        h = float(here.times[-1]) / steps
        largest = here.flow.largest
        singular = self.method.name in PARTS and h <= singular_below(self.method.name)
        order, missed = (1, self._missed(True)) if singular else (
            self.method.order, self._missed(False),
        )  # fmt: skip
        terms = missed * (h ** np.arange(TERMS))[:, None, None]
        local = terms.sum(axis=0)
        carried = np.einsum("nij,nj->ni", here.propagators, local)
        truncation = float(np.abs(here.over_time(carried)).max()) / h / largest
        worst = float(here.over_time(here.norms * np.abs(local).max(axis=1))) / h / largest
        last = float(np.abs(terms[-1]).max())
        known = last <= _CONVERGED * float(np.abs(local).max())
        # Off the solution by so much, steps miss more and the flow carries further: by no more
        # than twice, or nothing is said.
        off = 2.0 * worst * (here.turned + 2.0 * (order + 2))
        if not (known and off <= math.log(2.0)):
            worst = math.inf
        rounding = self._rounding(h, steps)
        wandering = self._wandering * math.sqrt(steps)
        return Forecast(truncation, 2.0 * worst + rounding, rounding, wandering)

    def crossing(self, smallest: float) -> float:
        """Return the step (s) at which expected truncation falls below expected rounding.

        No less than `smallest`.
        """
        time = float(self._path.times[-1])
        high = max(1, math.floor(time / smallest))
        low = 1
        while high > low + 1:
            middle = round(math.sqrt(low * high))
            middle = min(max(middle, low + 1), high - 1)
            found = self.at(middle)
            if found.truncation > found.wandering:
                low = middle
            else:
                high = middle
        return time / high

    def _of_one_step(self) -> float:
        """Return the mean rounding of a step at the end, over the largest omega.

        Each omega is rounded in proportion to itself, and not at all where it never changes.
        """
        here = self._path
        changes = (self._rates() != 0.0).any(axis=0)
        carried = here.propagators * (here.omega * changes)[:, None, :]
        squares = here.over_time(np.square(carried).sum(axis=2)) / float(here.times[-1])
        size = math.sqrt(float(squares.max())) / here.flow.largest
        return _MEAN_ROUNDING * ROUNDING * self.method.roundings * size

    def _rates(self) -> Array:
        on = self._path.scene.right_hand_side()
        return np.array([on(0.0, omega) for omega in self._path.omega.tolist()])

    def _rounding(self, h: float, steps: int) -> float:
        here = self._path
        norms, largest = here.norms, here.flow.largest
        mean = float(here.over_time(norms)) / float(here.times[-1])
        total = here.flow.rounding + self.method.roundings * ROUNDING * steps * mean
        if self.method.name in PARTS:
            rates = self._rates()
            constant, varying = solver_roundings(self.method.name)
            travelled = float(here.over_time(norms * np.abs(rates).max(axis=1))) / largest
            # Along a step the rates differ from the first one by so much of themselves.
            differing = min(1.0, h * here.fastest)
            total += ROUNDING * travelled * (constant + varying * differing)
        return total

    def _series(self, singular: bool) -> Array:
        here = self._path
        scheme, order = self.method.scheme, self.method.order
        if singular:
            scheme, order = collocation_singular(self.method.name), 1
        missed = local_error(scheme, here.scene, here.omega)
        # Zero by the order of the scheme; what stands there is rounding.
        missed[: order + 1] = 0.0
        return missed
