"""Methods against the truth: within their tolerance, and with their order."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import product

import numpy as np

from pyharness.checks.check import REFUSED, Check, bounded
from pyharness.checks.selection import Selection, replay
from pyharness.compare.agreement import ulps
from pyharness.compare.candidates import called, listed, solved
from pyharness.compare.orders import Order, measured_order, order_of
from pyharness.methods.plan import FEW_DIGITS
from pyharness.methods.problem import closed_form, normalized
from pyharness.methods.registry import FIXED_STEP, GAUSS, METHODS, SCIPY_METHODS
from pyharness.methods.solve import finest
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.listing import PROGRAMS, corrected
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.trajectory import Array
from pyharness.original.programs import PROGRAM_REGISTRY
from pyharness.theory.conditioning import Conditioning, conditioning
from pyharness.truth.reference import Reference, reference

_TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
# Of solve_ivp no more is asked than it answers in a second.
_SCIPY_TOLERANCES = (1e-6, 1e-9)
_LATER = 3.0
_ENDS = (1.0, 3.0, -1.0)
_PREPARED = ("auto", "taylor", "quick", "closed-form")
# The truth that solve_ivp gives is asked for as finely as it goes.
_IVP = "dop853"
# Halvings in which an order has to show, one after another, and what may be missing in the last;
# .006 is at the most.
_PAIRS = 4
_ORDER_SLACK = 0.2


# The truth at some times, the last one the furthest from 0, and what no method can be blamed for:
# what becomes of small errors, the truth's own among them.
Standard = tuple[Reference, Conditioning]


def methods(chosen: Selection) -> Iterator[Check]:
    """Hold every method that states an error against the reference, in every case."""
    for case in (4, 5) if chosen.thin else case_numbers():
        scene = case_scene(case)
        # All results of the case, close together, and one far from them.
        standard = cache(partial(_standard, scene, (*scene.times(), _LATER)))
        for name, method in METHODS.items():
            if method.finest < 1.0 and name != "reference":
                for tolerance in _tolerances(name, method.finest, chosen.thin):
                    if chosen.asks(id := f"methods/{name}/case-{case}/{tolerance:.1e}"):
                        yield _held(id, scene, name, tolerance, standard())


def prepared(chosen: Selection) -> Iterator[Check]:
    """Hold prepared solvers against the reference, forward and backward."""
    for case in (4, 5) if chosen.thin else case_numbers():
        scene = case_scene(case)
        forms = _PREPARED if closed_form(scene) else _PREPARED[:-1]
        for t_end in _ENDS:
            standard = cache(partial(_standard, scene, (t_end,)))
            for name, tolerance in product(forms, (1e-6,) if chosen.thin else _TOLERANCES):
                id = f"prepared/{name}/case-{case}/{t_end:g}/{tolerance:.1e}"
                if chosen.asks(id) and not (name == "quick" and tolerance < FEW_DIGITS):
                    yield _held_prepared(id, scene, name, tolerance, standard())
        yield from _same_steps(chosen, scene, case)


def _same_steps(chosen: Selection, scene: Scene, case: int) -> Iterator[Check]:
    """Hold prepared solvers in the scene's own steps to the bits of the kernel itself."""
    for name in (*FIXED_STEP, *GAUSS):
        id = f"prepared/{name}/case-{case}/bits"
        if not chosen.asks(id):
            continue
        time = 100.0 * scene.step_size
        found = called(name, 1.0).end(scene, time).omega
        if name in FIXED_STEP:
            wanted = solved(name, 1.0).end(scene, time).omega
        else:
            way = int(name.partition("-")[2]), scene.step_size
            rows, *_ = extension().gauss_solution(*normalized(scene), scene.omega, [time], *way)
            wanted = rows[:, 0]
        yield bounded(id, ulps(found, np.ascontiguousarray(wanted)), 0.0, replay(id))


