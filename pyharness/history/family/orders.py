"""Errors of weighted residual methods, with measured and derived orders of convergence."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from pyharness.history.family.members import Member, integrate, predicted_order
from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, no_progress
from pyharness.model.records import build_record, scene_record
from pyharness.model.report import Column, Report, Section, Table, numbers, short, words
from pyharness.model.scene import Scene
from pyharness.model.scene_report import heading
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference

SCHEMES: tuple[tuple[str, str | None], ...] = (
    ("collocation", "thesis"),
    ("collocation", "gauss"),
    ("subdomain", None),
    ("galerkin", None),
    ("least-squares", None),
)
# `_LADDER` has the numbers of steps from 0 to the horizon; each is twice the number two places
# before. A horizon is a fraction of the scene's end time. The first is so short that the leading
# term of the error dominates even at large steps. Longer horizons follow for members whose error
# over the first is mostly rounding. The last three, for long scenes, are shorter than the first.
_LADDER = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192)
_HORIZONS = (1 / 4, 1 / 2, 1, 1 / 16, 1 / 64, 1 / 256)
# Range of the errors, relative to the largest omega at the horizon, from which an order is
# computed. Above it, higher terms of the error matter; below it, rounding error (at most 1e-15
# here).
_LARGEST, _SMALLEST = 1e-2, 5e-14
_SLOPES_WANTED = 4
_SETTLED = 0.1
SLACK = 0.25
MOST_STEPS = 2_000


@dataclass(frozen=True)
class OrderFinding:
    """The derived and measured order of convergence of a method in a scene, and its error.

    `measured` is None if all errors are too large or only rounding. It is `settled` if its last two
    values differ by at most a tenth. `error` is of omega with the scene's step (rad/s).
    """

    member: Member
    predicted: int
    measured: float | None
    settled: bool
    error: float

    @property
    def deviation(self) -> float:
        """Return the measured minus the predicted order; NaN without a measured order."""
        return math.nan if self.measured is None else self.measured - self.predicted

    @property
    def misses(self) -> bool:
        """Return whether the order is too low; a higher order may be due to a special scene."""
        return self.settled and self.deviation < -SLACK


def family_members(
    terms: Sequence[int] = range(1, 6), corrections: Sequence[int] = range(1, 9)
) -> list[Member]:
    """Return a method for each combination of scheme (in `SCHEMES`), `terms` and `corrections`."""
    return [Member(w, n, p, k) for w, p in SCHEMES for n in terms for k in corrections]


def order_table(
    scene: Scene, members: Sequence[Member] | None = None, progress: Progress = no_progress
) -> list[OrderFinding]:
    """Return the orders of convergence and the errors of many methods, measured together.

    Raise InputError if the solution is unbounded or the scene has more than `MOST_STEPS` steps.
    """
    if scene.steps > MOST_STEPS:
        raise InputError(f"steps is {scene.steps}; allowed for orders: 1 to {MOST_STEPS}")
    chosen = list(family_members() if members is None else members)
    times = scene.times()
    horizons = [part * times[-1] for part in _HORIZONS]
    phases = len(horizons) + 2
    progress(0, phases, "reference")
    wanted = sorted({*times, *horizons})
    truth = reference(scene, wanted)
    if len(truth.time) < len(wanted):
        last = float(truth.time[-1]) if len(truth.time) else 0.0
        raise InputError(f"the solution grows without bound after {last:g} s; use fewer steps")
    place = {time: row for row, time in enumerate(truth.time.tolist())}
    measured: list[float | None] = [None] * len(chosen)
    doubts = [math.inf] * len(chosen)
    open_ones = list(range(len(chosen)))
    for number, horizon in enumerate(horizons, 1):
        end = truth.omega[place[horizon]]
        progress(number, phases, f"orders of {len(open_ones)} members over {horizon:g} s")
        errors = _ladder(scene, [chosen[i] for i in open_ones], horizon, end)
        for i, column in zip(open_ones, errors.T, strict=True):
            slopes = _slopes(column)
            doubt = abs(slopes[-1] - slopes[-2]) if len(slopes) >= _SLOPES_WANTED else math.inf
            if doubt < doubts[i]:
                measured[i], doubts[i] = slopes[-1], doubt
        open_ones = [i for i in open_ones if doubts[i] > _SETTLED]
        if not open_ones:
            break
    progress(phases - 1, phases, "errors")
    rows = [place[time] for time in times]
    with np.errstate(all="ignore"):
        errors = np.abs(integrate(scene, chosen) - truth.omega[rows]).max(axis=(1, 2))
    errors[~np.isfinite(errors)] = math.inf
    return [
        OrderFinding(each, predicted_order(each), order, doubt <= _SETTLED, float(error))
        for each, order, doubt, error in zip(chosen, measured, doubts, errors, strict=True)
    ]


def _ladder(scene: Scene, members: Sequence[Member], horizon: float, end: Array) -> Array:
    """Return the relative errors of methods at `horizon` (s), shape (step sizes, members)."""
    scale = float(np.abs(end).max()) or 1.0
    rungs = []
    for steps in _LADDER:
        omega = integrate(replace(scene, step_size=horizon / steps, steps=steps), members)[:, -1]
        with np.errstate(all="ignore"):
            rungs.append(np.sqrt(np.square(omega - end).sum(axis=1)) / scale)
        if (rungs[-1] < _SMALLEST).all():
            break
    return np.array(rungs)


def _slopes(errors: Array) -> list[float]:
    """Return the order from each usable pair of errors, whose step sizes have the ratio 2."""
    return [
        math.log2(coarse / fine)
        for coarse, fine in zip(errors[:-2], errors[2:], strict=True)
        if coarse < _LARGEST and fine > _SMALLEST
    ]


def family_report(scene: Scene, found: Sequence[OrderFinding]) -> Report:
    """Return the report of orders and errors in a scene, by n terms and k corrections."""
    names = ("predicted", "measured", "settled", "error")
    measures = [{name: getattr(each, name) for name in names} for each in found]
    data = [
        [member.weighting, member.points_label, member.terms, member.corrections, *measure.values()]
        for member, measure in zip((each.member for each in found), measures, strict=True)
    ]
    page = [heading(scene), *_tables(found), verdict(found)]
    return Report(
        "family",
        text=page,
        record=lambda: {
            "scene": scene_record(scene),
            "members": [
                asdict(each.member) | measure for each, measure in zip(found, measures, strict=True)
            ],
            "unexpected": _unexpected(found),
            "build": build_record(),
        },
        data=numbers("weighting points terms corrections predicted measured settled error", data),
        page=page,
    )


def verdict(found: Sequence[OrderFinding]) -> list[str]:
    """Return sentences on measured and derived orders: one for each miss, else one for all."""
    unexpected = _unexpected(found)
    if unexpected:
        return [f"UNEXPECTED: {each}" for each in unexpected]
    near = sum(abs(each.deviation) <= SLACK for each in found)
    silent = sum(each.measured is None for each in found)
    text = f"as expected: {near} of {len(found)} orders within {SLACK} of those derived"
    above = sum(each.deviation > SLACK for each in found)
    if above:
        text += f"; {above} above (in this scene the term that limits them is small)"
    if silent:
        text += f"; {silent} not measurable (nothing but rounding, or no step small enough)"
    unsettled = len(found) - near - above - silent
    if unsettled:
        text += f"; {unsettled} below, but not settled"
    return [text]


def _unexpected(found: Sequence[OrderFinding]) -> list[str]:
    told = []
    for each in (each for each in found if each.misses):
        member = each.member
        points = f" at points {member.points_label}" if member.points is not None else ""
        told.append(
            f"{member.weighting}{points}, {member.terms} terms, {member.corrections} corrections: "
            f"order {each.measured:.2f}, derived {each.predicted}"
        )
    return told


def _tables(found: Sequence[OrderFinding]) -> list[Section]:
    corrections = sorted({each.member.corrections for each in found})
    groups: dict[tuple[str, str, int], dict[int, OrderFinding]] = {}
    for each in found:
        member = each.member
        key = (member.weighting, member.points_label[:24], member.terms)
        groups.setdefault(key, {})[member.corrections] = each
    rows = [[*key, *map(row.get, corrections)] for key, row in groups.items()]
    names = [*words("weighting points"), Column("n")]

    def table(write: Callable[[OrderFinding | None], str]) -> Table:
        return Table([*names, *(Column(f"k={k}", write) for k in corrections)], rows)

    return [
        [
            "Each cell: order derived / order measured, with n terms and k corrections. ?: the "
            "measured order did not converge before rounding errors dominated.",
            table(_order),
        ],
        ["Largest error of any component of omega (rad/s):", table(_error)],
    ]


def _order(each: OrderFinding | None) -> str:
    if each is None:
        return ""
    measured = "-" if math.isnan(each.deviation) else f"{each.measured:.2f}"
    return f"{each.predicted}/{measured}{'' if each.settled or measured == '-' else '?'}"


def _error(each: OrderFinding | None) -> str:
    return "" if each is None else short(each.error)
