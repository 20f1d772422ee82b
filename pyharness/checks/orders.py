"""Checks of methods' orders: powers of the step size with which errors decrease.

Programs are compared with `solve_ivp`. Methods with a fixed step are compared with the reference,
and so is the programs' translational velocity, which no other method computes.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from pyharness.checks.check import Attempt, Check, Name, Selection
from pyharness.checks.compare.candidates import method_candidate, program_candidate
from pyharness.checks.compare.orders import Order, measured_order, order_of
from pyharness.checks.methods import cases
from pyharness.engine.registry import FIXED_STEP, METHODS
from pyharness.engine.solve import finest
from pyharness.model.basis import Basis
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.thesis.programs import PROGRAM_REGISTRY
from pyharness.truth.reference import Reference, reference

# The method of solve_ivp that serves as true solution, at its finest tolerance.
_IVP = "dop853"
# Number of successive halvings that must show the order, and the largest deficit in the last. The
# largest deficit that occurs is .006.
_PAIRS = 4
_ORDER_SLACK = 0.2
_SLACK = Basis(
    "measured",
    "order of a method with a fixed step: at most 0.2 below the theoretical one",
    "`pyharness verify --only orders`, where the largest deficit is .006",
)
# Numbers of steps in the coarsest and the finest run from which an order is measured.
_FEWEST, _MOST = 16, 4096


def orders(chosen: Selection) -> Iterator[Attempt]:
    """Yield deferred checks of orders; the value is the theoretical minus the measured one."""
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
        # A run without velocity counts as one without rows, whose order is undecided.
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
    """Return a scene with `_FEWEST` steps until `time` (s), the coarsest run for an order."""
    return replace(scene, step_size=time / _FEWEST, steps=_FEWEST)


def order_if_seen(scene: Scene, truth: Callable[[], Reference], name: Name) -> Check:
    """Return the check of the order of a fixed-step method, the setting or subject of `name`.

    The order is only reported if the scene is too fast or sensitive for at most 4096 steps, or the
    torque has a table. Steps do not end where a table changes, which lowers the order.
    """
    method = name.setting or name.subject
    found = _order_of_method(scene, method, truth(), most_steps=_MOST)
    tape = scene.torque.tape if isinstance(scene.torque, StateTorque) else None
    has_tables = tape is not None and any(each.table for each in tape.operations)
    if found.is_judged and not has_tables:
        return judged_order(name, found)
    return name.described(None, str(found))


def judged_order(name: Name, found: Order) -> Check:
    """Return the check that an order is at most `_ORDER_SLACK` too low, or errors are rounding."""
    missing = None if found.value is None else found.due - found.value
    passed = found.state in ("as due", "rounding") and (missing or 0.0) <= _ORDER_SLACK
    return name.judged(passed, str(found), missing, _ORDER_SLACK, _SLACK)


def _by_ivp(scene: Scene) -> Reference:
    """Return the solution by `solve_ivp`, with its tolerance (rad/s) as error."""
    tolerance = 1.01 * finest(_IVP, scene, scene.times()[-1])
    run = method_candidate(_IVP, tolerance).rows(scene)
    largest = float(np.abs(run.omega).max())
    return Reference(run.time, run.omega, None, "solve_ivp", tolerance * largest)
