"""`python -m tests.thesis.rates`: the time of a body's step, in a batch and by itself."""

import sys
import timeit
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness import case_scene, run_many
from pyharness.model.extension import extension
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis.compiled import program_arguments
from tests.instruction_sets import LEVELS, levels_here

BODY_STEPS = 2_000_000  # of one measurement of a batch
AT_REST = 1e9  # 1/s: the stop test is made, and stops no run


def best(task: Callable[[], object], repeats: int = 9) -> float:
    """Return the least time of a task (s)."""
    return min(timeit.repeat(task, number=1, repeat=repeats))


def single(listing: Listing, steps: int) -> float:
    """Return the time of one step (ns) of a single run, called in a loop."""
    given = program_arguments(replace(case_scene(3), steps=steps), listing, AT_REST, True, False)
    calls = max(1, 100_000 // steps)
    run = extension().run_program
    taken = run(*given)[2]  # the run may overflow before the last step
    return best(lambda: [run(*given) for _ in range(calls)]) / calls / int(taken) * 1e9


def side_by_side(listing: Listing, steps: int, threads: int = 1, work: int = BODY_STEPS) -> float:
    """Return the time of one step (ns) of one body in a batch."""
    scene = replace(case_scene(3), steps=steps)
    omega = np.array(scene.omega) * np.linspace(0.5, 1.0, max(256, work // steps))[:, None]
    task = partial(run_many, scene, listing, omega=omega, lipschitz=AT_REST, threads=threads)
    return best(task) / int(task().n_rows.sum()) * 1e9


def main(arguments: Sequence[str]) -> int:
    """Print the table, for the instruction sets that this machine has, or those named."""
    for level in reversed(levels_here()):
        if arguments and LEVELS[level] not in arguments:
            continue
        extension().choose_instructions(level)
        print(f"{LEVELS[level]}: ns a step of one body, by itself / side by side = ratio")
        for listing in (
            make(p) for p in PROGRAMS for make in (Listing.original, Listing.corrected)
        ):
            cells = []
            for steps in (100, 300, 10_000):
                alone, among = single(listing, steps), side_by_side(listing, steps)
                cells.append(f"{steps:6d}: {alone:6.1f} /{among:6.2f} = {alone / among:5.1f}")
            one, two = (side_by_side(listing, 300, k, 10 * BODY_STEPS) for k in (1, 2))
            cells.append(f"two threads {one / two:.2f}")
            print(f"  {listing.program:11} {listing.label:9}", "   ".join(cells), flush=True)
    extension().choose_instructions(len(LEVELS) - 1)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
