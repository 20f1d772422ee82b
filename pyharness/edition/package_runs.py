"""The runs of the programs in the data package.

They and the reference solutions are the data of the article's Tables B and C.
"""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from pyharness.edition.crate import Part, described
from pyharness.history.ablation import case_truth
from pyharness.model.facts import facts_folder
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset
from pyharness.model.report import numbers
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.programs import run_program
from pyharness.views.render import csv_text

FAULTS_CASE = 5
"""The case for the effects of single faults; its initial omega is on the cards."""

_ENDS = "case program listing steps ended stop_step stop_variable"
_ROWS = "program listing step time omega1 omega2 omega3 velocity1 velocity2 velocity3"


def run_parts() -> Iterator[Part]:
    """Yield the files on the runs: cases, ends and results."""
    yield described("cases", (facts_folder() / "cases.toml").read_bytes())
    yield described("ends", csv_text(numbers(_ENDS, [*_ends()])).encode())
    for case in case_numbers():
        content = csv_text(numbers(_ROWS, [*_rows(case)])).encode()
        yield described("results", content, case=case, faults_case=FAULTS_CASE)


@cache
def _listings() -> dict[tuple[str, str], Listing]:
    """Return the listings by program and name; those with one fault are in apparatus order."""
    found = {}
    for program in PROGRAMS:
        found[program, "original"] = Listing.original(program)
        found[program, "corrected"] = Listing.corrected(program)
    for name in names_of("defect"):
        for program in PROGRAMS:
            if name in names_of("defect", program):
                found[program, name] = subset(program, "corrected", keep=[name])
    return found


@cache
def _run(case: int, listing: Listing) -> Trajectory:
    return run_program(case_scene(case), listing)


def _ends() -> Iterator[list[Any]]:
    for case in case_numbers():
        for (program, name), listing in _listings().items():
            run = _run(case, listing)
            stop = [None, None] if run.stop is None else [run.stop.step, run.stop.variable]
            yield [case, program, name, run.steps, run.ended, *stop]


def _rows(case: int) -> Iterator[list[Any]]:
    curves: dict[tuple[str, str], Any] = {("reference", ""): case_truth(case)}
    for (program, name), listing in _listings().items():
        if case == FAULTS_CASE or name in ("original", "corrected"):
            curves[program, name] = _run(case, listing)
    for names, curve in curves.items():
        states = np.column_stack([curve.time, curve.omega, curve.velocity]).tolist()
        for step, state in enumerate(states, 1):
            yield [*names, step, *state]
