"""The thesis's weighted residual methods (III.1 and IV.2), and their orders of convergence.

A step of size h solves omega' = f(t, omega) (eq. 16-18) with a polynomial trial function
omega(0) + c1 t + ... + cn t**n. The first estimate assumes constant f. Each correction (the thesis
makes one) evaluates f along the previous estimate, and chooses c1, ..., cn so that the integrals of
W (omega' - f) over the step vanish for n weight functions W (eq. 26).
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from pyharness.checks.theory.tableau import basis, grid, tableau
from pyharness.model.assumptions import assumption_records
from pyharness.model.errors import InputError, unknown
from pyharness.model.progress import Progress, no_progress
from pyharness.model.records import build_record, scene_record
from pyharness.model.report import Column, Report, Section, Table, numbers, short, words
from pyharness.model.scene import Scene
from pyharness.model.scene_report import heading
from pyharness.model.trajectory import Array, Trajectory
from pyharness.truth.reference import reference

WEIGHTINGS = ("collocation", "subdomain", "galerkin", "least-squares")
POINTS = ("thesis", "gauss")
MOST_TERMS = 12
MOST_CORRECTIONS = 100
# Largest condition number. Above it points are so close that half of the digits are lost.
_WORST_CONDITION = 1e8
SCHEMES: tuple[tuple[str, str | None], ...] = (
    *(("collocation", points) for points in POINTS),
    *((other, None) for other in WEIGHTINGS[1:]),
)
# Numbers of steps with which each method integrates up to a horizon; each is twice the number two
# places before. Horizons are fractions of the end time: at the first, the leading term of the error
# dominates even with large steps. The next two are for methods whose error at the first is mostly
# rounding, the last three for long scenes.
_LADDER = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192)
_HORIZONS = (1 / 4, 1 / 2, 1, 1 / 16, 1 / 64, 1 / 256)
# Orders are computed from errors in this range, relative to the largest omega at the horizon. Above
# it higher terms of the error matter, below it rounding errors (at most 1e-15).
_LARGEST, _SMALLEST = 1e-2, 5e-14
_SLOPES_WANTED = 4
_SETTLED = 0.1
SLACK = 0.25
MOST_STEPS = 2_000


@dataclass(frozen=True)
class Member:
    """A weighted residual method of the thesis with n = `terms` coefficients.

    The weight functions of least squares are i t**(i-1), for i = 1 to n.
    """

    weighting: str = "collocation"
    terms: int = 2
    # Collocation points: "thesis" (k/(n+1) of the step, k = 1 to n), "gauss" (Gauss-Legendre), or
    # fractions of the step.
    points: str | tuple[float, ...] | None = None
    corrections: int = 1  # of the trial solution, in each step

    def __post_init__(self) -> None:
        if self.weighting not in WEIGHTINGS:
            raise unknown("weighting", self.weighting, WEIGHTINGS)
        if not 1 <= self.terms <= MOST_TERMS:
            raise InputError(f"terms is {self.terms}; allowed: 1 to {MOST_TERMS}")
        if not 0 <= self.corrections <= MOST_CORRECTIONS:
            raise InputError(f"corrections is {self.corrections}; allowed: 0 to {MOST_CORRECTIONS}")
        if self.weighting != "collocation":
            if self.points is not None:
                text = f"points have no meaning with {self.weighting}; allowed: with collocation"
                raise InputError(text)
        elif self.points is None:
            object.__setattr__(self, "points", "thesis")
        elif isinstance(self.points, str):
            if self.points not in POINTS:
                raise unknown("points", self.points, (*POINTS, "a list as in 0.25,0.75"))
        else:
            self._check_points(self.points)

    def _check_points(self, points: Sequence[float]) -> None:
        if len(points) != self.terms:
            text = f"points: {len(points)} given; allowed: as many as there are terms, {self.terms}"
            raise InputError(text)
        for point in points:
            if not 0.0 <= point <= 1.0:
                raise InputError(f"points: {point:g}; allowed: 0 to 1, as fractions of the step")
        if len(set(points)) < len(points):
            raise InputError("points: a collocation point is given twice; give different points")
        if np.linalg.cond(basis(np.array(points), self.terms)) > _WORST_CONDITION:
            raise InputError(
                "points: the collocation points are too close together for double precision; "
                "use points further apart"
            )

    @property
    def points_label(self) -> str:
        if self.points is None:
            return "-"
        if isinstance(self.points, str):
            return self.points
        return ",".join(f"{point:g}" for point in self.points)


def converged_order(member: Member) -> int:
    """Return the order of convergence after many corrections (docs/explanation/methods.md)."""
    n = member.terms
    if member.weighting == "galerkin":
        return n
    if member.weighting == "least-squares":
        return 2 * n
    if member.weighting == "subdomain":
        return n + 1 + (n % 2 == 0)
    nodal = Polynomial.fromroots(grid(member.points, n))
    for power in range(n):
        moment = (nodal * Polynomial.basis(power)).integ()
        if abs(moment(1.0) - moment(0.0)) > 1e-12:
            return n + power
    return 2 * n


def predicted_order(member: Member) -> int:
    return min(member.corrections + 1, converged_order(member))


def run(scene: Scene, member: Member) -> Trajectory:
    """Return a scene's trajectory by a weighted residual method (Jacobs 1982, eq. 20-27, IV.2)."""
    omega = integrate(scene, [member])[0]
    rows = int(np.logical_and.accumulate(np.isfinite(omega).all(axis=1)).sum())
    time = np.array(scene.times()[:rows])
    scheme = tableau(member.weighting, member.terms, member.points)
    overflow = rows < scene.steps
    evaluations = (rows + overflow) * (1 + member.corrections * len(scheme.nodes))
    ended = "overflow" if overflow else "complete"
    return Trajectory(time, time, omega[:rows], None, rows, evaluations, ended)


