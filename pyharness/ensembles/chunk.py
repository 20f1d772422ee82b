"""Functions that solve scenes of a sweep: all scenes of a chunk, or selected scenes."""

from pyharness.ensembles.batches import batches
from pyharness.ensembles.reductions import empty, reduced
from pyharness.ensembles.sweep import Arrays, Indices, Sweep, points


def solve_chunk(sweep: Sweep, chunk: int) -> Arrays:
    """Solve all scenes of a chunk of a sweep, and return the values of each reduction by its name.

    A chunk is a block of the sweep's grid of scenes, and a reduction is a quantity that is stored
    for each scene. `chunk` is the number of the chunk, from 0. Each array has the shape of the
    chunk, and one more dimension if the reduction has several components. All executors (this
    process, other processes, or a Dask cluster) call this function for each chunk.
    """
    box = sweep.box(chunk)
    shape = tuple(part.stop - part.start for part in box)
    found = solve_points(sweep, points(box))
    return {name: each.reshape(*shape, *each.shape[1:]) for name, each in found.items()}


def solve_points(sweep: Sweep, where: list[Indices]) -> Arrays:
    """Solve selected scenes of a sweep, and return the values of each reduction by its name.

    A reduction is a quantity that is stored for each scene. `where` selects the scenes. It has an
    array for each dimension of the sweep's grid: the index of every selected scene along this
    dimension. The first dimension of each returned array runs over the selected scenes.
    """
    n = len(where[0])
    found = {asked.name: empty(asked, n) for asked in sweep.reductions}
    for members, batch in batches(sweep, where):
        for asked in sweep.reductions:
            found[asked.name][members] = reduced(asked, batch)
    return found
