"""Dense output: the solution as a function of time, by polynomials through Chebyshev points.

Source: Trefethen 2013, Approximation Theory and Approximation Practice, chapters 2 to 5.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Array
from pyharness.model.arrays import numbers_of
from pyharness.model.codes import Storage
from pyharness.model.errors import InputError
from pyharness.model.extension import extension


def points(count: int) -> Array:
    """Return ascending Chebyshev points of the second kind, symmetric to the last bit."""
    found: Array = np.sin(np.pi * np.arange(1 - count, count, 2) / (2 * (count - 1)))
    return found


def to_coefficients(count: int) -> Array:
    """Return the matrix that maps values at the `points` to Chebyshev coefficients."""
    # Angles up to pi have the smallest rounding errors.
    turns = np.outer(np.arange(count), np.arange(count)[::-1]) % (2 * count - 2)
    angles = np.pi * np.minimum(turns, 2 * count - 2 - turns) / (count - 1)
    weights = np.full(count, 2.0 / (count - 1))
    weights[[0, -1]] /= 2.0
    matrix: Array = np.cos(angles) * weights
    matrix[[0, -1]] /= 2.0
    return matrix


def nodes(low: Array, high: Array, at: Array) -> Array:
    """Return the points `at`, from -1 to 1, mapped to n intervals, as n rows."""
    middle, half = 0.5 * low + 0.5 * high, 0.5 * high - 0.5 * low
    found: Array = middle[:, None] + half[:, None] * at
    found[:, 0], found[:, -1] = low, high
    return found


NODES = Storage.AT_ONCE + 1  # number of nodes of a polynomial
POINTS = points(NODES)
TO_COEFFICIENTS = to_coefficients(NODES)
_ROUNDED = 4.0  # units in the last place by which a time such as n*dt may exceed an end


@dataclass(frozen=True, eq=False)
class Pieces:
    """A function of time with m components: polynomials on p intervals."""

    edges: Array  # shape (p + 1,), s; the ends of the intervals, ascending
    values: Array  # shape (p, NODES, m), at the Chebyshev points of the intervals

    def __call__(self, times: Array) -> Array:
        """Return the values at `times` (s), shape (n, m)."""
        edges, columns = self.contiguous
        found: Array = extension().states_at(edges, POINTS, columns, times).T
        return found

    @cached_property
    def contiguous(self) -> tuple[Array, Array]:
        """The edges, and the values as (m, NODES, p), for compiled code."""
        return np.ascontiguousarray(self.edges), np.asfortranarray(self.values.T)

    def numbers(self, times: Array) -> NDArray[np.intp]:
        return np.searchsorted(self.edges[1:-1], times, side="right")

    def up_to(self, last: float) -> "Pieces":
        """Return the polynomials between time 0 and `last` (s), not 0."""
        low, high = sorted((0.0, last))
        kept = (self.edges[1:] > low) & (self.edges[:-1] < high)
        edges = np.clip(self.edges[np.append(kept, False) | np.append(False, kept)], low, high)
        values = self.values[kept]
        cut = 0 if last < 0.0 else len(values) - 1
        values[cut] = self(nodes(edges[cut : cut + 1], edges[cut + 1 : cut + 2], POINTS)[0])
        return Pieces(edges, values)


def sizes_of(largest: Array, n_own: int) -> Array:
    """Return the sizes, (..., m), relative to which errors of m unknowns are measured.

    `largest` has the unknowns' largest absolute values.
    """
    # A quaternion's size is 1. The last `n_own` unknowns are the scene's own states.
    sizes = np.ones_like(largest)
    sizes[..., :3] = largest[..., :3].max(axis=-1, keepdims=True)
    own = largest.shape[-1] - n_own
    sizes[..., own:] = largest[..., own:]
    return sizes


@dataclass(frozen=True, eq=False)
class DenseOutput:
    """The solution of a scene as a function of time: `sol` of a trajectory.

    Attributes
    ----------
    t_min, t_max : float
        The times (s) between which the solution can be evaluated.
    states, rates : callable
        `states` is a function of times (s) that returns a row for each time: omega (rad/s), the
        attitude if requested, and the own states. `rates` takes times and these rows, and returns
        the rows' time derivatives.
    n_own : int
        The number of own states (`Scene.states`).

    Examples
    --------
    >>> from pyharness import case_scene, solve
    >>> sol = solve(case_scene(2), 2.0, dense_output=True).sol
    >>> sol(0.5).round(6)
    array([ 0.598472, -0.801144, 10.      ])
    >>> sol([0.5, 1.0]).shape
    (3, 2)
    """

    t_min: float
    t_max: float
    states: Callable[[Array], Array]
    rates: Callable[[Array, Array], Array]
    n_own: int = 0

    def __call__(self, t: Any) -> Array:
        """Return the state at one or more times.

        Parameters
        ----------
        t : float or array_like, shape (n,)
            Times from `t_min` to `t_max` (s), in any order. A time that exceeds an end by at most
            4 units in the last place counts as this end.

        Returns
        -------
        ndarray, shape (m,) or (m, n)
            Omega (rad/s); the unit quaternion, scalar first, if requested; and the own states
            (`Scene.states`).

        Raises
        ------
        InputError
            If a time is no number, or is not between `t_min` and `t_max`.
        """
        return self._at(t, lambda times, states: states)

    def derivative(self, t: Any) -> Array:
        """Return the time derivative of the state, from the equations of motion.

        Parameters
        ----------
        t : float or array_like, shape (n,)
            Times (s). Where a tabulated torque jumps, the derivative just after the jump is
            returned.

        Returns
        -------
        ndarray, shape (m,) or (m, n)
            The derivatives: of omega in rad/s2, of the quaternion in 1/s, and of own states
            (`Scene.states`).

        Raises
        ------
        InputError
            If a time is no number, or is not between `t_min` and `t_max`.
        """
        return self._at(t, self.rates)

    def normalized(self, states: Array) -> Array:
        """Normalise the quaternions in states, (..., m), in place, and return the states."""
        own = states.shape[-1] - self.n_own
        if own > 3:
            q = states[..., 3:own]
            q /= np.sqrt(np.vecdot(q, q))[..., None]
        return states

    def transform(
        self, states: Callable[[Array], Array], factor: float = 1.0
    ) -> "DenseOutput | None":
        """Return the solution with changed states, and times multiplied by `factor`."""
        if not isinstance(self.states, Pieces):
            return None
        edges, values = self.states.edges * factor, self.states.values
        changed = states(values.reshape(-1, values.shape[2])).reshape(values.shape)
        return replace(
            self, t_min=float(edges[0]), t_max=float(edges[-1]), states=Pieces(edges, changed)
        )

    def followed_by(self, after: "DenseOutput") -> "DenseOutput":
        """Return the solution on both sides of the time at which `after` begins."""
        first, second = self.states, after.states
        assert isinstance(first, Pieces)
        assert isinstance(second, Pieces)
        edges = np.concatenate([first.edges, second.edges[1:]])
        values = np.concatenate([first.values, second.values])
        return replace(after, t_min=self.t_min, states=Pieces(edges, values))

    def _at(self, t: Any, function: Callable[[Array, Array], Array]) -> Array:
        allowed = f"allowed: numbers from {self.t_min:.16g} to {self.t_max:.16g} s"
        try:
            times = numbers_of("t", t)
        except InputError:
            raise InputError(f"dense output: a time is no number; {allowed}") from None
        if times.ndim > 1:
            raise InputError(f"dense output: times with {times.ndim} dimensions; allowed: one")
        inner = np.clip(times, self.t_min, self.t_max)
        outside = times[~(np.abs(times - inner) <= _ROUNDED * np.spacing(np.abs(inner)))]
        if outside.size:
            raise InputError(f"dense output: t = {outside[0]:.16g} s; {allowed}")
        inner = np.atleast_1d(inner)
        rows = function(inner, self.normalized(self.states(inner)))
        return rows.T if times.ndim else rows[0]