def integrate(scene: Scene, members: Sequence[Member]) -> Array:
    """Return omega (rad/s) by each method, shape (members, steps, 3).

    Values after an overflow are not finite.
    """
    # Sorted, so that members that need another correction are contiguous in memory.
    order = sorted(range(len(members)), key=lambda i: -members[i].corrections)
    members = [members[i] for i in order]
    schemes = [tableau(m.weighting, m.terms, m.points) for m in members]
    width = max(len(scheme.nodes) for scheme in schemes)
    # Padding nodes have weight 0.
    nodes = np.zeros((len(members), width))
    matrix = np.zeros((len(members), width, width))
    weights = np.zeros((len(members), 1, width))
    for i, scheme in enumerate(schemes):
        m = len(scheme.nodes)
        nodes[i, :m], weights[i, 0, :m] = scheme.nodes, scheme.weights
        matrix[i, :m, :m] = scheme.matrix
    across = np.ascontiguousarray(matrix.transpose(1, 2, 0))
    most = members[0].corrections
    going = [sum(m.corrections >= k for m in members) for k in range(most + 2)]
    h = scene.step_size
    result = np.full((len(members), scene.steps, 3), math.nan)
    start = np.tile(np.array(scene.omega), (len(members), 1, 1))
    with np.errstate(all="ignore"):
        for step in range(scene.steps):
            begin = step * h
            rates = _rates(scene, _torque(scene, np.array([begin])), start)
            end = start + h * rates
            estimate = start + h * nodes[:, :, None] * rates
            torque = _torque(scene, begin + h * nodes)
            for k in range(1, most + 1):
                n, rest = going[k], going[k + 1]
                rates = _rates(scene, torque[:n] if scene.torque.varies else torque, estimate[:n])
                end[rest:n] = start[rest:n] + h * _sums(weights[rest:n], rates[rest:])
                estimate = start[:rest] + h * _stages(across[..., :rest], rates[:rest])
            start = end
            result[:, step] = end[:, 0]
            if not np.isfinite(end).any():
                break
    found = np.empty_like(result)
    found[order] = result
    return found


def _stages(matrix: Array, rates: Array) -> Array:
    """Return matrices (i, j, members) times rates, three times as fast as by `_sums`."""
    side_by_side = np.ascontiguousarray(rates.transpose(1, 2, 0))
    total: Array = matrix[:, 0, None] * side_by_side[0]
    product = np.empty_like(total)
    for j in range(1, matrix.shape[1]):
        np.multiply(matrix[:, j, None], side_by_side[j], out=product)
        total += product
    return np.asarray(total.transpose(2, 0, 1))


def _sums(factors: Array, rates: Array) -> Array:
    """Return factors (members, i, j) times rates (members, j, 3), without BLAS."""
    return np.asarray(np.einsum("mij,mjk->mik", factors, rates))


def _rates(scene: Scene, torque: Array, omega: Array) -> Array:
    rates = np.empty(omega.shape)  # in C order, because NumPy's rounding depends on the layout
    for i, (a, j, k) in enumerate(zip(scene.euler_coefficients, (1, 0, 0), (2, 2, 1), strict=True)):
        rates[..., i] = torque[..., i] + a * omega[..., j] * omega[..., k]
    return rates


