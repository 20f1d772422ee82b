"""Roots of recorded event functions that are simple and distinct, by compiled code."""

from functools import lru_cache

import numpy as np

from pyharness.engine.events.event_fits import LAST, MUCH, ROUNDING, SHIFT, Solution, refining
from pyharness.engine.events.event_functions import EventFunction
from pyharness.engine.events.event_roots import (
    EXACT,
    FIT_ERROR,
    LEFT,
    MARGIN,
    NODES,
    RIGHT,
    SHORT,
    TO_COEFFICIENTS,
    WIDER,
    Roots,
)
from pyharness.engine.events.event_roots import POINTS as NODE_POINTS
from pyharness.engine.system.recorded import kernel_tape
from pyharness.model.array_type import Array
from pyharness.model.codes import Storage
from pyharness.model.dense_output import POINTS
from pyharness.model.extension import extension

_SETTINGS = LAST, FIT_ERROR, ROUNDING, SHIFT, MUCH, MARGIN, SHORT, EXACT, WIDER
_PER_PIECE, _MORE = 4, 64  # number of roots that are kept


def distinct_roots(g: EventFunction, solution: Solution) -> Roots | None:
    """Return the roots; None if some may be double, close to others, or near an end."""
    columns = solution.pieces.values.shape[2]
    tape = g.tape(columns) if columns <= Storage.MOST_UNKNOWNS else None
    if tape is None or tape.has_branches or not g.is_tape(*solution.samples):
        return None
    edges, values = solution.pieces.contiguous
    constants = _constants(solution.state_error)
    most = _PER_PIECE * len(solution.pieces.values) + _MORE
    roots, count = extension().event_roots(
        kernel_tape(tape, 1), edges, values, solution.sol.n_own, NODES, constants, most
    )
    if count < 0:
        return None
    time, change, slope, noise = roots[:, :count]
    none = np.zeros(count)
    return Roots(time, change.astype(int), slope, none, noise, none, none)


@lru_cache(maxsize=16)
def _constants(state_error: float) -> Array:
    matrices = [each.T.ravel() for each in (refining(), TO_COEFFICIENTS, LEFT, RIGHT)]
    return np.concatenate([POINTS, NODE_POINTS, *matrices, [state_error], _SETTINGS])