def orders(chosen: Selection) -> Iterator[Check]:
    """Measure orders: of corrected programs by `solve_ivp`, of methods by the reference.

    That of the programs' velocity too, against the reference: no other method has one. The value
    is what is missing to the order that is due.
    """
    for case in (5,) if chosen.thin else case_numbers():
        scene = case_scene(case)
        by_ivp = cache(partial(_by_ivp, scene))
        by_reference = cache(partial(reference, scene, scene.times()))
        for name in PROGRAMS:
            if chosen.asks(id := f"orders/{name}/case-{case}"):
                program = PROGRAM_REGISTRY[name]
                found = measured_order(scene, program, corrected(name), by_ivp(), _PAIRS)
                yield _order(id, found)
        for name in PROGRAMS:
            if chosen.asks(id := f"orders/{name}/case-{case}/velocity"):
                truth, due = by_reference(velocity=True), PROGRAM_REGISTRY[name].order
                found = order_of(scene, _velocity_of(name), due, truth, "velocity", _PAIRS)
                yield _order(id, found)
        for name in FIXED_STEP:
            if chosen.asks(id := f"orders/{name}/case-{case}"):
                due = METHODS[name].order
                found = order_of(scene, _steps_of(name), due, by_reference(), pairs=_PAIRS)
                yield _order(id, found)


def _standard(scene: Scene, times: Sequence[float]) -> Standard:
    """Return the truth at `times` with its limits.

    In the cases a tolerance is meant as it stands: nothing but rounding is granted to the flow.
    """
    flow = conditioning(scene, times[-1])
    # The reference's steps are good to 1e-22: where the flow amplifies more, more is asked.
    truth = reference(scene, times, precise=flow.amplification > 1e3)
    rounding = flow.rounding + truth.error / flow.largest
    return truth, replace(flow, amplification=1.0, rounding=rounding)


def _held(id: str, scene: Scene, name: str, tolerance: float, standard: Standard) -> Check:
    """Return the check that a method keeps a tolerance at all times of the truth.

    A closed form has to refuse where there is none.
    """
    truth, flow = standard
    has_form = name != "closed-form" or closed_form(scene) is not None
    times, again = truth.time, replay(id)
    try:
        run = solved(name, tolerance).rows(scene, times.tolist())
    except InputError as refusal:
        return Check(id, not has_form, None, None, again, f"{REFUSED}{refusal}")
    if not has_form:
        return Check(id, False, None, None, again, "solved what has no closed form")
    if not run.has_all_rows or not np.array_equal(run.time, times):
        return Check(id, False, None, None, again, f"{run.ended}, other times than asked for")
    error = float(np.abs(run.omega - truth.omega).max()) / flow.largest
    return bounded(id, error, flow.limit(tolerance), again)


def _held_prepared(id: str, scene: Scene, name: str, tolerance: float, standard: Standard) -> Check:
    """Return the check that a prepared solver keeps a tolerance at the end."""
    truth, flow = standard
    end = called(name, tolerance, primed=True).end(scene, float(truth.time[-1]))
    if name == "quick" and end.is_refused:
        # Its unknowns need three products.
        may = end.ended == "refused" and not all(scene.euler_coefficients)
        return Check(id, may, None, None, replay(id), f"{REFUSED}{end.ended}")
    error = float(np.abs(end.omega - truth.omega[-1]).max()) / flow.largest
    note = end.ended if math.isnan(error) else ""
    return bounded(id, error, flow.limit(tolerance), replay(id), note)


def _tolerances(name: str, finest: float, thin: bool) -> list[float]:
    if name in SCIPY_METHODS:
        return [_SCIPY_TOLERANCES[0]] if thin else list(_SCIPY_TOLERANCES)
    if thin:
        return [max(finest, 1e-9)]
    return [*(each for each in _TOLERANCES if each > finest), finest]


def _order(id: str, found: Order) -> Check:
    """Return the check that the order is as due; what the cases can't judge fails."""
    missing = None if found.value is None else found.due - found.value
    passed = found.state in ("as due", "rounding") and (missing or 0.0) <= _ORDER_SLACK
    return Check(id, passed, missing, _ORDER_SLACK, replay(id), str(found))


def _steps_of(name: str) -> Callable[[Scene], Array]:
    return lambda scene: solved(name, 1.0).rows(scene).omega


def _velocity_of(program: str) -> Callable[[Scene], Array]:
    def run(scene: Scene) -> Array:
        velocity = listed(corrected(program), may_stop=False).rows(scene).velocity
        # None is as good as no rows: nothing settles.
        return np.empty((0, 3)) if velocity is None else velocity

    return run


def _by_ivp(scene: Scene) -> Reference:
    """Return what `solve_ivp` takes for the truth, good to its tolerance."""
    tolerance = 1.01 * finest(_IVP, scene, scene.times()[-1])
    run = solved(_IVP, tolerance).rows(scene)
    largest = float(np.abs(run.omega).max())
    return Reference(run.time, run.omega, None, "solve_ivp", tolerance * largest)
