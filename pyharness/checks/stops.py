"""Checks of the Runge-Kutta program's stop test against eq. 19 of the thesis, along its run.

A run stops if a quotient exceeds the stop constant: the change of K (right-hand side) divided by
the change of U (state) within a step. As Fortran and twin could both test a wrong quotient, all
quotients are recomputed from the scheme. The program is run with constants just below and above
each new maximum.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.methods import cases
from pyharness.checks.schemes import Stage, is_whole, rows, stages
from pyharness.checks.selection import Selection
from pyharness.checks.theory.conditioning import ROUNDING
from pyharness.model.basis import Basis
from pyharness.model.listing import Listing, names_of
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import STOP_VARIABLES, Array, Stop, Trajectory
from pyharness.thesis.cells import listing_name, subsets
from pyharness.thesis.programs import PROGRAM_REGISTRY

_PROGRAM = "runge-kutta"
_QUOTIENT = Basis(
    "derived",
    "difference of a quotient of the stop test from equation 19",
    "rounding errors of one step, propagated to first order (`checks/stops.py`)",
)

Stages = tuple[Stage, Stage, Stage, Stage]


@dataclass(frozen=True, eq=False)
class Quotients:
    """The quotients that the program compares with its stop constant, in the program's order."""

    values: Array  # shape (n, m) for n steps, 1/s
    rounding: Array  # shape (n, m); bound on the difference of two computations, 1/s
    names: list[str]  # names of the m quotients of a step


def stops(chosen: Selection) -> Iterator[Attempt]:
    """Yield deferred checks of the stops, for every combination of the stop test's defects.

    The value is the largest ratio of a quotient's difference to its rounding bound.
    """
    ways = tuple(name for name in names_of("defect", _PROGRAM) if name.startswith("lipschitz"))
    for case in cases(chosen, (3,)):
        known = cache(partial(_run, case_scene(case)))
        for defects in subsets(ways):
            listing = Listing(_PROGRAM, defects)
            name = Name("stops", "", f"case-{case}", listing_name(listing))
            yield Attempt(name, partial(_compared, case_scene(case), listing, known))


def _run(scene: Scene) -> tuple[Trajectory, Stages | None]:
    run = PROGRAM_REGISTRY[_PROGRAM].run(scene, Listing.corrected(_PROGRAM), may_stop=False)
    return run, stages(scene, run) if is_whole(scene, run) else None


def _compared(
    scene: Scene,
    listing: Listing,
    known: Callable[[], tuple[Trajectory, Stages | None]],
    name: Name,
) -> Check:
    run, kutta = known()
    if kutta is None:
        return name.judged(False, f"{run.ended}, or no velocity", limit=1.0, basis=_QUOTIENT)
    quotients = _quotients(scene, run, kutta, listing)
    largest = 0.0
    constants = _constants(quotients)
    for constant in constants:
        found = PROGRAM_REGISTRY[_PROGRAM].run(scene, listing, lipschitz=constant)
        due = _due(quotients, constant)
        seen = found.stop and (found.steps, found.stop.step, found.stop.variable)
        if seen != (due and (due.step, due.step, due.variable)):
            note = f"with {constant!r}: {found.stop or found.ended}, due {due or 'complete'}"
            return name.judged(False, note, limit=1.0, basis=_QUOTIENT)
        if found.stop and due:
            granted = quotients.rounding[due.step - 1, quotients.names.index(due.variable)]
            largest = max(largest, abs(found.stop.quotient - due.quotient) / granted)
    return name.bounded(largest, 1.0, _QUOTIENT, f"{len(constants)} constants")


def _quotients(scene: Scene, run: Trajectory, kutta: Stages, listing: Listing) -> Quotients:
    first, _, _, fourth = kutta
    after = rows(run) if listing.has("lipschitz-mismatched-pairs") else fourth.state
    velocity = listing.has("lipschitz-tests-velocity")
    columns = [3, 4, 5, 0, 1, 2] if velocity else [0, 1, 2]
    k, u = np.abs(fourth.rate - first.rate)[:, columns], np.abs(after - first.state)[:, columns]
    k_rounding = (first.rounding + fourth.rounding)[:, columns]
    # U4 and the result are the sum of the previous state and an increment, each rounded.
    stored = 2.0 * ROUNDING * (np.abs(first.state) + np.abs(after))
    u_rounding = (stored + scene.step_size * (first.rounding + fourth.rounding))[:, columns]
    names = [STOP_VARIABLES[column] for column in columns]
    if not listing.has("lipschitz-per-component"):
        names = ["UV" if velocity else "U"]
        k, u, k_rounding, u_rounding = (
            np.linalg.norm(each, axis=1, keepdims=True) for each in (k, u, k_rounding, u_rounding)
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        # A quotient of 0 over 0 never stops a run.
        values = np.where(k > 0.0, k / u, 0.0)
        relative = np.where(k > 0.0, k_rounding / k + u_rounding / u, 0.0)
    return Quotients(values, values * relative, names)


def _constants(quotients: Quotients) -> list[float]:
    """Return stop constants (1/s) on both sides of each new maximum, beyond rounding."""
    constants = []
    below = 0.0
    for values, rounding in zip(quotients.values, quotients.rounding, strict=True):
        beside = np.concatenate([values - 2.0 * rounding, values + 2.0 * rounding])
        is_clear = (np.abs(beside[:, np.newaxis] - values) > rounding).all(axis=1)
        constants += beside[is_clear & (beside > below)].tolist()
        below = max(below, float(beside.max()))
    return constants or [below]


def _due(quotients: Quotients, constant: float) -> Stop | None:
    above = np.argwhere(quotients.values > constant)
    if not len(above):
        return None
    row, column = above[0].tolist()
    return Stop(row + 1, quotients.names[column], float(quotients.values[row, column]))
