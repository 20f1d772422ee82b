"""Functions that solve scenes of a sweep: all scenes of a chunk, or selected scenes."""

from pyharness.ensembles.batches import batches
from pyharness.ensembles.reductions import empty, reduced
from pyharness.ensembles.sweep import Arrays, Indices, Sweep, points


def solve_chunk(sweep: Sweep, chunk: int) -> Arrays:
    """Solve all scenes of a chunk, and return the values of each reduction by its name.

    `chunk` is the number of the chunk, from 0. Each array has the shape of the chunk, and one more
    dimension if the reduction has several components. Every executor calls this function for each
    chunk.
    """
    box = sweep.box(chunk)
    shape = tuple(part.stop - part.start for part in box)
    found = solve_points(sweep, points(box))
    return {name: each.reshape(*shape, *each.shape[1:]) for name, each in found.items()}


def solve_points(sweep: Sweep, where: list[Indices]) -> Arrays:
    """Solve selected scenes of a sweep, and return the values of each reduction by its name.

    `where` selects the scenes. It has an array for each dimension of the grid: the index of every
    selected scene along this dimension. The first dimension of each returned array runs over the
    selected scenes.
    """
    n = len(where[0])
    found = {asked.name: empty(asked, n) for asked in sweep.reductions}
    for members, batch in batches(sweep, where):
        for asked in sweep.reductions:
            found[asked.name][members] = reduced(asked, batch)
    return found
