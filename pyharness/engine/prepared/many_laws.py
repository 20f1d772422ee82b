"""Solution of many bodies under torque laws, by kernels for bodies side by side."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.plan.registry import PREPARED_WITH_ATTITUDE, check_attitude
from pyharness.engine.prepared.many_scenes import MERGED, checked_copies, checked_rows
from pyharness.engine.prepared.many_tape import sides_of
from pyharness.model.arrays import count_bodies, spread, threads_of
from pyharness.model.codes import Methods, Statuses
from pyharness.model.ensemble import Ensemble, place_for
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.progress import for_each_piece
from pyharness.model.trajectory import Array
from pyharness.model.waves import with_merged_rows

_NOTHING = np.empty((4, 0), order="F")  # in place of attitudes
_UNKNOWN = -1.0  # in place of an estimate that the kernel does not compute


def _arrays(
    ready: dict[str, Any], own: dict[str, Any]
) -> tuple[int, bool, tuple[Array, ...], Mapping[str, Array]]:
    """Return the number of bodies, whether they have moments, their arrays, and all rows."""
    given = checked_rows(own)
    n = count_bodies(given)
    rows = {**ready, **given}
    by_moments = "moments" in (given if "coefficients" in given else rows)
    law: tuple[Array, Array, Array] | None = ready.get("merged")
    if law is None or not given.keys().isdisjoint(MERGED):
        law = with_merged_rows(*(rows[name] for name in MERGED))
    constant, sines, cosines = law
    body, omega = rows["moments" if by_moments else "coefficients"], spread(rows["omega"], n)
    return n, by_moments, (body, constant, rows["torque_rate"], sines, cosines, omega), rows


def solve_bodies(
    ready: dict[str, Any], own: dict[str, Any], settings: tuple[int, float, float, float], *,
    method: str = "auto", is_rounded: bool = False, threads: int, out: "Ensemble | Array | None",
    with_estimates: bool = False,
) -> Ensemble:  # fmt: skip
    """Return final states of bodies, by one kernel call.

    Arrays in `own` replace arrays in `ready`.
    """
    code, tolerance, step, effort = settings
    n, by_moments, (body, constant, rate, sines, cosines, omega), rows = _arrays(ready, own)
    times, attitude = rows["t_end"], rows.get("attitude")
    if not step > 0.0:
        raise InputError(f"step is {step:g}; allowed: above 0")
    if code == Methods.CLOSED_FORM:
        if any(each.any() for each in (constant, rate, sines[..., :3], cosines[..., :3])):
            raise InputError(
                "closed-form can't solve bodies with a torque in one call; allowed: auto, taylor"
            )
        if attitude is not None and not by_moments:
            raise InputError(
                "closed-form can't compute the attitude of bodies given by coefficients; "
                "allowed: moments, or methods auto and taylor"
            )
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
            code, tolerance, step, effort, by_moments + 2 * is_rounded, part(body), part(constant),
            part(rate), part(sines), part(cosines), part(omega), part(times), part(attitude),
            given_up, found.omega[piece].T,
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
    # Normalised twice, a quaternion may have another last bit.
    rows: Any = checked_copies({"omega": None, "attitude": None, **own}, as_given=True)
    found, left = None, np.arange(0)
    if _has_series(settings[0], {**ready, **rows}):
        found, left = _solve_rows(ready, rows, times, settings[:2], threads, with_estimates)
        if not left.size:
            return found
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
    found.omega[left], found.status[left] = part.omega, part.status
    if found.estimates is not None:
        found.estimates[left] = part.estimates
    return found


def _has_series(code: int, rows: Mapping[str, Any]) -> bool:
    """Return whether a kernel has a series for the bodies that it evaluates at several times."""
    names = ("torque_constant", "torque_rate")
    return (
        code in (Methods.CLOSED_FORM_OR_TAYLOR, Methods.TAYLOR)
        and rows.get("attitude") is None
        and (
            any(rows[name].any() for name in names)
            or any(rows[name][..., :3].any() for name in ("sines", "cosines"))
        )
    )


def _solve_rows(
    ready: dict[str, Any], own: dict[str, Any], times: Array, settings: tuple[int, float],
    threads: int, with_estimates: bool,
) -> tuple[Ensemble, NDArray[np.int64]]:  # fmt: skip
    """Return omega of bodies under a torque at `times` (s), and the bodies without a result.

    One integration of a body has all its times on one side of 0.
    """
    n, by_moments, arrays, _ = _arrays(ready, own)
    shape = n, len(times)
    found = Ensemble(
        np.empty((*shape, 3)), np.empty(shape, np.int8),
        estimates=np.empty((*shape, 2)) if with_estimates else None, times=times,
    )  # fmt: skip

    def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
        count = piece.stop - piece.start
        parts = [(each if len(each) in (1, count) else each[piece]).T for each in arrays]
        for rows in sides_of(times):
            m = len(times[rows])
            omega, status = np.empty((count, m, 3)), np.empty(count, np.int8)
            estimates = np.empty((count if with_estimates else 0, m, 2))
            extension().solve_many_rows(
                *settings, int(by_moments), *parts, times[rows], given_up, omega.T, status,
                estimates.T,
            )  # fmt: skip
            found.omega[piece, rows], found.status[piece, rows] = omega, status[:, None]
            if found.estimates is not None:
                found.estimates[piece, rows] = estimates

    for_each_piece(enter, n, threads_of(threads))
    return found, np.flatnonzero((found.status != Statuses.COMPLETE).any(axis=1))
