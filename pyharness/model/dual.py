"""Dual numbers (forward differentiation), which record the derivatives of a recorded function."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.symbols import MOST_OPERATIONS, SYMBOLS, Recorder
from pyharness.model.tape import Functions, Table, Tape, evaluate, selected, step, whole

# Factors on the largest number of operations: _MORE for tapes that no kernel reads, _FEWER for
# kernels, whose memory is proportional to the number.
_MORE, _FEWER = 100, 10


class Dual:
    """A value in any arithmetic, and its derivatives with respect to unknowns."""

    def __init__(self, value: Any, slopes: Sequence[Any]) -> None:
        self.value, self.slopes = value, slopes

    def chained(self, value: Any, slope: Any) -> "Dual":
        """Return f of this number, from f's value and derivative there (chain rule)."""
        return Dual(value, [slope * each for each in self.slopes])

    def __add__(self, other: Any) -> "Dual":
        second = dual(other, len(self.slopes))
        slopes = [x + y for x, y in zip(self.slopes, second.slopes, strict=True)]
        return Dual(self.value + second.value, slopes)

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Dual":
        return self.__add__(-1.0 * other)

    def __rsub__(self, other: Any) -> "Dual":
        return self.__mul__(-1.0).__add__(other)

    def __mul__(self, other: Any) -> "Dual":
        second = dual(other, len(self.slopes))
        slopes = [
            x * second.value + self.value * y
            for x, y in zip(self.slopes, second.slopes, strict=True)
        ]
        return Dual(self.value * second.value, slopes)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Dual":
        second = dual(other, len(self.slopes))
        quotient = self.value / second.value
        slopes = [
            (x + -1.0 * quotient * y) / second.value
            for x, y in zip(self.slopes, second.slopes, strict=True)
        ]
        return Dual(quotient, slopes)

    def __rtruediv__(self, other: Any) -> "Dual":
        return dual(other, len(self.slopes)) / self


def dual(value: Any, count: int) -> Dual:
    return value if isinstance(value, Dual) else Dual(value, [0.0] * count)


def with_derivatives(tape: Tape, slots: Sequence[int]) -> Tape:
    """Return a tape of the outputs, and of their derivatives with respect to inputs `slots`."""
    recorder = Recorder(_MORE * MOST_OPERATIONS)
    inputs = [
        Dual(symbol, [float(slot == each) for each in slots])
        for slot, symbol in enumerate(recorder.inputs())
    ]
    found = [dual(each, len(slots)) for each in evaluate(tape, inputs, _DUALS)]
    return recorder.tape([*(x.value for x in found), *(slope for x in found for slope in x.slopes)])


def with_parameters(tape: Tape, values: Sequence[float]) -> Tape:
    """Return a tape of derivatives with respect to the last inputs, and of the outputs themselves.

    The constants `values` replace these inputs.
    """
    count = len(values)
    most, n_inputs = _FEWER * MOST_OPERATIONS, tape.n_inputs - count
    recorder = Recorder(most, n_inputs, "sensitivities", "fewer parameters")
    inputs = [Dual(symbol, [0.0] * count) for symbol in recorder.inputs()]
    inputs += [
        Dual(value, [float(k == each) for k in range(count)]) for each, value in enumerate(values)
    ]
    found = [dual(each, count) for each in evaluate(tape, inputs, _DUALS)]
    return recorder.tape([*(slope for x in found for slope in x.slopes), *(x.value for x in found)])


def of_duals(
    function: Callable[[Any], Any],
    slope: Callable[[Any, Any], Any],
    symbolic: Callable[[Any], Any] | None = None,
) -> Callable[[Any], Any]:
    """Return `function` for numbers and dual numbers, with derivative ``slope(argument, value)``.

    `symbolic`, if given, computes the values of dual numbers.
    """

    def called(x: Any) -> Any:
        if not isinstance(x, Dual):
            return function(x)
        value = (symbolic or called)(x.value)
        return x.chained(value, slope(x.value, value))

    return called


def _selected(condition: Any, first: Any, second: Any) -> Any:
    if not isinstance(condition, Dual):
        return selected(condition, first, second)
    count, choose = len(condition.slopes), SYMBOLS.select
    one, other = dual(first, count), dual(second, count)
    slopes = [choose(condition.value, *each) for each in zip(one.slopes, other.slopes, strict=True)]
    return Dual(choose(condition.value, one.value, other.value), slopes)


def _of_table(table: Table, time: Dual) -> Dual:
    slopes = np.column_stack((table.pieces[:, 1:] * (1.0, 2.0, 3.0), np.zeros(len(table.pieces))))
    return time.chained(
        time.value.of_table(table), time.value.of_table(Table(table.breaks, slopes))
    )


def _slope(kind: str) -> Callable[[Any, Any], Any]:
    return lambda x, _: WITH_DERIVATIVE[kind].derivative(x)


_DUALS: Functions[Any] = Functions(
    float,
    of_duals(math.sqrt, lambda _, root: 0.5 / root, np.sqrt),
    of_duals(math.exp, lambda _, value: value, np.exp),
    of_duals(math.tanh, lambda _, value: 1.0 + -1.0 * (value * value), np.tanh),
    of_duals(math.sin, lambda x, _: np.cos(x), np.sin),
    of_duals(math.cos, lambda x, _: -1.0 * np.sin(x), np.cos),
    _of_table,
    {
        kind: of_duals(getattr(math, kind), _slope(kind), SYMBOLS.elementary[kind])
        for kind in WITH_DERIVATIVE
    },
    of_duals(step, lambda x, _: 0.0, SYMBOLS.switch),
    of_duals(whole, lambda x, _: 0.0, SYMBOLS.floor),
    _selected,
)
