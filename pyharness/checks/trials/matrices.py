"""The collocation matrices at steps from 1e-10 to 10 s, and when they are declared singular."""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from pyharness.checks.check import Check
from pyharness.checks.stress import Attempt, Trial, bounded, described, in_turn
from pyharness.model.listing import Listing, corrected, original
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.original import compiled
from pyharness.original.linear_solver import SINGULAR
from pyharness.theory.collocation_matrices import (
    PARTS,
    Solved,
    declared_singular_below,
    singular_below,
    solved,
)

STEPS = tuple(10.0 ** (k / 2.0) for k in range(-20, 3))
# Steps of runs in which the four-term program meets the singularity.
_RUN_STEPS = (1e-7, 1e-6, 1e-5, 1e-4)


def _attempts() -> Iterator[Attempt]:
    for program in PARTS:
        for step in STEPS:
            yield Attempt(f"{program}/{step:.0e}", partial(_matrix, program, step))
        yield Attempt(f"{program}/threshold", partial(_threshold, program))
        for step in _RUN_STEPS:
            scene = replace(case_scene(5), step_size=step, steps=300)
            for listing in (original(program), corrected(program)):
                name = f"{program}/{listing.label}/ier-{step:.0e}"
                yield Attempt(name, partial(_counted, listing, scene), scene)


def _matrix(program: str, step: float, prefix: str) -> Iterator[Check]:
    found = solved(program, step)
    expected = SINGULAR if step <= singular_below(program) else 0
    yield bounded(f"{prefix}/ier", abs(found.ier - expected), 0.0, f"IER = {found.ier}")
    yield bounded(f"{prefix}/bits", found.differing, 0.0)
    yield described(f"{prefix}/condition", found.condition, _condition_note(found))
    if found.ier == SINGULAR:
        return
    rows = ", ".join(str(row + 1) for row in found.order)
    yield bounded(f"{prefix}/pivots", *found.pivoting, f"rows {rows}")
    yield bounded(f"{prefix}/residual", found.residual, 1.0)
    yield bounded(f"{prefix}/forward", found.forward, 1.0)
    note = f"{found.increment_error:.1e} of the step"
    yield bounded(f"{prefix}/increment", found.increment, 1.0, note)
    yield described(f"{prefix}/numpy", found.yardstick, f"ours {found.forward:.2g}")


def _condition_note(found: Solved) -> str:
    growth = "" if math.isnan(found.growth) else f", growth {found.growth:.3g}"
    return f"with scaled columns {found.scaled_condition:.3g}{growth}"


def _threshold(program: str, id: str) -> Iterator[Check]:
    """Hold the step below which IER is 129 against the exact last pivot."""
    wanted = singular_below(program)
    found = declared_singular_below(program)
    # The pivot goes with a power of the step: its rounding counts by the root.
    _, rounding = solved(program, 1.01 * wanted).pivoting
    limit = rounding / (len(PARTS[program]) - 1)
    yield bounded(id, abs(found / wanted - 1.0), limit, f"{found:.6g} s")


def _counted(listing: Listing, scene: Scene, id: str) -> Iterator[Check]:
    """Count the steps of a run that print 129; original the points move out of danger."""
    ier = compiled.run(scene, listing, velocity=False).ier
    assert ier is not None
    count = int((ier == SINGULAR).sum())
    singular = singular_below(listing.program) / scene.step_size
    if listing.has("dt-accumulates"):
        expected = min(scene.steps, math.floor(singular))
    else:
        expected = scene.steps if singular >= 1.0 else 0
    note = f"IER = 129 in {count} of {scene.steps} steps"
    yield bounded(id, abs(count - expected), 0.0, note)


TRIAL = Trial(
    "matrices",
    "collocation matrices at steps from 1e-10 to 10 s",
    "componentwise, 3n u |L||U||x| for residuals and that times abs(inverse) for solutions "
    "(Higham 2002, theorem 9.4), both in exact fractions; pivots may miss the largest candidate "
    "by the rounding of two sums; IER = 129 exactly where the exact last pivot is half a unit in "
    "the last place of n",
    in_turn("matrices", _attempts),
)
