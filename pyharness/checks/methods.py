"""Checks of methods against the reference in the cases of Table 1 of the thesis.

The limit of an error is the tolerance. Errors of omega are relative to the largest omega; errors of
the attitude are angles (rad).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from pyharness.checks.check import BITS, Attempt, Check, Name, Selection
from pyharness.checks.compare.agreement import ulps
from pyharness.checks.compare.candidates import (
    method_candidate,
    prepared_candidate,
    program_candidate,
)
from pyharness.checks.compare.orders import Order, measured_order, order_of
from pyharness.checks.judge import (
    AS_STATED,
    MethodRun,
    Truth,
    by_end,
    by_rows,
    judge,
    reference_truth,
)
from pyharness.checks.tolerances import FEW_DIGITS, OF_CASES, of_case
from pyharness.engine.plan.registry import FIXED_STEP, GAUSS, METHODS, SCIPY_METHODS
from pyharness.engine.solve import finest
from pyharness.engine.system.kernel_input import closed_form, normalized
from pyharness.model.attitude import Quaternion
from pyharness.model.basis import Basis
from pyharness.model.extension import extension
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.thesis.programs import PROGRAM_REGISTRY
from pyharness.truth.reference import Reference, reference

START: Quaternion = (0.5, -0.1, 0.7, 0.5)
# Times (s): one long after the end of the cases, and those for prepared solvers.
_LATER = 3.0
_ENDS = (1.0, 3.0, -1.0)
# Methods with a tolerance, without those for weak torques, which no case has.
_TOLERANT = {x: each for x, each in METHODS.items() if each.finest < 1.0 and x != "reference"}
_SOLVED = tuple(name for name, each in _TOLERANT.items() if not each.weak_torque)
_TURNED = tuple(name for name in _SOLVED if METHODS[name].attitude)
_PREPARED = ("auto", "taylor", "quick", "closed-form")
_PREPARED_TURNED = ("auto", "taylor")


def methods(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks of omega by every method, at each case's times and at 3 s."""
    for case in cases(chosen):
        scene = case_scene(case)
        yield from _solved("methods", case, scene, (*scene.times(), _LATER), _SOLVED, chosen.thin)


