"""Trial of the collocation matrices for step sizes from 1e-10 to 10 s, and of their singularity.

The linear solver LEQT1F reports a singular matrix by the error code IER = 129.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from pyharness.checks.check import BITS, Attempt, Check, Name
from pyharness.checks.hold import scene_of
from pyharness.checks.stress import Trial, named
from pyharness.checks.theory.collocation_matrices import (
    HIGHAM,
    PARTS,
    PIVOTS,
    SINGULARITY,
    declared_singular_below,
    singular_below,
    solved,
)
from pyharness.model.listing import Listing
from pyharness.model.scene_file import case_scene
from pyharness.thesis import compiled
from pyharness.thesis.linear_solver import SINGULAR

STEPS = tuple(10.0 ** (k / 2.0) for k in range(-20, 3))
# Step sizes (s); for some of them the four-term program's matrix is singular.
_RUN_STEPS = (1e-7, 1e-6, 1e-5, 1e-4)


def _attempts() -> Iterator[Attempt]:
    for program in PARTS:
        for step in STEPS:
            name = named("matrices", program, f"{step:.0e}")
            yield Attempt(name, partial(_matrix, program, step))
        yield Attempt(named("matrices", program, "threshold"), _threshold)
        for step in _RUN_STEPS:
            scene = replace(case_scene(5), step_size=step, steps=300)
            for listing in (Listing.original(program), Listing.corrected(program)):
                where = f"ier-{step:.0e}"
                name = named("matrices", program, listing.label, where, scene=scene)
                yield Attempt(name, partial(_counted, listing))


def _matrix(program: str, step: float, name: Name) -> Iterator[Check]:
    found = solved(program, step)
    expected = SINGULAR if step <= singular_below(program) else 0
    note = f"IER = {found.ier}"
    yield name.with_quantity("ier").bounded(abs(found.ier - expected), 0.0, SINGULARITY, note)
    yield name.with_quantity("bits").bounded(found.differing, 0.0, BITS)
    growth = "" if math.isnan(found.growth) else f", growth {found.growth:.3g}"
    note = f"with scaled columns {found.scaled_condition:.3g}{growth}"
    yield name.with_quantity("condition").described(found.condition, note)
    if found.ier == SINGULAR:
        return
    rows = ", ".join(str(row + 1) for row in found.order)
    yield name.with_quantity("pivots").bounded(*found.pivoting, PIVOTS, f"rows {rows}")
    yield name.with_quantity("residual").bounded(found.residual, 1.0, HIGHAM)
    yield name.with_quantity("forward").bounded(found.forward, 1.0, HIGHAM)
    note = f"{found.increment_error:.1e} of the step"
    yield name.with_quantity("increment").bounded(found.increment, 1.0, HIGHAM, note)
    yield name.with_quantity("numpy").described(found.yardstick, f"ours {found.forward:.2g}")


def _threshold(name: Name) -> Check:
    program = name.subject
    wanted = singular_below(program)
    found = declared_singular_below(program)
    # The last pivot is proportional to a power of the step size, so divide its relative rounding
    # error by the exponent.
    _, rounding = solved(program, 1.01 * wanted).pivoting
    limit = rounding / (len(PARTS[program]) - 1)
    return name.bounded(abs(found / wanted - 1.0), limit, PIVOTS, f"{found:.6g} s")


def _counted(listing: Listing, name: Name) -> Check:
    scene = scene_of(name)
    ier = compiled.run(scene, listing, velocity=False).ier
    assert ier is not None
    count = int((ier == SINGULAR).sum())
    singular = singular_below(listing.program) / scene.step_size
    # With the defect `dt-accumulates` the matrix is singular only in the first steps.
    expected = min(scene.steps, math.floor(singular))
    if not listing.has("dt-accumulates"):
        expected = scene.steps if singular >= 1.0 else 0
    note = f"IER = 129 in {count} of {scene.steps} steps"
    return name.bounded(abs(count - expected), 0.0, SINGULARITY, note)


TRIAL = Trial(
    "matrices",
    "solution of the collocation matrices at steps from 1e-10 to 10 s",
    "3 n u |L||U||x| for each component of a residual, times |inverse| for a solution (Higham "
    "2002, theorem 9.4), computed in exact fractions. A pivot may be smaller than the largest "
    "candidate by the rounding errors of two sums. IER must be 129 exactly where the exact last "
    "pivot is at most half a unit in the last place of n.",
    lambda only: _attempts(),
)
