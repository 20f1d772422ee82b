"""The data of a sweep: scene, axes of the grid, solver, reductions and chunks.

A reduction is a quantity stored for each scene. A chunk, numbered from 0, is a block of the grid
that is solved and stored at once.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.checks.compare.batch import Batch, Solver
from pyharness.model.scene import Scene
from pyharness.sweep.axes import Axis

Arrays = dict[str, NDArray[Any]]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class ReductionSpec:
    """A requested reduction: its array's `name`, its key in `REDUCTIONS`, and its parameters."""

    name: str
    reduction: str
    parameters: tuple[tuple[str, Any], ...] = ()
    # For the reduction `claim`: checks a claim for each scene of a batch.
    function: Callable[[Batch], NDArray[Any]] | None = None


@dataclass(frozen=True)
class Sweep:
    name: str
    scene: Scene  # supplies the values that no axis varies
    tables: dict[str, Any]  # the scene's tables, none for a case
    axes: tuple[Axis, ...]
    solver: Solver
    reductions: tuple[ReductionSpec, ...]
    chunk: int  # largest number of scenes in a chunk
    text: str  # content of the sweep file
    fingerprint: str  # SHA-256 of the sweep file and its scene file

    @property
    def dimensions(self) -> dict[str, int]:
        return {axis.dimension: axis.count for axis in self.axes}

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.dimensions.values())

    @property
    def n_scenes(self) -> int:
        return math.prod(self.shape)

    @property
    def chunk_shape(self) -> tuple[int, ...]:
        """Return the number of scenes of a chunk along each dimension."""
        # All scenes of a chunk share program, method, listing and reading.
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
        return tuple(-(-n // c) for n, c in zip(self.shape, self.chunk_shape, strict=True))

    @property
    def n_chunks(self) -> int:
        return math.prod(self.chunk_counts)

    def position_of(self, chunk: int) -> tuple[int, ...]:
        """Return a chunk's position along each dimension, counted in chunks."""
        return tuple(int(each) for each in np.unravel_index(chunk, self.chunk_counts))

    def box(self, chunk: int) -> tuple[slice, ...]:
        """Return the slice of each dimension that a chunk covers."""
        position = self.position_of(chunk)
        return tuple(
            slice(at * length, min(n, (at + 1) * length))
            for at, length, n in zip(position, self.chunk_shape, self.shape, strict=True)
        )


def points(box: tuple[slice, ...]) -> list[Indices]:
    """Return the indices of all scenes in a box, an array for each dimension, in C order."""
    ranges = [np.arange(part.start, part.stop) for part in box]
    return [each.ravel() for each in np.meshgrid(*ranges, indexing="ij")]


def spread(sweep: Sweep, count: int) -> list[Indices]:
    """Return the indices of up to `count` evenly spread scenes, an array for each dimension."""
    # A grid may have more scenes than 64 bits can count.
    total = sweep.n_scenes
    count = min(count, total)
    rest = [i * (total - 1) // max(1, count - 1) for i in range(count)]
    found: list[list[int]] = []
    for length in reversed(sweep.shape):
        found.append([each % length for each in rest])
        rest = [each // length for each in rest]
    return [np.array(each, dtype=np.int64) for each in reversed(found)]


def value_columns(sweep: Sweep, where: list[Indices]) -> dict[str, NDArray[Any]]:
    """Return the values of each varied field, such as ``omega.1``, in the scenes at `where`."""
    at = dict(zip(sweep.dimensions, where, strict=True))
    return {axis.field: axis.coordinates()[at[axis.dimension]] for axis in sweep.axes}


def groups(columns: list[NDArray[Any]], n: int) -> list[tuple[Indices, tuple[Any, ...]]]:
    """Return the groups of indices below n with equal values in all columns, and these values."""
    if not columns:
        return [(np.arange(n), ())]
    numbered = [np.unique(column, return_inverse=True) for column in columns]
    codes = np.stack([inverse for _, inverse in numbered])
    rows, member_of = np.unique(codes, axis=1, return_inverse=True)
    order = np.argsort(member_of.ravel(), kind="stable")
    cuts = np.cumsum(np.bincount(member_of.ravel()))
    values = [tuple(u[code] for (u, _), code in zip(numbered, row, strict=True)) for row in rows.T]
    return list(zip(np.split(order, cuts[:-1]), values, strict=True))
