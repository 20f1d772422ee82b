"""Solution of the scenes of a sweep: of a chunk of its grid, or of any scenes."""

from pyharness.ensembles.batches import batches
from pyharness.ensembles.reductions import empty, reduced
from pyharness.ensembles.sweep import Arrays, Indices, Sweep, points


def solve_chunk(sweep: Sweep, chunk: int) -> Arrays:
    """Return the arrays of a chunk by name. Every executor runs this function as its task."""
    box = sweep.box(chunk)
    shape = tuple(part.stop - part.start for part in box)
    found = solve_points(sweep, points(sweep, box))
    return {name: each.reshape(*shape, *each.shape[1:]) for name, each in found.items()}


def solve_points(sweep: Sweep, where: list[Indices]) -> Arrays:
    """Return the arrays of some scenes by name; `where` has their indices for each dimension."""
    n = len(where[0])
    found = {asked.name: empty(asked, n) for asked in sweep.reductions}
    for members, batch in batches(sweep, where):
        for asked in sweep.reductions:
            found[asked.name][members] = reduced(asked, batch)
    return found
