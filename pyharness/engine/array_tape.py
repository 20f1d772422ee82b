"""Evaluation of a tape, the recorded operations of a torque, for arrays of states."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from pyharness.model.tape import N_INPUTS, Functions, Table, Tape, evaluate, float_outputs
from pyharness.model.trajectory import Array


def table_values(table: Table, times: Any) -> Array:
    """Return the values of a table at an array of times (s)."""
    breaks, pieces = np.array(table.breaks), np.array(table.pieces)
    piece = np.maximum(0, np.searchsorted(breaks, times, side="right") - 1)
    c0, c1, c2, c3 = pieces[piece].T
    s = times - breaks[piece]
    found: Array = c0 + s * (c1 + s * (c2 + s * c3))
    return found


ARRAYS: Functions[Any] = Functions(float, np.sqrt, np.exp, np.tanh, np.sin, np.cos, table_values)


def inputs_of(times: Array, state: Array) -> list[Array]:
    """Return the eight inputs of a tape, each of shape (n,); states are (n, 3) or (n, 7)."""
    columns = [times, *state.T]
    return columns + [np.zeros(len(times))] * (N_INPUTS - len(columns))


def outputs_at(tape: Tape, times: Array, state: Array) -> Array:
    """Return the m outputs of a tape at n states, shape (n, m); not finite where it is singular."""
    with np.errstate(all="ignore"):
        found: Sequence[Any] = evaluate(tape, inputs_of(times, state), ARRAYS)
    # A constant output is a number, without a shape.
    outputs = np.stack([np.broadcast_to(each, len(times)) for each in found], axis=1)
    for row in np.flatnonzero(~np.isfinite(outputs).all(axis=1)):
        with suppress(ZeroDivisionError):
            inputs = inputs_of(times[row : row + 1], state[row : row + 1])
            outputs[row] = float_outputs(tape, [float(each[0]) for each in inputs])
    return outputs
