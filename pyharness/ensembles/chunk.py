"""Scenes of a sweep solved: a chunk of its grid, or any of its scenes."""

from pyharness.ensembles.batches import batches
from pyharness.ensembles.reductions import empty, reduced
from pyharness.ensembles.sweep import Arrays, Indices, Sweep, points


def solve_chunk(sweep: Sweep, chunk: int) -> Arrays:
    """Return the arrays of a chunk, by name: what a task of any executor is."""
    box = sweep.box(chunk)
    shape = tuple(part.stop - part.start for part in box)
    found = solve_points(sweep, points(sweep, box))
    return {name: each.reshape(*shape, *each.shape[1:]) for name, each in found.items()}


def solve_points(sweep: Sweep, where: list[Indices]) -> Arrays:
    """Return the arrays of scenes, given by an array of indices for each dimension."""
    n = len(where[0])
    found = {asked.name: empty(asked, n) for asked in sweep.reductions}
    for members, batch in batches(sweep, where):
        for asked in sweep.reductions:
            found[asked.name][members] = reduced(asked, batch)
    return found
