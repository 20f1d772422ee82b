"""The entry points that solve a scene by the series, and the true motion in 30 digits."""

import decimal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

import numpy as np

from pyharness import ChangingInertia, InputError, Scene, TorqueLaw, prepare, solve, solve_many
from pyharness.model.attitude import IDENTITY, angle_between
from pyharness.model.state_torque import of_law
from pyharness.model.trajectory import Array
from pyharness.truth.decimal_series import taylor_series
from pyharness.truth.reference import exact_coefficients

# The reference has more times than the requested ones, from which the largest |omega| is known.
_MORE_TIMES = np.linspace(0.0, 1.0, 26)[1:-1].tolist()
# Digits, order and local tolerance of the reference. A test compares it with `reference`.
_DIGITS, _ORDER, _LOCAL = 30, 26, Decimal("1e-18")
_MOST_GROWTH = 1e16  # beyond, no result has a digit


@dataclass(frozen=True, eq=False)
class Truth:
    """The true motion of a scene at requested times, up to the first singularity of the torque."""

    times: list[float]  # requested times, s
    omega: Array  # shape (n, 3), rad/s; n is smaller than the number of times after a singularity
    attitude: Array | None  # shape (n, 4)
    scale: float  # largest |omega| of any component, from time 0 to the last of the n times

    def error(self, omega: Array, attitude: Array | None, last_only: bool) -> float:
        """Return the error of results: the relative one of omega, or the angle (rad) if larger.

        The results are at the first times of the reference, or at its last time if `last_only`.
        """
        rows = slice(-1, None) if last_only else slice(0, len(omega))
        error = float(np.abs(omega - self.omega[rows]).max(initial=0.0)) / self.scale
        if attitude is None:
            return error
        assert self.attitude is not None
        return max(error, float(angle_between(attitude, self.attitude[rows]).max(initial=0.0)))


def truth_of(
    scene: Scene, times: Sequence[float], effort: float | None = None, growth: float = 1.0
) -> Truth:
    """Return the true motion of a scene at `times` (s), from one decimal Taylor series.

    The local tolerance is divided by the error amplification `growth`.

    Raise InputError if the work limit of the reference is exceeded, on which `effort` is a factor.
    """
    if isinstance(scene.torque, TorqueLaw) and scene.torque.in_space:
        attitude = scene.attitude or IDENTITY
        scene = replace(scene, torque=of_law(scene.torque), attitude=attitude)
    if scene.inertia is not None:
        # As a matrix that changes, if by nothing, it needs no principal axes.
        matrices: Any = ChangingInertia([scene.inertia, 1e-300 * np.eye(3)])
        scene = replace(scene, inertia=matrices)
    every = sorted({*times, *(part * times[-1] for part in _MORE_TIMES)}, key=abs)
    with decimal.localcontext() as context:
        amplified = Decimal(min(max(growth, 1.0), _MOST_GROWTH))
        context.prec = _DIGITS + amplified.adjusted()
        context.Emax, context.Emin = decimal.MAX_EMAX, decimal.MIN_EMIN
        exact = list(map(Decimal, every))
        coefficients = exact_coefficients(scene) if scene.changing is None else []
        rows = taylor_series(scene, coefficients, exact, False, _ORDER, _LOCAL / amplified, effort)
    width = 3 if scene.attitude is None else 7
    state = np.array([[float(x) for x in row] for row in rows]).reshape(-1, width)
    state = state[np.isfinite(state).all(axis=1)]
    wanted = [row for time, row in zip(every, state, strict=False) if time in times]
    found = np.array(wanted).reshape(-1, width)
    turns = None
    if scene.attitude is not None:
        turns = found[:, 3:] / np.linalg.norm(found[:, 3:], axis=1)[:, None]
    largest = max(map(abs, [*scene.omega, *state[:, :3].flat]))
    return Truth(list(times), found[:, :3], turns, largest)


@dataclass(frozen=True, eq=False)
class Result:
    """The result of one entry point for a scene, at all requested times or at the last one."""

    entry: str
    omega: Array  # shape (n, 3), rad/s
    attitude: Array | None  # shape (n, 4)
    ended: str
    estimate: float | None  # reported error; None if the entry point reports none
    growth: float | None  # reported error amplification K
    last_only: bool


_ready: Any = prepare


def results(scene: Scene, times: list[float], tolerance: float) -> Iterator[Result]:
    """Yield the results of every entry point; with the attitude if the scene has one.

    A refusal has no rows, and `ended` begins with "refused".
    """
    for entry, solved in ENTRIES.items():
        try:
            yield solved(entry, scene, times, tolerance)
        except InputError as refusal:
            yield Result(entry, np.zeros((0, 3)), None, f"refused: {refusal}", None, None, False)


def _rows(entry: str, scene: Scene, times: list[float], tolerance: float) -> Result:
    turning = scene.attitude is not None
    if entry == "trajectory":
        found = _ready(scene, tolerance=tolerance, attitude=turning).trajectory(scene.omega, times)
    else:
        found = solve(scene, times, entry.split()[1], tolerance, attitude=turning)
    values = found.omega, found.attitude, found.ended, found.error, found.growth
    return Result(entry, *values, last_only=False)


def _prepared(entry: str, scene: Scene, times: list[float], tolerance: float) -> Result:
    turning = scene.attitude is not None
    compiled = entry.endswith("compiled")
    ready = _ready(scene, entry.split()[1], tolerance, attitude=turning, compiled=compiled)
    start = [scene.omega, times[-1], *([scene.attitude] if turning else [])]
    omega, attitude = ready(*start) if turning else (ready(*start), None)
    return _row(entry, omega, attitude, ready.status, ready.error, ready.growth)


def _many(entry: str, scene: Scene, times: list[float], tolerance: float) -> Result:
    if entry == "solve_many":
        starts = [scene.omega, tuple(0.5 * w for w in scene.omega)]
        found = solve_many(scene, times[-1], omega=starts, tolerance=tolerance)
    else:
        found = solve_many([scene, scene], times[-1], tolerance=tolerance)
    turned = None if found.attitude is None else found.attitude[0]
    # The amplification is reported by `solve` alone.
    growth = _rows("solve taylor", scene, times[-1:], tolerance).growth
    return _row(entry, found.omega[0], turned, str(found.ended[0]), None, growth)


def _row(
    entry: str,
    omega: Array,
    attitude: Array | None,
    ended: str,
    estimate: float | None,
    growth: float | None,
) -> Result:
    """Return the result of an entry point that has no rows, at the last time."""
    count = 1 if np.isfinite(omega).all() else 0
    turned = None if attitude is None else attitude[None][:count]
    return Result(entry, omega[None][:count], turned, ended, estimate, growth, True)


ENTRIES: dict[str, Callable[[str, Scene, list[float], float], Result]] = {
    **dict.fromkeys(("solve taylor", "solve auto", "trajectory"), _rows),
    **dict.fromkeys(("prepare taylor", "prepare auto", "prepare auto compiled"), _prepared),
    **dict.fromkeys(("solve_many", "solve_many of scenes"), _many),
}
