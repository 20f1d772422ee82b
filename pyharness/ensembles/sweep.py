"""The data of a sweep: scene, axes of the grid, solver, stored quantities, and chunks."""

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.ensembles.axes import Axis
from pyharness.methods.batch import Solver
from pyharness.model.scene import Scene

Arrays = dict[str, NDArray[Any]]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class ReductionSpec:
    """A reduction (quantity to store) that a sweep requests, with its parameters and array name.

    `name` is the name of the array with the results, and `reduction` a key of `REDUCTIONS`. If the
    reduction is `claim`, `function` names the function that checks a claim of the thesis, as in
    ``package.module:name``; for other reductions it is empty.
    """

    name: str
    reduction: str
    parameters: tuple[tuple[str, Any], ...] = ()
    function: str = ""


@dataclass(frozen=True)
class Sweep:
    """A sweep as a sweep file describes it: a grid of scenes, their solver, and stored quantities.

    Attributes
    ----------
    name : str
        The name of the sweep.
    scene : Scene
        The scene that supplies all quantities that no axis varies.
    axes : tuple of Axis
        The axes of the grid, in the order of the file.
    solver : Solver
        The method or program that solves the scenes, with its settings.
    reductions : tuple of ReductionSpec
        The quantities that are stored for each scene.
    chunk : int
        The largest number of scenes in a chunk.
    text, fingerprint : str
        The text of the sweep file, and the SHA-256 of this text together with the scene file that
        it names.
    """

    name: str
    scene: Scene
    axes: tuple[Axis, ...]
    solver: Solver
    reductions: tuple[ReductionSpec, ...]
    chunk: int
    text: str
    fingerprint: str

    @property
    def dimensions(self) -> dict[str, int]:
        """Return the length of each dimension of the grid of scenes, by name.

        The order of the dimensions is the order of the axes in the sweep file.
        """
        return {axis.dimension: axis.count for axis in self.axes}

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the number of scenes along each dimension of the sweep's grid."""
        return tuple(self.dimensions.values())

    @property
    def n_scenes(self) -> int:
        """Return the number of scenes of the whole grid of the sweep."""
        return math.prod(self.shape)

    @property
    def chunk_shape(self) -> tuple[int, ...]:
        """Return the number of scenes of a chunk along each dimension of the grid.

        A chunk is a block of the grid that is computed and stored at once. A chunk covers some of
        the last dimensions completely, and the dimension before them in part. Along earlier
        dimensions a chunk has length 1. It also has length 1 along dimensions of programs, methods,
        listings (versions of a program) or readings, so that all of its scenes have the same
        solver.
        """
        single = {axis.dimension for axis in self.axes if axis.is_choice}
        room = self.chunk
        lengths = []
        for dimension, count in reversed(self.dimensions.items()):
            length = 1 if dimension in single else min(count, room)
            room = max(1, room // length) if length == count or dimension in single else 1
            lengths.append(length)
        return tuple(reversed(lengths))

    @property
    def chunk_counts(self) -> tuple[int, ...]:
        """Return the number of chunks (blocks of scenes) along each dimension of the grid."""
        return tuple(-(-n // c) for n, c in zip(self.shape, self.chunk_shape, strict=True))

    @property
    def n_chunks(self) -> int:
        """Return the number of chunks (blocks of scenes) into which the whole grid is divided."""
        return math.prod(self.chunk_counts)

    def place(self, chunk: int) -> tuple[int, ...]:
        """Return the position of a chunk (block of scenes) along each dimension of the grid.

        A position is counted in chunks from 0. `chunk` is the number of the chunk in the whole
        grid, from 0.
        """
        return tuple(int(each) for each in np.unravel_index(chunk, self.chunk_counts))

    def box(self, chunk: int) -> tuple[slice, ...]:
        """Return the part of the grid that a chunk (block of scenes) covers, a slice per dimension.

        `chunk` is the number of the chunk in the whole grid, from 0.
        """
        return tuple(
            slice(at * length, min(n, (at + 1) * length))
            for at, length, n in zip(self.place(chunk), self.chunk_shape, self.shape, strict=True)
        )


def points(box: tuple[slice, ...]) -> list[Indices]:
    """Return the indices of all scenes in a part of a sweep's grid, an array for each dimension.

    `box` is the part of the grid, a slice for each dimension. In the result, the index along the
    last dimension varies fastest.
    """
    ranges = [np.arange(part.start, part.stop) for part in box]
    return [each.ravel() for each in np.meshgrid(*ranges, indexing="ij")]


def spread(sweep: Sweep, count: int) -> list[Indices]:
    """Return the indices of `count` scenes that are evenly spread over the grid of a sweep.

    The result has an array for each dimension of the grid. If there are two or more scenes, they
    include the first and the last scene of the grid.
    """
    # The numbers are Python integers, because a grid may have more scenes than 64 bits can count.
    total = sweep.n_scenes
    count = min(count, total)
    flat = [i * (total - 1) // max(1, count - 1) for i in range(count)]
    found: list[list[int]] = []
    rest = flat
    for length in reversed(sweep.shape):
        found.append([each % length for each in rest])
        rest = [each // length for each in rest]
    return [np.array(each, dtype=np.int64) for each in reversed(found)]


def value_columns(sweep: Sweep, where: list[Indices]) -> dict[str, NDArray[Any]]:
    """Return the values of the varied quantities of a sweep in selected scenes, by quantity.

    `where` selects the scenes. It has an array for each dimension of the sweep's grid: the index of
    every selected scene along this dimension. The keys of the result are the fields of the axes, as
    in ``omega.1``. Each array has one value for each scene.
    """
    at = dict(zip(sweep.dimensions, where, strict=True))
    return {axis.field: axis.coordinates()[at[axis.dimension]] for axis in sweep.axes}


def groups(columns: list[NDArray[Any]], n: int) -> list[tuple[Indices, tuple[Any, ...]]]:
    """Group the indices 0 to n - 1 so that all columns have equal values at the indices of a group.

    Each column has n values. The result is a list with a pair for each group: its indices in
    ascending order, and its values, one from each column. Without columns there is one group.
    """
    if not columns:
        return [(np.arange(n), ())]
    numbered = [np.unique(column, return_inverse=True) for column in columns]
    codes = np.stack([inverse for _, inverse in numbered])
    rows, member_of = np.unique(codes, axis=1, return_inverse=True)
    order = np.argsort(member_of.ravel(), kind="stable")
    cuts = np.cumsum(np.bincount(member_of.ravel()))
    starts = itertools.chain([0], cuts[:-1].tolist())
    values = [tuple(u[code] for (u, _), code in zip(numbered, row, strict=True)) for row in rows.T]
    return [
        (order[start:stop], value)
        for start, stop, value in zip(starts, cuts.tolist(), values, strict=True)
    ]