def prepared(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks of prepared solvers, with a fixed step against the method, bit for bit."""
    for case in cases(chosen):
        scene = case_scene(case)
        forms = _PREPARED if closed_form(scene) else _PREPARED[:-1]
        yield from _prepared(Name("prepared"), case, scene, forms, chosen.thin)
        for method in (*FIXED_STEP, *GAUSS):
            name = Name("prepared", method, f"case-{case}", quantity="bits")
            yield Attempt(name, partial(_same_steps, scene))


def attitudes(chosen: Selection) -> Iterator[Attempt]:
    for case in cases(chosen):
        scene = replace(case_scene(case), attitude=START)
        times = (*scene.times()[9::10], _LATER)
        yield from _solved("attitudes", case, scene, times, _TURNED, chosen.thin)
        name = Name("attitudes", "prepared-")
        yield from _prepared(name, case, scene, _PREPARED_TURNED, chosen.thin)


def cases(chosen: Selection, thin: Sequence[int] = (4, 5)) -> Sequence[int]:
    return thin if chosen.thin else list(case_numbers())


def _solved(
    suite: str, case: int, scene: Scene, times: Sequence[float], names: Sequence[str], thin: bool
) -> Iterator[Attempt]:
    truth = cache(partial(reference_truth, scene, times))
    for method in names:
        for tolerance in of_case(method, thin):
            name = Name(suite, method, f"case-{case}", f"{tolerance:.1e}")
            tried = partial(run_of_solve, method, tolerance, scene, times)
            yield Attempt(name, partial(_judged, tried, truth))


def _prepared(
    name: Name, case: int, scene: Scene, methods: Sequence[str], thin: bool
) -> Iterator[Attempt]:
    for time in _ENDS:
        truth = cache(partial(reference_truth, scene, (time,)))
        where = replace(name, circumstance=f"case-{case}/{time:g}")
        for method in methods:
            for tolerance in (1e-6,) if thin else OF_CASES:
                if method == "quick" and tolerance < FEW_DIGITS:
                    continue
                own = replace(where, subject=name.subject + method, setting=f"{tolerance:.1e}")
                tried = partial(run_of_call, method, tolerance, scene, time)
                yield Attempt(own, partial(_judged, tried, truth))


def run_of_solve(method: str, tolerance: float, scene: Scene, times: Sequence[float]) -> MethodRun:
    """Return a deferred run by `solve` at `times` (s), at a tolerance that SciPy meets."""
    if method in SCIPY_METHODS and scene.attitude:
        # SciPy's methods cannot meet a smaller tolerance over a long time.
        tolerance = max(tolerance, 1.01 * finest(method, scene, times[-1]))
    return by_rows(method, tolerance, scene, times)


def run_of_call(method: str, tolerance: float, scene: Scene, time: float) -> MethodRun:
    """Return a deferred call of a prepared solver to `time` (s), after one with another omega."""
    candidate = prepared_candidate(method, tolerance, primed=True, attitude=bool(scene.attitude))
    return by_end(method, candidate, tolerance, scene, time)


def _judged(tried: Callable[[], MethodRun], truth: Callable[[], Truth], name: Name) -> Check:
    return judge(name, tried(), truth(), AS_STATED)


def _same_steps(scene: Scene, name: Name) -> Check:
    """Return the check that a prepared solver equals `solve`, or the kernel, after 100 steps."""
    method, time = name.subject, 100.0 * scene.step_size
    found = prepared_candidate(method, 1.0).end(scene, time).omega
    if method in FIXED_STEP:
        wanted = method_candidate(method, 1.0).end(scene, time).omega
    else:
        steps = int(method.partition("-")[2]), scene.step_size
        rows, *_ = extension().gauss_solution(*normalized(scene), scene.omega, [time], *steps)
        wanted = rows[:, 0]
    return name.bounded(ulps(found, np.ascontiguousarray(wanted)), 0.0, BITS)


# The method of SciPy's solve_ivp that serves as true solution, at its finest tolerance.
_IVP = "dop853"
# Number of successive halvings of the step size that must show the order, and largest allowed
# deficit of the last measured order.
_PAIRS = 4
_ORDER_SLACK = 0.2
_SLACK = Basis(
    "measured",
    "order of a method with a fixed step: at most 0.2 below the theoretical one",
    "`pyharness verify --only orders`, where the largest deficit is .006",
)
# Numbers of steps in the coarsest and the finest run.
_FEWEST, _MOST = 16, 4096


def orders(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks of orders of convergence; a value is theoretical minus measured order."""
    for case in cases(chosen, (5,)):
        scene = case_scene(case)
        known = cache(partial(reference, scene, scene.times()))
        by_ivp = cache(partial(_by_ivp, scene))
        for name in PROGRAMS:
            yield Attempt(Name("orders", name, f"case-{case}"), partial(_of_program, scene, by_ivp))
        for name in PROGRAMS:
            where = Name("orders", name, f"case-{case}", quantity="velocity")
            yield Attempt(where, partial(_of_velocity, scene, known))
        for name in FIXED_STEP:
            yield Attempt(Name("orders", name, f"case-{case}"), partial(_of_method, scene, known))


def _of_program(scene: Scene, truth: Callable[[], Reference], name: Name) -> Check:
    program, listing = PROGRAM_REGISTRY[name.subject], Listing.corrected(name.subject)
    return judged_order(name, measured_order(scene, program, listing, truth(), _PAIRS))


def _of_velocity(scene: Scene, truth: Callable[..., Reference], name: Name) -> Check:
    run = program_candidate(Listing.corrected(name.subject), may_stop=False).rows

    def velocity(scene: Scene) -> Array:
        found = run(scene).velocity
        # Without a velocity the order is undecided, as without rows.
        return np.empty((0, 3)) if found is None else found

    due, known = PROGRAM_REGISTRY[name.subject].order, truth(velocity=True)
    return judged_order(name, order_of(scene, velocity, due, known, "velocity", _PAIRS))


def _of_method(scene: Scene, truth: Callable[[], Reference], name: Name) -> Check:
    return judged_order(name, _order_of_method(scene, name.subject, truth(), pairs=_PAIRS))


def _order_of_method(scene: Scene, method: str, truth: Reference, **limits: Any) -> Order:
    run = method_candidate(method, 1.0).rows
    due = METHODS[method].order
    return order_of(scene, lambda finer: run(finer).omega, due, truth, **limits)


def in_few_steps(scene: Scene, time: float) -> Scene:
    return replace(scene, step_size=time / _FEWEST, steps=_FEWEST)


def order_if_seen(scene: Scene, truth: Callable[[], Reference], name: Name) -> Check:
    """Return the check of a fixed-step method's order of convergence.

    It passes if the order is undecided or the torque has a table, which lowers the order.
    """
    method = name.setting or name.subject
    found = _order_of_method(scene, method, truth(), most_steps=_MOST)
    tape = scene.torque.tape if isinstance(scene.torque, StateTorque) else None
    has_tables = tape is not None and any(each.table for each in tape.operations)
    if found.is_judged and not has_tables:
        return judged_order(name, found)
    return name.described(None, str(found))


def judged_order(name: Name, found: Order) -> Check:
    """Return the check that `found` is at most 0.2 too low, or that all errors are rounding."""
    missing = None if found.value is None else found.due - found.value
    passed = found.state in ("as due", "rounding") and (missing or 0.0) <= _ORDER_SLACK
    return name.judged(passed, str(found), missing, _ORDER_SLACK, _SLACK)


def _by_ivp(scene: Scene) -> Reference:
    tolerance = 1.01 * finest(_IVP, scene, scene.times()[-1])
    run = method_candidate(_IVP, tolerance).rows(scene)
    largest = float(np.abs(run.omega).max())
    return Reference(run.time, run.omega, None, "solve_ivp", tolerance * largest)
