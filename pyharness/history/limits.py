"""The limits of the original programs as the step size goes to zero.

An original program may converge to the solution of Euler's equations, to another function, or not
at all (docs/article/article.md). Each limit is computed independently of the program, and compared
with runs at halved step sizes. `effort` multiplies the work limit.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from pyharness.model.assumptions import assumption_records
from pyharness.model.effort import advice
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset
from pyharness.model.records import scene_record
from pyharness.model.report import Column, Report, Section, Table, digits, short, words
from pyharness.model.scene import Scene
from pyharness.model.scene_report import heading
from pyharness.model.trajectory import Array
from pyharness.thesis.programs import run_program
from pyharness.truth.reference import Reference, reference

_TOLERANCE = 1e-11
_MOST_EVALUATIONS = 1_000_000  # evaluated in some ten seconds

TENDS_TO = {
    "two-term": "the solution of w' = F(w) - (2/9) t^2 Q(F(w)), Q the quadratic part of F",
    "four-term": "the true solution",
    "runge-kutta": "2 y(t/2) - y(0), y the true solution",
}
SLOW_SLOPES = "w' = F(p, t) with p' = F(p, t) / 2, p(0) = w(0)"
NOTHING = "nothing: TIME = t^2/(2h) + t/2 grows without bound"

_STEP = digits("g")
_COLUMNS = (
    Column("step", _STEP, unit="s", full=_STEP),
    Column("from the limit", short, unit="rad/s"),
    Column("from the truth", short, unit="rad/s"),
)

_ENDS = (
    *words("program"), Column("order", digits(".2f")),
    Column("from the truth", short, unit="rad/s"), Column("tends to", left=True, fit="wrap"),
)  # fmt: skip

Rate = Callable[[float, Sequence[float]], list[float]]


@dataclass(frozen=True)
class Halving:
    """A run's largest distances (rad/s) from limit and true solution; inf after an overflow."""

    step_size: float
    from_limit: float
    from_truth: float


@dataclass(frozen=True)
class Limit:
    """The convergence of an original program as the step size goes to zero."""

    program: str
    tends_to: str
    halvings: tuple[Halving, ...]
    order: float | None  # order of convergence from the last two step sizes, if measurable
    blow_up: float | None = None  # time (s) at which the limit becomes unbounded

    @property
    def approach(self) -> str:
        if self.blow_up is not None:
            return f"no order: the limit grows without bound at t = {self.blow_up:.3g} s"
        if self.order is not None:
            return f"order {self.order:.2f} toward the limit"
        last = self.halvings[-1].from_limit
        return "rounding" if math.isfinite(last) else "no order: no limit, or an overflow"


def limit(program: str, scene: Scene, halvings: int = 6, effort: float = 1.0) -> Limit:
    """Return the convergence of an original program, without the stop test, to its limit.

    Under a varying torque only the Runge-Kutta program has a limit.
    """
    times = scene.times()
    truth = reference(scene, times, effort=effort)
    wanted, tends_to, blow_up = limit_solution(program, scene, times, truth, effort)
    found = []
    for parts in (2**k for k in range(halvings + 1)):
        finer = replace(scene, step_size=scene.step_size / parts, steps=scene.steps * parts)
        run = run_program(
            finer, Listing.original(program), may_stop=False, velocity=False, effort=effort
        )
        omega = run.omega[parts - 1 :: parts]
        complete = run.ended == "complete"
        distances = (
            float(np.abs(omega - goal).max()) if complete and len(goal) == len(omega) else math.inf
            for goal in (wanted, truth.omega)
        )
        found.append(Halving(finer.step_size, *distances))
    last, before = found[-1].from_limit, found[-2].from_limit
    scale = float(np.abs(truth.omega).max(initial=0.0))
    # Bound on the rounding errors of all steps.
    noise = 2.0**-50 * scale * scene.steps * 2**halvings
    finite = math.isfinite(before) and math.isfinite(last) and last > noise
    order = math.log2(before / last) if finite else None
    return Limit(program, tends_to, tuple(found), order, blow_up)


def limit_solution(
    program: str, scene: Scene, times: Sequence[float], truth: Reference, effort: float = 1.0
) -> tuple[Array, str, float | None]:
    """Return an original program's limit: omega (rad/s), description, and blow-up time (s) or None.

    Omega has the shape (times, 3), and is NaN without a limit.
    """
    scale = float(np.abs([scene.omega, *truth.omega]).max()) or 1.0
    start = list(scene.omega)
    if program == "runge-kutta":
        if not scene.torque.varies:
            half = reference(scene, [t / 2.0 for t in times], effort=effort)
            return 2.0 * half.omega - np.array(scene.omega), TENDS_TO[program], None
        rows, end = _solved(_slow_slopes(scene), start + start, times, scale, effort)
        return rows[:, 3:], SLOW_SLOPES, end
    if scene.torque.varies:
        return np.full((len(times), 3), math.nan), NOTHING, None
    if program == "four-term":
        return truth.omega, TENDS_TO[program], None
    rows, end = _solved(_extrapolated(scene), start, times, scale, effort)
    return rows, TENDS_TO[program], end


