"""Times of the rows of a file, placed so that the reader's interpolation keeps a tolerance."""

from collections.abc import Callable

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.attitude import matrices
from pyharness.model.dense_output import DenseOutput
from pyharness.model.errors import InputError, kind_of
from pyharness.model.values import finite

# A polynomial of degree 7 through four rows, each with values and derivatives.
WINDOW = 4
DEGREE = 2 * WINDOW - 1
LEAST_TOLERANCE = 1e-12  # below it, rounding errors would be interpolated
_MOST_ROWS = 2_000_000
# Where an interpolation is compared with the solution, as parts of an interval.
_PROBES = (np.arange(1, 8) / 8.0)[None, :]
_MARGIN = 0.7  # the error between the probes may be larger

# A function that returns the values and their derivatives, shape (n, m), at n times.
Function = Callable[[Array], tuple[Array, Array]]


def solution_of(sol: object, what: str) -> DenseOutput:
    """Return the argument `sol` if it is a dense output with attitude, or raise InputError.

    `what` is the name of the function that needs it, for the message.
    """
    allowed = "allowed: a trajectory of solve(..., attitude=True, dense_output=True)"
    if not isinstance(sol, DenseOutput):
        raise InputError(f"{what}: sol is {kind_of(sol)}; {allowed}")
    if sol(sol.t_min).size != 7:
        raise InputError(f"{what}: the trajectory has no attitude; {allowed}")
    return sol


def interpolation_times(sol: DenseOutput, tolerance: float = 1e-9) -> Array:
    """Return times between which the attitude can be interpolated with a given error.

    The reader is assumed to interpolate by Hermite's polynomials of degree 7 through the values and
    derivatives of the quaternion and of omega at four successive times, two on each side, as the
    C-kernels of SPICE do. Omega is about the body axes or about those of space. At the ends there
    are fewer times on one side; both usual choices, three times or four, are covered. Intervals are
    halved until the interpolation agrees with the solution at seven times within each.

    Parameters
    ----------
    sol : DenseOutput
        The attribute `sol` of a trajectory with attitude and dense output.
    tolerance : float
        The largest error of the interpolated attitude (rad), and of the interpolated omega as a
        fraction of the largest magnitude of omega; at least 1e-12.

    Returns
    -------
    ndarray, shape (n,)
        Times (s) from `sol.t_min` to `sol.t_max` in ascending order, at least five.

    Raises
    ------
    InputError
        If an argument is invalid, or if more than two million times would be necessary.

    Examples
    --------
    >>> from pyharness import case_scene, solve
    >>> found = solve(case_scene(3), 10.0, attitude=True, dense_output=True)
    >>> times = interpolation_times(found.sol, 1e-6)
    >>> float(times[0]), float(times[-1])
    (0.0, 10.0)
    """
    solution = solution_of(sol, "interpolation_times")
    tolerance = finite("tolerance", tolerance)
    if tolerance < LEAST_TOLERANCE:
        raise InputError(
            f"tolerance {tolerance:g} is too small; allowed: {LEAST_TOLERANCE} or more"
        )
    start, end = solution.t_min, solution.t_max
    if not start < end:
        raise InputError(
            "the solution has one time, so nothing can be interpolated; allowed: a trajectory "
            "from one time to another"
        )
    times = np.linspace(start, end, WINDOW + 1)
    largest = 0.0

    def states(at: Array) -> tuple[Array, Array]:
        return with_space(solution(at).T, solution.derivative(at).T)

    while True:
        values, rates = states(times)
        largest = max(largest, float(np.linalg.norm(values[:, :3], axis=1).max()))
        wrong = _wrong(times, values, rates, states, tolerance, largest)
        if not wrong.any():
            return times
        middles = (times[:-1] + times[1:])[wrong] / 2.0
        if len(times) + len(middles) > _MOST_ROWS:
            raise InputError(
                f"tolerance {tolerance:g} needs more than {_MOST_ROWS} rows; give a larger "
                "tolerance or a shorter time"
            )
        times = np.sort(np.concatenate([times, middles]))


def with_space(states: Array, rates: Array) -> tuple[Array, Array]:
    """Return states and their derivatives with three more columns: omega about the axes of space.

    The states have omega about the body axes and the quaternion, shape (n, 7).
    """
    # The derivative has no term omega x omega, which is 0.
    both = np.stack([states[:, :3], rates[:, :3]], axis=2)
    space = matrices(states[:, 3:]) @ both
    return np.column_stack([states, space[..., 0]]), np.column_stack([rates, space[..., 1]])


def _wrong(
    times: Array,
    values: Array,
    rates: Array,
    states: Function,
    tolerance: float,
    largest: float,
) -> Array:
    """Return for each interval whether its interpolation misses the tolerance."""
    count = len(times) - 1
    low = np.arange(count)
    probes = times[:-1, None] + _PROBES * np.diff(times)[:, None]
    exact = states(probes.ravel())[0].reshape(count, -1, values.shape[1])
    # Away from the ends the windows have their interval in the middle.
    side = WINDOW // 2
    first = np.clip(low - side + 1, 0, count + 1 - WINDOW)
    groups = [(low, first[:, None] + np.arange(WINDOW))]
    # At the ends some readers take fewer rows in place of rows farther away.
    for k in range(side - 1):
        groups.append((np.array([k]), np.arange(k + side + 1)[None, :]))
        last = count - k - side
        groups.append((np.array([count - 1 - k]), np.arange(last, count + 1)[None, :]))
    wrong = np.zeros(count, bool)
    for rows, windows in groups:
        found = hermite(times[windows], values[windows], rates[windows], probes[rows])
        apart = found - exact[rows]
        angle = 2.0 * np.linalg.norm(apart[..., 3:7], axis=2)
        omegas = [np.linalg.norm(apart[..., part], axis=2) for part in (slice(3), slice(7, 10))]
        error = np.maximum(angle, np.maximum(*omegas) / (largest or 1.0)).max(axis=1)
        # An error that is no number, after an overflow, is no reason for more rows.
        wrong[rows] |= error > _MARGIN * tolerance
    return wrong


def hermite(nodes: Array, values: Array, rates: Array, at: Array) -> Array:
    """Return the values of Hermite's interpolating polynomials.

    Parameters
    ----------
    nodes : ndarray, shape (n, w)
        The nodes of each of n polynomials, in ascending order.
    values, rates : ndarray, shape (n, w, m)
        The values of m components, and their derivatives, at the nodes.
    at : ndarray, shape (n, p)
        Where each polynomial is evaluated.

    Returns
    -------
    ndarray, shape (n, p, m)
        The polynomials of degree 2 w - 1, which have these values and derivatives.
    """
    # Newton's divided differences; each node counts twice.
    twice = np.repeat(nodes, 2, axis=1)
    column = np.repeat(values, 2, axis=1)
    count = twice.shape[1]
    newton = [column[:, 0]]
    for order in range(1, count):
        below = np.diff(column, axis=1)
        width = twice[:, order:] - twice[:, :-order]
        if order == 1:
            column = np.empty_like(below)
            column[:, 0::2] = rates
            column[:, 1::2] = below[:, 1::2] / width[:, 1::2, None]
        else:
            column = below / width[:, :, None]
        newton.append(column[:, 0])
    found = np.repeat(newton[-1][:, None], at.shape[1], axis=1)
    for order in range(count - 2, -1, -1):
        found = found * (at - twice[:, order, None])[:, :, None] + newton[order][:, None]
    return found
