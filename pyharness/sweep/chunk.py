"""Functions that solve scenes of a sweep, and return arrays by reduction."""

from pyharness.sweep.batches import batches
from pyharness.sweep.reductions import empty, reduced
from pyharness.sweep.sweep import Arrays, Indices, Sweep, points


def solve_chunk(sweep: Sweep, chunk: int) -> Arrays:
    """Solve chunk number `chunk`, from 0, in any executor.

    Arrays have the shape of the chunk, and another dimension for several components.
    """
    box = sweep.box(chunk)
    shape = tuple(part.stop - part.start for part in box)
    found = solve_points(sweep, points(box))
    return {name: each.reshape(*shape, *each.shape[1:]) for name, each in found.items()}


def solve_points(sweep: Sweep, where: list[Indices]) -> Arrays:
    """Solve the scenes that `where` selects, an index array per dimension.

    The first dimension of the results runs over the scenes.
    """
    n = len(where[0])
    found = {asked.name: empty(asked, n) for asked in sweep.reductions}
    for members, batch in batches(sweep, where):
        for asked in sweep.reductions:
            found[asked.name][members] = reduced(asked, batch)
    return found
