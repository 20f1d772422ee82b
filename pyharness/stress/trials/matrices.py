"""The collocation matrices at steps from 1e-10 to 10 s, and when they are declared singular."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from pyharness.compare.checks import Check, bounded, described, may_hold, selected
from pyharness.model.listing import Listing, corrected, original
from pyharness.model.scene_file import case_scene
from pyharness.original import compiled
from pyharness.original.linear_solver import SINGULAR
from pyharness.stress.run import Outcome, Trial, replay
from pyharness.theory.collocation_matrices import (
    PARTS,
    Solved,
    declared_singular_below,
    singular_below,
    solved,
)

NAME = "matrices"
STEPS = tuple(10.0 ** (k / 2.0) for k in range(-20, 3))
# Steps of runs in which the four-term program meets the singularity.
_RUN_STEPS = (1e-7, 1e-6, 1e-5, 1e-4)


def run(only: Sequence[str]) -> Iterator[Outcome]:
    """Solve every matrix, find where it is declared singular, count IER in runs."""
    for program in PARTS:
        if not may_hold(f"{NAME}/{program}", only):
            continue
        for step in STEPS:
            prefix = f"{NAME}/{program}/{step:.0e}"
            if may_hold(prefix, only):
                yield from map(Outcome, _matrix(prefix, program, step))
        id = f"{NAME}/{program}/threshold"
        if selected(id, only):
            yield Outcome(_threshold(id, program))
        for step in _RUN_STEPS:
            for listing in (original(program), corrected(program)):
                id = f"{NAME}/{program}/{listing.label}/ier-{step:.0e}"
                if selected(id, only):
                    yield _counted(id, listing, step)


def _matrix(prefix: str, program: str, step: float) -> Iterator[Check]:
    found = solved(program, step)

    def check(name: str, value: float, limit: float, note: str = "") -> Check:
        return bounded(f"{prefix}/{name}", value, limit, replay(f"{prefix}/{name}"), note)

    expected = SINGULAR if step <= singular_below(program) else 0
    yield check("ier", abs(found.ier - expected), 0.0, f"IER = {found.ier}")
    yield check("bits", found.differing, 0.0)
    yield described(
        f"{prefix}/condition",
        found.condition,
        replay(f"{prefix}/condition"),
        _condition_note(found),
    )
    if found.ier == SINGULAR:
        return
    shortfall, allowed = found.pivoting
    yield check("pivots", shortfall, allowed, f"rows {_rows(found)}")
    yield check("residual", found.residual, 1.0)
    yield check("forward", found.forward, 1.0)
    yield check("increment", found.increment, 1.0, f"{found.increment_error:.1e} of the step")
    yield described(
        f"{prefix}/numpy", found.yardstick, replay(f"{prefix}/numpy"), f"ours {found.forward:.2g}"
    )


def _condition_note(found: Solved) -> str:
    growth = "" if math.isnan(found.growth) else f", growth {found.growth:.3g}"
    return f"with scaled columns {found.scaled_condition:.3g}{growth}"


def _rows(found: Solved) -> str:
    return ", ".join(str(row + 1) for row in found.order)


def _threshold(id: str, program: str) -> Check:
    """Hold the step below which IER is 129 against the exact last pivot."""
    wanted = singular_below(program)
    found = declared_singular_below(program)
    # The pivot goes with a power of the step: its rounding counts by the root.
    _, rounding = solved(program, 1.01 * wanted).pivoting
    limit = rounding / (len(PARTS[program]) - 1)
    return bounded(id, abs(found / wanted - 1.0), limit, replay(id), f"{found:.6g} s")


def _counted(id: str, listing: Listing, step: float) -> Outcome:
    """Count the steps of a run that print 129; original the points move out of danger."""
    scene = replace(case_scene(5), step_size=step, steps=300)
    ier = compiled.run(scene, listing, velocity=False).ier
    assert ier is not None
    count = int((ier == SINGULAR).sum())
    singular = singular_below(listing.program) / step
    if listing.has("dt-accumulates"):
        expected = min(scene.steps, math.floor(singular))
    else:
        expected = scene.steps if singular >= 1.0 else 0
    note = f"IER = 129 in {count} of {scene.steps} steps"
    return Outcome(bounded(id, abs(count - expected), 0.0, replay(id), note), scene)


TRIAL = Trial(
    NAME,
    "collocation matrices at steps from 1e-10 to 10 s",
    "componentwise, 3n u |L||U||x| for residuals and that times abs(inverse) for solutions "
    "(Higham 2002, theorem 9.4), both in exact fractions; pivots may miss the largest candidate "
    "by the rounding of two sums; IER = 129 exactly where the exact last pivot is half a unit in "
    "the last place of n",
    run,
)
