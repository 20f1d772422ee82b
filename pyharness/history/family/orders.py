"""What the members of the family are worth: orders measured against orders derived, errors."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pyharness.history.family.members import Member, march, predicted_order, run
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.reference import Reference, reference

TERMS = (1, 2, 3, 4, 5)
CORRECTIONS = (1, 2, 3, 4, 5, 6, 7, 8)
SCHEMES: tuple[tuple[str, str | None], ...] = (
    ("collocation", "thesis"),
    ("collocation", "gauss"),
    ("subdomain", None),
    ("galerkin", None),
    ("least-squares", None),
)
# Steps over the horizon: every other entry halves the step. The horizon is first short, where an
# error soon falls with its power alone, then longer for what is lost in rounding there, then
# shorter still for scenes that are long.
_LADDER = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192)
_HORIZONS = (1 / 4, 1 / 2, 1, 1 / 16, 1 / 64, 1 / 256)
# Slopes count between these errors (relative to the largest omega at the horizon): above, the
# error is not small, below, it is rounding, which stays under 1e-15 here.
_LARGEST, _SMALLEST = 1e-2, 5e-14
_SLOPES_WANTED = 4
_SETTLED = 0.1
SLACK = 0.25
MOST_STEPS = 2_000

Progress = Callable[[str], None]


@dataclass(frozen=True)
class OrderFinding:
    """One member in one scene.

    Attributes
    ----------
    member : Member
        Which.
    predicted : int
        The order derived in docs/family.md.
    measured : float or None
        The order measured; None where the error is that of rounding, or never gets small.
    settled : bool
        Whether the order still changed by less than a tenth when the step was last halved.
    error : float
        Largest error of any omega over the scene's own steps (rad/s); infinite after an overflow.
    """

    member: Member
    predicted: int
    measured: float | None
    settled: bool
    error: float

    @property
    def deviation(self) -> float:
        """Measured less predicted; NaN where nothing was measured."""
        return math.nan if self.measured is None else self.measured - self.predicted

    @property
    def misses(self) -> bool:
        """Whether the order is below that derived: above it may be, where a scene is special."""
        return self.settled and self.deviation < -SLACK


def family_members(
    terms: Sequence[int] = TERMS, corrections: Sequence[int] = CORRECTIONS
) -> list[Member]:
    """Return the members of the table: every scheme, these terms, these corrections."""
    return [Member(w, n, p, k) for w, p in SCHEMES for n in terms for k in corrections]


def order_table(
    scene: Scene, members: Sequence[Member] | None = None, progress: Progress | None = None
) -> list[OrderFinding]:
    """Measure orders and errors of many members side by side.

    Parameters
    ----------
    scene : Scene
        What to integrate; its length in time is the longest horizon.
    members : sequence of Member, optional
        Which; `family_members()` by default.
    progress : callable, optional
        Told what is being done.

    Returns
    -------
    list of OrderFinding
        One for each member, in their order.

    Raises
    ------
    InputError
        Where the solution itself leaves every bound, or the steps are too many for a table.
    """
    if scene.steps > MOST_STEPS:
        raise InputError(f"steps is {scene.steps}; allowed for orders: 1 to {MOST_STEPS}")
    chosen = list(family_members() if members is None else members)
    times = scene.times()
    span = times[-1]
    tell = progress or (lambda text: None)
    tell("reference")
    horizons = [part * span for part in _HORIZONS]
    truth = _truth(scene, sorted({*times, *horizons}))
    place = {time: row for row, time in enumerate(truth.time.tolist())}
    measured: list[float | None] = [None] * len(chosen)
    doubts = [math.inf] * len(chosen)
    open_ones = list(range(len(chosen)))
    for horizon in horizons:
        end = truth.omega[place[horizon]]
        tell(f"orders of {len(open_ones)} members over {horizon:g} s")
        errors = _ladder(scene, [chosen[i] for i in open_ones], horizon, end)
        for i, column in zip(open_ones, errors.T, strict=True):
            slopes = _slopes(column)
            doubt = abs(slopes[-1] - slopes[-2]) if len(slopes) >= _SLOPES_WANTED else math.inf
            if doubt < doubts[i]:
                measured[i], doubts[i] = slopes[-1], doubt
        open_ones = [i for i in open_ones if doubts[i] > _SETTLED]
        if not open_ones:
            break
    tell("errors")
    wanted = truth.omega[[place[time] for time in times]]
    with np.errstate(all="ignore"):
        errors = np.abs(march(scene, chosen) - wanted).max(axis=(1, 2))
    return [
        OrderFinding(member, predicted_order(member), order, doubt <= _SETTLED, _or_infinite(error))
        for member, order, doubt, error in zip(chosen, measured, doubts, errors, strict=True)
    ]


def measured_order(member: Member, scene: Scene) -> float | None:
    """Return the order of one member, as `order_table` measures it."""
    return order_table(scene, [member])[0].measured


def _truth(scene: Scene, times: Sequence[float]) -> Reference:
    truth = reference(scene, times)
    if len(truth.time) < len(times):
        last = float(truth.time[-1]) if len(truth.time) else 0.0
        raise InputError(f"the solution leaves every bound after {last:g} s; take fewer steps")
    return truth


def _ladder(scene: Scene, members: Sequence[Member], horizon: float, end: Array) -> Array:
    """Return the error at the horizon for ever smaller steps, shape (rungs, members)."""
    scale = float(np.abs(end).max()) or 1.0
    rungs = []
    for steps in _LADDER:
        omega = march(replace(scene, step_size=horizon / steps, steps=steps), members)[:, -1]
        with np.errstate(all="ignore"):
            rungs.append(np.sqrt(np.square(omega - end).sum(axis=1)) / scale)
        if (rungs[-1] < _SMALLEST).all():
            break
    return np.array(rungs)


def _slopes(errors: Array) -> list[float]:
    """Return the powers between rungs that halve the step, where both errors count."""
    return [
        math.log2(coarse / fine)
        for coarse, fine in zip(errors[:-2], errors[2:], strict=True)
        if coarse < _LARGEST and fine > _SMALLEST
    ]


def _or_infinite(error: float) -> float:
    return float(error) if math.isfinite(error) else math.inf


@dataclass(frozen=True)
class TermsFinding:
    """What more terms bring: the error of the model of n terms (rad/s), n in `terms`."""

    corrections: int
    terms: tuple[int, ...]
    errors: tuple[float, ...]


def terms_findings(
    scene: Scene,
    corrections: Sequence[int] = (1, 8),
    terms: Sequence[int] = (2, 3, 4, 5),
    points: str = "thesis",
) -> list[TermsFinding]:
    """Measure what higher powers of t add (Jacobs 1982, IV.1), with few corrections and many."""
    truth = _truth(scene, scene.times()).omega
    found = []
    for k in corrections:
        members = [Member("collocation", n, points, k) for n in terms]
        with np.errstate(all="ignore"):
            errors = np.abs(march(scene, members) - truth).max(axis=(1, 2))
        found.append(TermsFinding(k, tuple(terms), tuple(map(_or_infinite, errors))))
    return found


@dataclass(frozen=True)
class ConcurrenceFinding:
    """Whether models concur, and whether what they concur in is true (rad/s).

    Attributes
    ----------
    terms : tuple of int
        The models, by their powers of t.
    differences : tuple of float
        Largest difference of each model from the next one, of any omega at any result.
    errors : tuple of float
        Largest error of each model.
    largest : float
        Largest omega of the true solution.
    """

    terms: tuple[int, ...]
    differences: tuple[float, ...]
    errors: tuple[float, ...]
    largest: float


def concurrence(
    scene: Scene, terms: Sequence[int] = (2, 3, 4, 5), corrections: int = 1
) -> ConcurrenceFinding:
    """Hold the collocation models against each other and the truth (V.2 on Case 6).

    Parameters
    ----------
    scene : Scene
        What to integrate.
    terms : sequence of int
        The models; points k/(n+1).
    corrections : int
        Corrections of each.
    """
    truth = _truth(scene, scene.times()).omega
    runs = [run(scene, Member("collocation", n, "thesis", corrections)) for n in terms]
    rows = [np.full(truth.shape, math.inf) for _ in runs]
    for row, each in zip(rows, runs, strict=True):
        row[: each.steps] = each.omega
    with np.errstate(all="ignore"):
        pairs = [float(np.abs(x - y).max()) for x, y in itertools.pairwise(rows)]
        errors = [float(np.abs(row - truth).max()) for row in rows]
    return ConcurrenceFinding(
        terms=tuple(terms),
        differences=tuple(map(_or_infinite, pairs)),
        errors=tuple(errors),
        largest=float(np.abs(truth).max()),
    )
