"""Symbols: arguments with which a function is called so that its arithmetic is recorded on a tape.

A symbol is a linear combination of the slots of a tape. Sums, and products with numbers, only
change its coefficients. Any other operation has a slot for its result, only one even if repeated.
"""

import math
import re
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import numpy as np

from pyharness.model.errors import InputError, printable
from pyharness.model.tape import (
    N_INPUTS,
    TIME,
    Functions,
    Linear,
    Operation,
    Table,
    Tape,
    exponential,
    slots_of,
)
from pyharness.model.values import converted

# Most operations, and most terms of a linear combination: they determine the kernel's memory and
# time.
MOST_OPERATIONS = 2000
_MOST_POWER = 1000
_ALLOWED = "+ - * /, integer powers, sqrt, sin, cos, tan, exp, sinh, cosh, tanh of NumPy"


class Recorder:
    """A tape during its recording."""

    def __init__(
        self,
        most: int = MOST_OPERATIONS,
        n_inputs: int = N_INPUTS,
        place: str = "[torque]",
        instead: str = "opaque(function), which SciPy's methods solve",
    ) -> None:
        """Begin an empty tape; messages begin with `place` and say what to use `instead`."""
        self.place = place
        self._most, self._n_inputs, self._instead = most, n_inputs, instead
        self._operations: list[Operation] = []
        self._slots: dict[Operation, int] = {}

    def inputs(self) -> list["Symbol"]:
        """Return a symbol for each input: time, omega, attitude, and any parameters."""
        return [Symbol(self, 0.0, {slot: 1.0}) for slot in range(self._n_inputs)]

    def refusal(self, what: str) -> InputError:
        """Return the exception for an operation that can't be recorded."""
        allowed = f"allowed: {_ALLOWED}, or {self._instead}"
        return InputError(f"{self.place}: {what} can't be recorded; {allowed}")

    def impure(self) -> InputError:
        """Return the exception for a function that depends on more than its arguments."""
        return InputError(
            f"{self.place}: two calls of the function differ, or it keeps its arguments; allowed: "
            "a function of its arguments alone, without random numbers and memory; for a "
            "controller with memory, set held_torque of a Stepper"
        )

    def slot(self, operation: Operation) -> int:
        """Return the slot of `operation`, which is recorded if new."""
        if operation not in self._slots:
            if len(self._operations) == self._most:
                most = self._most
                raise InputError(
                    f"{self.place}: more than {most} operations; use fewer, or {self._instead}"
                )
            self._slots[operation] = self._n_inputs + len(self._operations)
            self._operations.append(operation)
        return self._slots[operation]

    def tape(self, outputs: Sequence[Any]) -> Tape:
        """Return the tape of `outputs`, without unused operations."""
        linear = [self._output(axis, each) for axis, each in enumerate(outputs, 1)]
        return _without_unused(self._operations, linear, self._n_inputs)

    def _output(self, axis: int, value: Any) -> Linear:
        if isinstance(value, np.ndarray) and value.shape == ():
            value = value.item()
        if isinstance(value, Symbol):
            if value.recorder is not self:
                raise self.impure()
            return value.linear()
        number = converted(value)
        if not isinstance(number, float):
            raise InputError(f"{self.place}: component {axis} is {number}; allowed: a number")
        if not math.isfinite(number):
            raise InputError(
                f"{self.place}: component {axis} is {number:g}; allowed: a finite number"
            )
        return Linear(number, ())


def _of_symbols(
    operator: Callable[["Symbol", "Symbol"], "Symbol"],
) -> Callable[["Symbol", Any], "Symbol"]:
    """Return an operator of a symbol and any real number; NotImplemented for no number."""

    @wraps(operator)
    def called(self: "Symbol", value: Any) -> "Symbol":
        other = self._other(value)
        return NotImplemented if other is None else operator(self, other)

    return called


