"""Solution of many bodies under torque laws, by kernels for bodies side by side."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.plan.registry import PREPARED_WITH_ATTITUDE, check_attitude
from pyharness.engine.prepared.many_scenes import MERGED, PRINCIPAL, checked_rows
from pyharness.engine.prepared.many_tape import sides_of
from pyharness.model.arrays import count_bodies, spread, threads_of
from pyharness.model.codes import Methods, Statuses
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.progress import for_each_piece
from pyharness.model.trajectory import Array
from pyharness.model.waves import with_merged_rows

_NO_MOMENTS = np.empty((0, 3))
_NOTHING = np.empty((4, 0), order="F")  # in place of attitudes
# Methods whose kernels evaluate a body at several times.
_WITH_ROWS = (Methods.CLOSED_FORM, Methods.CLOSED_FORM_OR_TAYLOR, Methods.TAYLOR)
_UNKNOWN = -1.0  # in place of an estimate that the kernel does not compute


def _arrays(
    ready: dict[str, Any], own: dict[str, Any], code: int
) -> tuple[int, bool, tuple[Array, ...], Mapping[str, Array]]:
    """Return the number of bodies, whether they have moments, their arrays, and all rows.

    Bodies that the method can't solve are refused.
    """
    given = checked_rows(own)
    n = count_bodies(given)
    rows = {**ready, **given}
    by_moments = "moments" in (given if "coefficients" in given else rows)
    law: tuple[Array, Array, Array] | None = ready.get("merged")
    if law is None or not given.keys().isdisjoint(MERGED):
        law = with_merged_rows(*(rows[name] for name in MERGED))
    constant, sines, cosines = law
    body, omega = rows["moments" if by_moments else "coefficients"], spread(rows["omega"], n)
    if code == Methods.CLOSED_FORM:
        parts = constant, rows["torque_rate"], sines[..., :3], cosines[..., :3]
        if any(each.any() for each in parts):
            raise InputError(
                "closed-form can't solve bodies with a torque in one call; allowed: auto, taylor"
            )
        if "attitude" in rows and not by_moments:
            raise InputError(
                "closed-form can't compute the attitude of bodies given by coefficients; "
                "allowed: moments, or methods auto and taylor"
            )
    moments = rows.get(PRINCIPAL, _NO_MOMENTS)
    return (
        n,
        by_moments,
        (body, moments, constant, rows["torque_rate"], sines, cosines, omega),
        rows,
    )


def solve_bodies(
    ready: dict[str, Any], own: dict[str, Any], settings: tuple[int, float, float, float], *,
    method: str = "auto", is_rounded: bool = False, threads: int, out: "Ensemble | Array | None",
    with_estimates: bool = False,
) -> Ensemble:  # fmt: skip
    """Return final states of bodies, by one kernel call.

    Arrays in `own` replace arrays in `ready`.
    """
    code, tolerance, step, effort = settings
    n, by_moments, arrays, rows = _arrays(ready, own, code)
    *laws, omega = arrays
    times, attitude = rows["t_end"], rows.get("attitude")
    if not step > 0.0:
        raise InputError(f"step is {step:g}; allowed: above 0")
    if attitude is not None:
        check_attitude(method, PREPARED_WITH_ATTITUDE)
    threads = threads_of(threads)
    found = place_for(out, n, attitude is not None, with_estimates)
    if found.estimates is not None:
        found.estimates[:] = _UNKNOWN
    # A kernel may write a result before it reads the initial state.
    if np.may_share_memory(omega, found.omega):
        omega = omega.copy()
    if attitude is not None and np.may_share_memory(attitude, found.attitude):
        attitude = attitude.copy()

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        def part(array: Array | None) -> Array:
            if array is None:
                return _NOTHING
            return (array if len(array) in (0, 1, piece.stop - piece.start) else array[piece]).T

        extension().solve_ensemble(
            code, tolerance, step, effort, by_moments + 2 * is_rounded,
            *[part(each) for each in laws], part(omega), part(times), part(attitude), given_up,
            found.omega[piece].T,
            _NOTHING if found.attitude is None else found.attitude[piece].T, found.status[piece],
            found.estimates_of(piece),
        )  # fmt: skip

    for_each_piece(enter, n, threads)
    if found.estimates is not None:
        found.estimates[~(found.estimates >= 0.0)] = np.nan
    return found


def solve_at(
    ready: dict[str, Any], own: dict[str, Any], times: Array,
    settings: tuple[int, float, float, float], *, with_estimates: bool, threads: int,
    **options: Any,
) -> Ensemble:  # fmt: skip
    """Return the states of bodies at `times` (s)."""
    found, left = None, np.arange(0)
    if settings[0] in _WITH_ROWS:
        found, left = _solve_rows(ready, own, times, settings[:2], threads, with_estimates)
        if not left.size:
            return found
    rows = checked_rows(own)
    if found is not None:
        rows = {name: each if len(each) == 1 else each[left] for name, each in rows.items()}
    # A copy of each body for each time.
    n, m = count_bodies(rows), len(times)
    rows = {
        name: each if len(each) == 1 else np.repeat(each, m, axis=0) for name, each in rows.items()
    }
    rows["t_end"] = np.tile(times, n)
    part = solve_bodies(
        ready, rows, settings, threads=threads, out=None, with_estimates=with_estimates, **options
    ).with_times(times)
    if found is None:
        return part
    for name in ("omega", "status", "attitude", "estimates"):
        array = getattr(found, name)
        if array is not None:
            array[left] = getattr(part, name)
    return found


def _solve_rows(
    ready: dict[str, Any], own: dict[str, Any], times: Array, settings: tuple[int, float],
    threads: int, with_estimates: bool,
) -> tuple[Ensemble, NDArray[np.int64]]:  # fmt: skip
    """Return states of bodies at `times` (s), and the bodies without a result.

    A body is solved once for all its times on one side of 0.
    """
    n, by_moments, arrays, rows = _arrays(ready, own, settings[0])
    attitude = None if "attitude" not in rows else spread(rows["attitude"], n)
    shape = n, len(times)
    found = Ensemble(
        np.empty((*shape, 3)), np.empty(shape, np.int8),
        None if attitude is None else np.empty((*shape, 4)),
        np.empty((*shape, 2)) if with_estimates else None, times=times,
    )  # fmt: skip
    is_left = np.zeros(n, bool)
    places = np.arange(1, len(times) + 1, dtype=np.int32)
    sides = [(times[side], places[side], side) for side in sides_of(times)]

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        count = piece.stop - piece.start
        parts = [(each if len(each) in (0, 1, count) else each[piece]).T for each in arrays]
        turns = _NOTHING if attitude is None else attitude[piece].T
        status = np.empty(count, np.int8)
        results = [
            np.empty((width, len(times), 0), order="F") if each is None else each[piece].T
            for each, width in ((found.attitude, 4), (found.estimates, 2))
        ]
        for ends, of_ends, side in sides:
            extension().solve_many_rows(
                *settings, int(by_moments), *parts, ends, of_ends, turns, given_up,
                found.omega[piece].T, results[0], status, results[1],
            )  # fmt: skip
            found.status[piece, side] = status[:, None]
            is_left[piece] |= status != Statuses.COMPLETE

    for_each_piece(enter, n, threads_of(threads))
    return found, np.flatnonzero(is_left)
