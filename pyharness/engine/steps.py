"""The steps of an integration as dense output, and their transformations."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from pyharness.engine.rates import rates
from pyharness.model.array_type import Array
from pyharness.model.dense_output import POINTS, DenseOutput, Pieces
from pyharness.model.scene import Scene

STEP_NODES = 0.5 + 0.5 * POINTS  # in parts of a step
MOST_STEPS = 20_000  # that `sol` has; it limits the memory


def steps_output(scene: Scene, pieces: Pieces) -> DenseOutput:
    """Return the dense output of a scene from polynomials."""
    low, high = pieces.edges[[0, -1]].tolist()
    return DenseOutput(low, high, pieces, partial(rates, scene))


def transformed_steps(
    sol: DenseOutput | None, states: Callable[[Array], Array], factor: float = 1.0
) -> DenseOutput | None:
    """Return steps in another unit of time, `factor` times shorter, or about other axes.

    `states` transforms rows of omega, with the attitude if there is one.
    """
    if sol is None or not isinstance(sol.states, Pieces):
        return None
    edges, values = sol.states.edges * factor, sol.states.values
    changed = states(values.reshape(-1, values.shape[2])).reshape(values.shape)
    return replace(
        sol, t_min=float(edges[0]), t_max=float(edges[-1]), states=Pieces(edges, changed)
    )


def joined_steps(before: DenseOutput | None, after: DenseOutput | None) -> DenseOutput | None:
    """Return the steps before and after time 0; None if one is missing."""
    if before is None or after is None:
        return None
    parts = before.states, after.states
    assert isinstance(parts[0], Pieces)
    assert isinstance(parts[1], Pieces)
    edges = np.concatenate([parts[0].edges, parts[1].edges[1:]])
    values = np.concatenate([parts[0].values, parts[1].values])
    return replace(after, t_min=before.t_min, states=Pieces(edges, values))
