"""Tapes that compute the derivatives of a tape with respect to inputs or parameters."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pyharness.model.dual import Dual, dual
from pyharness.model.symbols import MOST_OPERATIONS, Recorder
from pyharness.model.tape import Functions, Table, Tape, evaluate

# Factors on the limit of operations of a recorded torque: _MORE for a tape that no kernel reads,
# _FEWER for one that a kernel reads, whose memory is proportional to their number.
_MORE, _FEWER = 100, 10


def with_derivatives(tape: Tape, slots: Sequence[int]) -> Tape:
    """Return a tape with its outputs, then the derivatives of each by the inputs in `slots`.

    Forward differentiation is exact.
    """
    recorder = Recorder(_MORE * MOST_OPERATIONS)
    inputs = [
        Dual(symbol, [float(slot == each) for each in slots])
        for slot, symbol in enumerate(recorder.inputs())
    ]
    found = [dual(each, len(slots)) for each in evaluate(tape, inputs, _DUALS)]
    values, slopes = [each.value for each in found], [each.slopes for each in found]
    return recorder.tape([*values, *(slope for row in slopes for slope in row)])


def with_parameters(tape: Tape, values: Sequence[float]) -> Tape:
    """Return a tape of the derivatives of each output by m parameters, then of the outputs.

    The parameters are the last inputs of `tape`; the result has these `values` in their place.
    """
    count = len(values)
    instead = "fewer parameters"
    recorder = Recorder(_FEWER * MOST_OPERATIONS, tape.n_inputs - count, "sensitivities", instead)
    inputs = [Dual(symbol, [0.0] * count) for symbol in recorder.inputs()]
    inputs += [
        Dual(value, [float(k == each) for k in range(count)]) for each, value in enumerate(values)
    ]
    found = [dual(each, count) for each in evaluate(tape, inputs, _DUALS)]
    return recorder.tape([*(slope for x in found for slope in x.slopes), *(x.value for x in found)])


def _sqrt(x: Any) -> Any:
    if not isinstance(x, Dual):
        return math.sqrt(x)
    root = np.sqrt(x.value)
    return x.chained(root, 0.5 / root)


def _exp(x: Any) -> Any:
    if not isinstance(x, Dual):
        return math.exp(x)
    value = np.exp(x.value)
    return x.chained(value, value)


def _tanh(x: Any) -> Any:
    if not isinstance(x, Dual):
        return math.tanh(x)
    value = np.tanh(x.value)
    return x.chained(value, 1.0 + -1.0 * (value * value))


def _sine(x: Any) -> Any:
    return x.chained(np.sin(x.value), np.cos(x.value)) if isinstance(x, Dual) else math.sin(x)


def _cosine(x: Any) -> Any:
    if not isinstance(x, Dual):
        return math.cos(x)
    return x.chained(np.cos(x.value), -1.0 * np.sin(x.value))


def _of_table(table: Table, time: Dual) -> Dual:
    slopes = tuple((c1, 2.0 * c2, 3.0 * c3, 0.0) for _, c1, c2, c3 in table.pieces)
    return time.chained(
        time.value.of_table(table), time.value.of_table(Table(table.breaks, slopes))
    )


_DUALS: Functions[Any] = Functions(float, _sqrt, _exp, _tanh, _sine, _cosine, _of_table)