class Symbol:
    """A linear combination of slots of a tape, which records the operations on it."""

    __slots__ = ("_constant", "_terms", "recorder")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, recorder: Recorder, constant: float, terms: dict[int, float]) -> None:
        if not (math.isfinite(constant) and all(map(math.isfinite, terms.values()))):
            raise InputError(
                f"{recorder.place}: a constant overflows or is not a number; use finite numbers"
            )
        if len(terms) > MOST_OPERATIONS:
            raise InputError(
                f"{recorder.place}: a sum of more than {MOST_OPERATIONS} terms; use fewer"
            )
        self.recorder, self._constant, self._terms = recorder, constant, terms

    def linear(self) -> Linear:
        """Return the linear combination as data."""
        return Linear(self._constant, tuple(sorted(self._terms.items())))

    def _slot(self) -> tuple[int, float]:
        """Return a slot and a factor whose product is this symbol."""
        if len(self._terms) == 1 and not self._constant:
            ((slot, factor),) = self._terms.items()
            return slot, factor
        return self.recorder.slot(Operation("linear", (), self.linear())), 1.0

    def _other(self, value: Any) -> "Symbol | None":
        """Return the other operand as a symbol; None if it is no number."""
        if isinstance(value, Symbol):
            if value.recorder is not self.recorder:
                raise self.recorder.impure()
            return value
        if isinstance(value, np.ndarray):
            return None
        number = converted(value)
        return Symbol(self.recorder, number, {}) if isinstance(number, float) else None

    def _scaled(self, factor: float) -> "Symbol":
        if factor == 0.0:
            return Symbol(self.recorder, 0.0, {})
        terms = {slot: factor * each for slot, each in self._terms.items()}
        return Symbol(self.recorder, factor * self._constant, terms)

    @_of_symbols
    def __add__(self, other: "Symbol") -> "Symbol":
        """Return the sum with any real number."""
        terms = dict(self._terms)
        for slot, coefficient in other._terms.items():
            total = terms.pop(slot, 0.0) + coefficient
            if total != 0.0:
                terms[slot] = total
        return Symbol(self.recorder, self._constant + other._constant, terms)

    __radd__ = __add__

    def __neg__(self) -> "Symbol":
        """Return the negative."""
        return self._scaled(-1.0)

    def __pos__(self) -> "Symbol":
        """Return the symbol itself."""
        return self

    @_of_symbols
    def __sub__(self, other: "Symbol") -> "Symbol":
        """Return the difference from any real number."""
        return self + -other

    def __rsub__(self, value: Any) -> "Symbol":
        """Return a real number minus the symbol."""
        return (-self).__add__(value)

    @_of_symbols
    def __mul__(self, other: "Symbol") -> "Symbol":
        """Record and return the product with any real number."""
        if not other._terms:
            return self._scaled(other._constant)
        if not self._terms:
            return other._scaled(self._constant)
        (a, factor), (b, second) = self._slot(), other._slot()
        product = self.recorder.slot(Operation("product", (min(a, b), max(a, b))))
        return Symbol(self.recorder, 0.0, {product: factor * second})

    __rmul__ = __mul__

    @_of_symbols
    def __truediv__(self, other: "Symbol") -> "Symbol":
        """Record and return the quotient; raise InputError for the constant 0."""
        if not other._terms:
            if other._constant == 0.0:
                raise InputError(f"{self.recorder.place}: division by the constant 0")
            quotient = {slot: each / other._constant for slot, each in self._terms.items()}
            return Symbol(self.recorder, self._constant / other._constant, quotient)
        if not (self._terms or self._constant):
            return self
        (b, divisor) = other._slot()
        if self._terms:
            a, factor = self._slot()
        else:
            one = Linear(1.0, ())
            a, factor = self.recorder.slot(Operation("linear", (), one)), self._constant
        slot = self.recorder.slot(Operation("quotient", (a, b)))
        return Symbol(self.recorder, 0.0, {slot: factor / divisor})

    @_of_symbols
    def __rtruediv__(self, other: "Symbol") -> "Symbol":
        """Record and return a number divided by the symbol."""
        return other / self

    def __pow__(self, power: Any) -> "Symbol":
        """Record and return an integer power, or the power 0.5."""
        exponent = converted(power) if not isinstance(power, Symbol) else None
        if not isinstance(exponent, float):
            raise self.recorder.refusal("a power that is not a number")
        if exponent == 0.5:
            return self.sqrt()
        if exponent != int(exponent) or abs(exponent) > _MOST_POWER:
            raise self.recorder.refusal(f"the power {exponent:g}")
        result, square, left = Symbol(self.recorder, 1.0, {}), self, abs(int(exponent))
        while left:
            if left % 2:
                result = result * square
            left //= 2
            if left:
                square = square * square
        return 1.0 / result if exponent < 0.0 else result

    def __rpow__(self, base: Any) -> "Symbol":
        """Refuse a power whose exponent is a symbol."""
        raise self.recorder.refusal("a power that is not a number")

    def _apply(self, kind: str, function: Callable[[float], float]) -> "Symbol":
        if not self._terms:
            return Symbol(self.recorder, function(self._constant), {})
        slot, factor = self._slot()
        if factor != 1.0:
            slot = self.recorder.slot(Operation("linear", (), self.linear()))
        return Symbol(self.recorder, 0.0, {self.recorder.slot(Operation(kind, (slot,))): 1.0})

    # NumPy calls the methods with these names for np.sqrt(symbol) and so on.
    def sqrt(self) -> "Symbol":
        """Return the square root."""
        if not self._terms and self._constant < 0.0:
            place = self.recorder.place
            raise InputError(f"{place}: square root of the constant {self._constant:g}")
        return self._apply("sqrt", math.sqrt)

    def exp(self) -> "Symbol":
        """Return the exponential."""
        return self._apply("exp", exponential)

    def sin(self) -> "Symbol":
        """Return the sine."""
        return self._apply("sine", math.sin)

    def cos(self) -> "Symbol":
        """Return the cosine."""
        return self._apply("cosine", math.cos)

    def tan(self) -> "Symbol":
        """Return the tangent."""
        return self.sin() / self.cos()

    def sinh(self) -> "Symbol":
        """Return the hyperbolic sine."""
        return 0.5 * (self.exp() - (-self).exp())

    def cosh(self) -> "Symbol":
        """Return the hyperbolic cosine."""
        return 0.5 * (self.exp() + (-self).exp())

    def tanh(self) -> "Symbol":
        """Return the hyperbolic tangent."""
        return self._apply("tanh", math.tanh)

    def of_table(self, table: Table) -> "Symbol":
        """Return a table at this symbol; raise InputError unless the symbol is the time."""
        if self._constant or self._terms != {TIME: 1.0}:
            raise InputError(
                f"{self.recorder.place}: a table of anything but the time can't be recorded"
            )
        slot = self.recorder.slot(Operation("table", (), None, table))
        return Symbol(self.recorder, 0.0, {slot: 1.0})

    def conjugate(self) -> "Symbol":
        """Return the symbol itself, because it is real."""
        return self

    def __lt__(self, other: object) -> bool:
        """Refuse a comparison."""
        raise self.recorder.refusal("a comparison of the state")

    __eq__ = __le__ = __gt__ = __ge__ = __lt__

    def __bool__(self) -> bool:
        """Refuse the use as a condition."""
        raise self.recorder.refusal("a branch that depends on the state")

    def __abs__(self) -> "Symbol":
        """Refuse the absolute value, which has no derivative at 0."""
        raise self.recorder.refusal("an absolute value")

    def __float__(self) -> float:
        """Refuse the conversion to a number."""
        raise self.recorder.refusal(
            "a conversion of the state to a float, as in functions of math, or in an assignment to "
            "an array of floats,"
        )

    __int__ = __index__ = __complex__ = __round__ = __float__

    def __mod__(self, other: object) -> "Symbol":
        """Refuse the remainder."""
        raise self.recorder.refusal("a remainder")

    __rmod__ = __floordiv__ = __rfloordiv__ = __mod__

    def __getattr__(self, name: str) -> Any:
        """Refuse functions that can't be recorded; NumPy looks them up by name."""
        # NumPy's mean reads `dtype`, and works without it.
        if name.startswith("_") or name == "dtype":
            raise AttributeError(name)
        raise self.recorder.refusal(f"{name} of the state")