def _torque(scene: Scene, times: Array) -> Array:
    """Return the torque divided by the moments (rad/s2) at `times` (s), shape (..., 3)."""
    law = scene.body_torque
    torque = np.array(law.constant)
    if law.varies:
        t = times[..., None]
        torque = torque + np.array(law.rate) * t
        for waves, function in ((law.sines, np.sin), (law.cosines, np.cos)):
            for amplitude, frequency in waves:
                torque = torque + np.array(amplitude) * function(frequency * t)
    return torque if scene.moments is None else torque / np.array(scene.moments)


@dataclass(frozen=True)
class OrderFinding:
    """A method's predicted and measured order of convergence in a scene, and error."""

    member: Member
    predicted: int
    measured: float | None  # None if too few errors are in the usable range
    settled: bool  # whether the last two measurements differ by at most 0.1
    error: float  # largest error of omega (rad/s) with the scene's step size

    @property
    def deviation(self) -> float:
        return math.nan if self.measured is None else self.measured - self.predicted

    @property
    def misses(self) -> bool:
        """Whether the measured order is below the predicted one; in special scenes it is above."""
        return self.settled and self.deviation < -SLACK


def family_members() -> list[Member]:
    return [Member(w, n, p, k) for w, p in SCHEMES for n in range(1, 6) for k in range(1, 9)]


def order_table(
    scene: Scene, members: Sequence[Member] | None = None, progress: Progress = no_progress
) -> list[OrderFinding]:
    """Return each method's order of convergence and error, by default of `family_members`.

    The solution must be bounded.
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
            # Two slopes may agree by chance, so that too low an order must be so at every horizon.
            settled = doubt <= _SETTLED and not _too_low(slopes[-1], chosen[i])
            if settled or doubt < doubts[i]:
                measured[i], doubts[i] = slopes[-1], doubt
        open_ones = [
            i for i in open_ones if doubts[i] > _SETTLED or _too_low(measured[i], chosen[i])
        ]
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


def _too_low(order: float | None, member: Member) -> bool:
    return order is not None and order < predicted_order(member) - SLACK


def _ladder(scene: Scene, members: Sequence[Member], horizon: float, end: Array) -> Array:
    """Return the relative errors of omega at `horizon` (s), shape (step sizes, members)."""
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
    """Return the order from each usable pair of errors with a ratio of step sizes of 2."""
    return [
        math.log2(coarse / fine)
        for coarse, fine in zip(errors[:-2], errors[2:], strict=True)
        # The ratio is 0 if the coarse error is 0 or the fine one infinite.
        if coarse < _LARGEST and fine > _SMALLEST and coarse / fine > 0.0
    ]


def family_report(scene: Scene, found: Sequence[OrderFinding]) -> Report:
    names = ("predicted", "measured", "settled", "error")
    members = [each.member for each in found]
    measures = [{name: getattr(each, name) for name in names} for each in found]
    methods = [[x.weighting, x.points_label, x.terms, x.corrections] for x in members]
    data = [[*method, *own.values()] for method, own in zip(methods, measures, strict=True)]
    page = [heading(scene), [*_finding(found), *verdict(found)], *_tables(found)]
    whole = [asdict(member) | own for member, own in zip(members, measures, strict=True)]

    def record() -> dict[str, Any]:
        told = {"scene": scene_record(scene), "members": whole, "unexpected": _unexpected(found)}
        return told | {"build": build_record(), "assumptions": assumption_records([(scene, [])])}

    heads = "weighting points terms corrections predicted measured settled error"
    return Report("family", page, record, numbers(heads, data), page)


def _finding(found: Sequence[OrderFinding]) -> list[str]:
    alike = (each.measured for each in found if each.member.corrections == 1)
    orders = Counter(round(order) for order in alike if order is not None)
    if orders.total() < 2:
        return []
    (order, number), *_ = orders.most_common(1)
    best = max(found, key=lambda each: each.predicted)
    return [
        f"With one correction, as in the programs of the thesis, {number} of {orders.total()} "
        f"methods have order {order}, whatever their number of terms; with "
        f"{best.member.corrections} corrections the highest order is {best.predicted}."
    ]


def verdict(found: Sequence[OrderFinding]) -> list[str]:
    """Return a sentence for each unexpected order or, if there is none, a summary."""
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

    legend = (
        "Each cell: order derived / order measured, with n terms and k corrections. ?: the "
        "measured order did not converge before rounding errors dominated."
    )
    errors: Section = ["Largest error of any component of omega (rad/s):", table(_error)]
    return [[legend, table(_order)], errors]


def _order(each: OrderFinding | None) -> str:
    if each is None:
        return ""
    measured = "-" if math.isnan(each.deviation) else f"{each.measured:.2f}"
    return f"{each.predicted}/{measured}{'' if each.settled or measured == '-' else '?'}"


def _error(each: OrderFinding | None) -> str:
    return "" if each is None else short(each.error)