def _extrapolated(scene: Scene) -> Rate:
    """Return the right-hand side of the equation of the two-term program's limit."""
    # The original program adds the step size h to DT in every step. In step n the collocation
    # points are therefore t/3 and 2t/3 after the beginning of the step, with t = n h. Let F be the
    # right-hand side of Euler's equations at w, F' its Jacobian, and Q its quadratic part. The
    # slope along the first estimate is g(s) = F(w + s F) = F + s F' F + s^2 Q(F). At s = 0 the line
    # through g(t/3) and g(2t/3) has the value 2 g(t/3) - g(2t/3) = F - (2/9) t^2 Q(F).
    right_hand_side = scene.right_hand_side()
    a, b, c = scene.euler_coefficients

    def rate(t: float, omega: Sequence[float]) -> list[float]:
        f = right_hand_side(t, omega)
        quadratic = (a * f[1] * f[2], b * f[0] * f[2], c * f[0] * f[1])
        return [x - 2.0 / 9.0 * t * t * q for x, q in zip(f, quadratic, strict=True)]

    return rate


def _slow_slopes(scene: Scene) -> Rate:
    """Return the right-hand side of the equation of the Runge-Kutta program's limit."""
    # Let p be the omega in U(1), at which a step's first slopes are evaluated, and F the right-hand
    # side of Euler's equations. Each step of size h adds (h/2) F(p) to p, and h F(p) to the printed
    # omega. The state has p, then the printed omega.
    right_hand_side = scene.right_hand_side()

    def rate(t: float, state: Sequence[float]) -> list[float]:
        f = right_hand_side(t, state[:3])
        return [x / 2.0 for x in f] + f

    return rate


def _solved(
    rate: Rate, start: list[float], times: Sequence[float], scale: float, effort: float
) -> tuple[Array, float | None]:
    """Return the solution, NaN after a blow-up, and the time (s) of the blow-up or None."""
    from scipy.integrate import solve_ivp

    evaluations, latest = 0, 0.0
    most = effort * _MOST_EVALUATIONS

    def counted(time: float, state: Sequence[float]) -> list[float]:
        nonlocal evaluations, latest
        evaluations += 1
        latest = max(latest, time)
        if evaluations > most:
            needed = effort * times[-1] / time if time else None
            raise InputError(
                f"limits: no limit found beyond t = {time:.6g} s after {most:.0f} right-hand "
                "sides; " + advice("use fewer or smaller steps", effort, needed)
            )
        return rate(time, state)

    def bounded(time: float, state: Sequence[float]) -> float:
        return 1e6 * scale - max(map(abs, state))

    bounded.terminal = True  # type: ignore[attr-defined]
    with np.errstate(all="ignore"):
        result = solve_ivp(
            counted, (0.0, times[-1]), start, method="DOP853", t_eval=times, events=bounded,
            rtol=_TOLERANCE, atol=_TOLERANCE * scale,
        )  # fmt: skip
    rows = np.full((len(times), len(start)), math.nan)
    if len(result.t):  # without any time, y is an empty list
        rows[: len(result.t)] = result.y.T
    # The solver may end just before the bound, if the step size becomes too small.
    return rows, latest if result.status else None


def invisible(scene: Scene) -> dict[str, tuple[str, ...]]:
    """Return by program the defects whose correction changes omega only by rounding errors."""
    found = {}
    for program in PROGRAMS:
        before = run_program(scene, Listing.original(program))
        names = []
        for name in names_of("defect", program):
            after = run_program(scene, subset(program, "original", fix=[name]))
            if (after.steps, after.ended) == (before.steps, before.ended):
                scale = float(np.abs(before.omega).max(initial=0.0))
                if np.abs(before.omega - after.omega).max(initial=0.0) <= 1e-11 * scale:
                    names.append(name)
        found[program] = tuple(names)
    return found


def limits_report(
    scene: Scene, found: Sequence[Limit], invisible: Mapping[str, Sequence[str]]
) -> Report:
    ends = [[x.program, x.order, x.halvings[-1].from_truth, x.tends_to] for x in found]
    hidden = [f"{each.program}: {', '.join(invisible[each.program]) or 'none'}" for each in found]
    listings = [Listing.original(each.program) for each in found]
    head = (
        "Limits of the original programs as the step shrinks, with the order of convergence, "
        "and the distance from the true solution at the smallest step (rad/s):"
    )
    text: list[Section] = [heading(scene, listings), [head, Table(_ENDS, ends)]]
    text.append(["defects that change no omega here, corrected alone:", "; ".join(hidden)])
    data = []
    for each in found:
        rows = [[h.step_size, h.from_limit, h.from_truth] for h in each.halvings]
        data += [[each.program, *row] for row in rows]
        text.append([f"original {each.program}:", Table(_COLUMNS, rows), each.approach])

    def record() -> dict[str, Any]:
        hidden = {name: list(each) for name, each in invisible.items()}
        told = {"scene": scene_record(scene), "limits": list(map(asdict, found))}
        return told | {"invisible": hidden, "assumptions": assumption_records([(scene, listings)])}

    return Report("limits", text, record, Table((Column("program"), *_COLUMNS), data))