def recorded_twice(record: Callable[[Recorder], Tape], recorder: Callable[[], Recorder]) -> Tape:
    """Return the tape of a user's function; raise InputError if a second call differs."""
    first, again = record(recorder()), recorder()
    if record(again) != first:
        raise again.impure()
    return first


def called_once(
    function: Callable[..., Any], given: Sequence[Any], recorder: Recorder, allowed: str
) -> list[Any]:
    """Return the components that a user's function returns for symbols.

    Raise InputError if the function raises an exception; `allowed` describes allowed functions.
    """
    try:
        return list(function(*given))
    except InputError:
        raise
    except Exception as error:
        missing = re.search(r"no callable (\w+) method", str(error))
        if missing:
            raise recorder.refusal(f"{missing[1]} of the state") from None
        raise InputError(
            f"{recorder.place}: the function raised {type(error).__name__}: "
            f"{printable(str(error))}; allowed: {allowed}"
        ) from error


# Functions that evaluate a tape in symbols of a recorder. A constant remains a float.
SYMBOLS: Functions[Any] = Functions(
    float, np.sqrt, np.exp, np.tanh, np.sin, np.cos, lambda table, time: time.of_table(table)
)


def _without_unused(
    operations: Sequence[Operation], outputs: Sequence[Linear], n_inputs: int
) -> Tape:
    used = {slot for output in outputs for slot, _ in output.terms}
    for number in range(len(operations) - 1, -1, -1):
        if n_inputs + number in used:
            used.update(slots_of(operations[number]))
    places = {slot: slot for slot in range(n_inputs)}
    kept: list[Operation] = []
    for number, (kind, operands, linear, table) in enumerate(operations):
        if n_inputs + number in used:
            places[n_inputs + number] = n_inputs + len(kept)
            moved = None if linear is None else _moved(linear, places)
            moved_operands = tuple(places[slot] for slot in operands)
            kept.append(Operation(kind, moved_operands, moved, table))
    return Tape(tuple(kept), tuple(_moved(each, places) for each in outputs), n_inputs)


def _moved(linear: Linear, places: dict[int, int]) -> Linear:
    return Linear(linear.constant, tuple((places[slot], x) for slot, x in linear.terms))
