"""Symbols: function arguments that record arithmetic on a tape (a list of operations).

A symbol is a linear combination of slots, the inputs and results on the tape. Sums, and products
with numbers, only change coefficients; any other operation has a slot for its result, and a
repeated operation has the same slot.
"""

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial, wraps
from pathlib import Path
from typing import Any

import numpy as np

from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.errors import InputError, printable
from pyharness.model.numpy_protocol import Recorded
from pyharness.model.tape import (
    FLOATS,
    N_INPUTS,
    TIME,
    Functions,
    Linear,
    Operation,
    Table,
    Tape,
    slots_of,
)
from pyharness.model.values import converted

# Most operations, and most terms of a linear combination, which determine memory and time.
MOST_OPERATIONS = 2000
_MOST_POWER = 1000
# Smaller factors, such as in (x / 1e12)**30, would underflow.
_LEAST_FACTOR = 2.0**-400
_ALLOWED = (
    "+ - * / ** and NumPy's elementary functions, where, clip, minimum, maximum, sign, abs, floor, "
    "heaviside, interp"
)
# Folders of code that is not the user's.
_LIBRARIES = tuple(str(Path(each).parents[1]) for each in (np.__file__, __file__))


HAS_MEMORY = (
    "two calls of the function differ, or it keeps its arguments; allowed: a function of its "
    "arguments alone, without random numbers and memory; for a controller with memory, give the "
    "scene states, or set held_torque of a Stepper"
)


class Recorder:
    """A tape (list of operations) during its recording."""

    def __init__(
        self,
        most: int = MOST_OPERATIONS,
        n_inputs: int = N_INPUTS,
        place: str = "[torque]",
        instead: str = "opaque(function), which SciPy's methods solve",
        has_lines: bool = True,
    ) -> None:
        """Begin a tape; messages begin with `place`, and suggest `instead`.

        With `has_lines`, messages name the line of the function.
        """
        self._has_lines = has_lines
        self.place = place
        self.most, self._n_inputs, self._instead = most, n_inputs, instead
        self._slots: dict[Operation, int] = {}
        self.has_powers = True  # whether exponents may be symbols
        self.was_converted = False  # whether the function tried to make a symbol a float

    @property
    def count(self) -> int:
        """The number of operations."""
        return len(self._slots)

    def restart(self, count: int) -> None:
        """Keep the first operations alone."""
        for operation in [*self._slots][count:]:
            del self._slots[operation]
        self.was_converted = False

    def inputs(self) -> list["Symbol"]:
        """Return symbols for all inputs: time, omega, attitude, and own states or parameters."""
        return [Symbol(self, 0.0, {slot: 1.0}) for slot in range(self._n_inputs)]

    def refusal(self, what: str, write: str = _ALLOWED) -> InputError:
        allowed = f"allowed: {write}, or {self._instead}"
        where = _line() if self._has_lines else ""
        return InputError(f"{self.place}: {what} can't be recorded{where}; {allowed}")

    def refusal_of_numbers(self, reason: str) -> InputError:
        return InputError(
            f"{self.place}: the function accepts numbers only, not the symbols that record it "
            f"({reason}); allowed: a formula of {_ALLOWED}, or {self._instead}"
        )

    def impure(self) -> InputError:
        return InputError(f"{self.place}: {HAS_MEMORY}")

    def slot(self, operation: Operation) -> int:
        """Return the slot of the operation's result; record a new operation."""
        if operation not in self._slots:
            if len(self._slots) == self.most:
                most = self.most
                raise InputError(
                    f"{self.place}: more than {most} operations; use fewer, or {self._instead}"
                )
            self._slots[operation] = self._n_inputs + len(self._slots)
        return self._slots[operation]

    def least_powers(self, slot: int) -> list[int] | None:
        """Return the factors of a product with its sign, odd powers once and even ones twice.

        Return None if no power is above 2.
        """
        operations = [*self._slots]
        powers = {slot: 1}

        def is_product(slot: int) -> bool:
            return slot >= self._n_inputs and operations[slot - self._n_inputs].kind == "product"

        while products := [*filter(is_product, powers)]:
            power = powers.pop(max(products))
            for each in operations[max(products) - self._n_inputs].operands:
                powers[each] = powers.get(each, 0) + power
        if max(powers.values()) <= 2:
            return None
        return [each for each, power in powers.items() for _ in range(2 - power % 2)]

    def result(self, *operation: Any, factor: float = 1.0) -> "Symbol":
        return Symbol(self, 0.0, {self.slot(Operation(*operation)): factor})

    def tape(self, outputs: Sequence[Any]) -> Tape:
        linear = [self._output(axis, each) for axis, each in enumerate(outputs, 1)]
        return _without_unused([*self._slots], linear, self._n_inputs)

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
    operator: Callable[["Symbol", "Symbol"], Any],
) -> Callable[["Symbol", Any], "Symbol"]:

    @wraps(operator)
    def called(self: "Symbol", value: Any) -> "Symbol":
        other = self._other(value)
        return NotImplemented if other is None else operator(self, other)

    return called


def _is_moderate(factor: float) -> bool:
    return _LEAST_FACTOR <= abs(factor) <= 1.0 / _LEAST_FACTOR


def _is_subnormal(factor: float) -> bool:
    """Return whether a factor that is not 0 lost digits, which its product with a slot may need."""
    return abs(factor) < sys.float_info.min


def _function(
    kind: str, derivative: "Callable[[Symbol], Symbol] | None" = None
) -> Callable[["Symbol"], "Symbol"]:
    def called(self: "Symbol") -> "Symbol":
        if not self._terms:
            function = FLOATS.elementary.get(kind) or getattr(FLOATS, kind)
            return Symbol(self.recorder, function(self._constant), {})
        operands: tuple[int, ...] = (self._own_slot(),)
        if derivative is not None:
            argument = Symbol(self.recorder, 0.0, {operands[0]: 1.0})
            operands = (*operands, derivative(argument)._own_slot())
        return self.recorder.result(kind, operands)

    return called


def _rint(x: Any) -> Any:
    # The result is even where two numbers are nearest: after 2k + 0.5, and from 2k + 1.5 on, it
    # grows by 1.
    return (0.5 * x + 0.25).floor() - (0.25 - 0.5 * x).floor()


# By kind.
_WITH_DERIVATIVE = {
    kind: _function(kind, each.derivative) for kind, each in WITH_DERIVATIVE.items()
}
# By NumPy's name; besides, compositions of other functions.
_NAMED: dict[str, Callable[[Any], Any]] = {
    WITH_DERIVATIVE[kind].of_numpy: each for kind, each in _WITH_DERIVATIVE.items()
} | {
    "tan": lambda x: x.sin() / x.cos(),
    "square": lambda x: x * x,
    "cbrt": lambda x: x.sign() * _WITH_DERIVATIVE["cbrt"](abs(x)),
    "radians": lambda x: x * (math.pi / 180.0),
    "degrees": lambda x: x * (180.0 / math.pi),
    "rint": _rint,
    # The difference of exponentials would lose digits of a small argument.
    "sinh": lambda x: 0.5 * (x.expm1() - (-x).expm1()),
    "cosh": lambda x: 0.5 * (x.exp() + (-x).exp()),
    "conjugate": lambda x: x,
}


_logarithm, _exp2 = _WITH_DERIVATIVE["log"], _WITH_DERIVATIVE["exp2"]
# The names of NumPy for functions of one argument that are methods of symbols.
METHODS = ("sqrt", "exp", "sin", "cos", "tanh", "floor", "ceil", "trunc", "sign", *_NAMED)


class Symbol(Recorded):
    """A linear combination of slots (inputs and results), which records operations on it."""

    __slots__ = ("_constant", "_terms", "recorder")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, recorder: Recorder, constant: float, terms: dict[int, float]) -> None:
        if not (math.isfinite(constant) and all(map(math.isfinite, terms.values()))):
            raise InputError(
                f"{recorder.place}: a constant overflows or is not a number; use finite numbers"
            )
        if len(terms) > recorder.most:
            raise InputError(
                f"{recorder.place}: a sum of more than {recorder.most} terms; use fewer"
            )
        self.recorder, self._constant, self._terms = recorder, constant, terms

    def linear(self) -> Linear:
        return Linear(self._constant, tuple(sorted(self._terms.items())))

    def _slot(self) -> tuple[int, float]:
        """Return a slot and a factor whose product is this symbol."""
        if len(self._terms) == 1 and not self._constant:
            ((slot, factor),) = self._terms.items()
            return slot, factor
        return self.recorder.slot(Operation("linear", (), self.linear())), 1.0

    def _other(self, value: Any) -> "Symbol | None":
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
        if any(map(_is_subnormal, terms.values())):
            return Symbol(self.recorder, 0.0, {self._own_slot(): factor})
        return Symbol(self.recorder, factor * self._constant, terms)

    @_of_symbols
    def __add__(self, other: "Symbol") -> "Symbol":
        terms = dict(self._terms)
        for slot, coefficient in other._terms.items():
            total = terms.pop(slot, 0.0) + coefficient
            if total != 0.0:
                terms[slot] = total
        return Symbol(self.recorder, self._constant + other._constant, terms)

    __radd__ = __add__

    def __neg__(self) -> "Symbol":
        return self._scaled(-1.0)

    def __pos__(self) -> "Symbol":
        return self

    __sub__ = _of_symbols(lambda x, y: x + -y)
    __rsub__ = _of_symbols(lambda x, y: y + -x)

    @_of_symbols
    def __mul__(self, other: "Symbol") -> "Symbol":
        if not other._terms:
            return self._scaled(other._constant)
        if not self._terms:
            return other._scaled(self._constant)
        (a, factor), (b, second) = self._slot(), other._slot()
        if not _is_moderate(factor * second):
            a, b, factor, second = self._own_slot(), other._own_slot(), 1.0, 1.0
        return self.recorder.result("product", (min(a, b), max(a, b)), factor=factor * second)

    __rmul__ = __mul__

    @_of_symbols
    def __truediv__(self, other: "Symbol") -> "Symbol":
        if not other._terms:
            if other._constant == 0.0:
                raise InputError(f"{self.recorder.place}: division by the constant 0")
            quotient = {slot: each / other._constant for slot, each in self._terms.items()}
            if any(map(_is_subnormal, quotient.values())):
                quotient = {self._own_slot(): 1.0 / other._constant}
                return Symbol(self.recorder, 0.0, quotient)
            return Symbol(self.recorder, self._constant / other._constant, quotient)
        if not (self._terms or self._constant):
            return self
        (b, divisor) = other._slot()
        if self._terms:
            a, factor = self._slot()
        else:
            one = Linear(1.0, ())
            a, factor = self.recorder.slot(Operation("linear", (), one)), self._constant
        if self._terms and not _is_moderate(factor / divisor):
            a, b, factor, divisor = self._own_slot(), other._own_slot(), 1.0, 1.0
        return self.recorder.result("quotient", (a, b), factor=factor / divisor)

    __rtruediv__ = _of_symbols(lambda x, y: y / x)

    def __pow__(self, power: Any) -> "Symbol":
        """Return the power; a negative base requires an integer exponent."""
        if isinstance(power, Symbol):
            if not self.recorder.has_powers:
                raise self.recorder.refusal("a power that is not a number")
            return (power * _logarithm(self)).exp()
        exponent = converted(power)
        if not isinstance(exponent, float) or not math.isfinite(exponent):
            raise self.recorder.refusal("a power that is not a finite number")
        if abs(exponent) <= _MOST_POWER and exponent % 1.0 == 0.5:
            root = self.sqrt()
            return root if exponent == 0.5 else self ** (exponent - 0.5) * root
        if exponent % 1.0 or abs(exponent) > _MOST_POWER:
            return (exponent * _logarithm(self)).exp()
        result, square, left = Symbol(self.recorder, 1.0, {}), self, abs(int(exponent))
        while left:
            if left % 2:
                result = result * square
            left //= 2
            if left:
                square = square * square
        return 1.0 / result if exponent < 0.0 else result

    def __rpow__(self, base: Any) -> "Symbol":
        number = converted(base)
        if not isinstance(number, float) or not number > 0.0:
            raise self.recorder.refusal("a power of a number that is not positive")
        return _exp2(self) if number == 2.0 else (self * math.log(number)).exp()

    def _own_slot(self) -> int:
        slot, factor = self._slot()
        if factor != 1.0:
            slot = self.recorder.slot(Operation("linear", (), self.linear()))
        return slot

    # NumPy calls the methods with these names for np.sqrt(symbol) and so on.
    exp = _function("exp")
    sin = _function("sine")
    cos = _function("cosine")
    tanh = _function("tanh")
    floor = __floor__ = _function("floor")
    _root = _function("sqrt")

    def sqrt(self) -> "Symbol":
        if not self._terms and self._constant < 0.0:
            place = self.recorder.place
            raise InputError(f"{place}: square root of the constant {self._constant:g}")
        return self._root()

    def arctan2(self, x: Any) -> "Symbol":
        """Return the angle (rad) of the point (x, self), -pi to pi; undefined at the origin."""
        # Not x >= 0: at first, an integration takes every condition as false.
        is_left = x < 0.0
        # The tangent of half the angle to the x axis; y/x would not be defined where x is 0.
        half = self / ((self * self + x * x).sqrt() + select(is_left, -x, x))
        angle = 2.0 * half.arctan()
        found: Symbol = select(is_left, select(self < 0.0, -math.pi, math.pi) - angle, angle)
        return found

    def switch(self) -> "Condition | bool":
        """Return the condition that this symbol is positive; a bool if it is constant."""
        if not self._terms:
            return self._constant > 0.0
        slot, factor = self._slot()
        factors = self.recorder.least_powers(slot)
        if factors is not None:
            # x**3 is positive where x is. Steps end more precisely at the simple root of x.
            product = Symbol(self.recorder, math.copysign(1.0, factor), {})
            for each in factors:
                product = product * Symbol(self.recorder, 0.0, {each: 1.0})
            return product.switch()
        if factor < 0.0:
            slot = self._own_slot()
        return _condition(self.recorder.result("switch", (slot,)))

    def ceil(self) -> "Symbol":
        return -((-self).floor())

    def trunc(self) -> "Symbol":
        return self.sign() * abs(self).floor()

    __ceil__, __trunc__ = ceil, trunc

    def sign(self) -> "Symbol":
        return 2.0 * (self > 0.0) - 1.0

    def with_terms_of(self, others: "Iterable[Symbol]") -> "Symbol":
        """Return this symbol plus 0 times the terms of `others`, recorded; 0 remains 0."""
        if not (self._terms or self._constant):
            return self
        terms = {slot: 0.0 for each in others for slot in each._terms} | self._terms
        linear = Linear(self._constant, tuple(sorted(terms.items())))
        return self.recorder.result("linear", (), linear)

    def is_time(self) -> bool:
        return not self._constant and self._terms == {TIME: 1.0}

    def of_table(self, table: Table) -> "Symbol":
        if not self.is_time():
            raise InputError(
                f"{self.recorder.place}: a table of a variable other than time can't be recorded"
            )
        return self.recorder.result("table", (), None, table)

    __gt__ = _of_symbols(lambda x, y: (x - y).switch())
    __lt__ = _of_symbols(lambda x, y: (y - x).switch())
    __ge__ = _of_symbols(lambda x, y: negated((y - x).switch()))
    __le__ = _of_symbols(lambda x, y: negated((x - y).switch()))

    def __eq__(self, other: object) -> Any:
        """Refuse equality, which holds at isolated times at most."""
        raise self.recorder.refusal("a comparison with == or !=", "< and > in numpy.where")

    __ne__ = __eq__

    def __bool__(self) -> bool:
        raise self.recorder.refusal(
            "a branch (if, while, and, or, not) on time or state",
            "numpy.where(condition, x, y), &, | and ~",
        )

    def __abs__(self) -> "Symbol":
        found: Symbol = select(self > 0.0, self, -self)
        return found

    def __float__(self) -> float:
        self.recorder.was_converted = True
        raise self.recorder.refusal(
            "a conversion of time or state to a float, by float(), scipy or an array of floats,",
            "functions of numpy",
        )

    __int__ = __index__ = __complex__ = __round__ = __float__

    __floordiv__ = _of_symbols(lambda x, y: (x / y).floor())
    __rfloordiv__ = _of_symbols(lambda x, y: (y / x).floor())
    __mod__ = _of_symbols(lambda x, y: x - y * (x / y).floor())
    __rmod__ = _of_symbols(lambda x, y: y - x * (y / x).floor())

    def __getattr__(self, name: str) -> Any:
        """Return a function, such as tan, which NumPy looks up by name."""
        if name in _NAMED:
            return partial(_NAMED[name], self)
        # numpy.mean works for objects without an attribute `dtype`.
        if name.startswith("_") or name == "dtype":
            raise AttributeError(f"a Symbol has no {name}")
        raise self.recorder.refusal(f"{name} of the state")


class Condition(Symbol):
    """A symbol that is 1 where a condition holds, else 0."""

    __slots__ = ()

    def _checked(self, other: Any) -> Any:
        if not isinstance(other, (Condition, bool, np.bool_)):
            raise self.recorder.refusal("a number as a condition", "a comparison")
        return other

    def __and__(self, other: Any) -> Any:
        return _condition(select(self, self._checked(other), False))

    def __or__(self, other: Any) -> Any:
        return _condition(select(self, True, self._checked(other)))

    def __xor__(self, other: Any) -> Any:
        return _condition(select(self, negated(self._checked(other)), other))

    def __invert__(self) -> "Condition":
        return _condition(1.0 - self)

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__


def _condition(value: Symbol) -> Condition:
    return Condition(value.recorder, value._constant, value._terms)


def negated(condition: Any) -> Any:
    return ~condition if isinstance(condition, Condition) else not condition


def select(condition: Any, first: Any, second: Any) -> Any:
    if not isinstance(condition, Symbol):
        return first if condition else second
    if not isinstance(condition, Condition):
        raise condition.recorder.refusal("a number as a condition", "a comparison")
    one, other = (
        condition._other(float(x) if isinstance(x, (bool, np.bool_)) else x)
        for x in (first, second)
    )
    if one is None or other is None:
        raise condition.recorder.refusal("an array in a choice of numbers", "numpy.where")
    if one.linear() == other.linear():
        return one
    operands = tuple(each._own_slot() for each in (condition, one, other))
    return condition.recorder.result("select", operands)


def _line() -> str:
    frame = sys._getframe(2)
    while frame.f_back and frame.f_code.co_filename.startswith(_LIBRARIES):
        frame = frame.f_back
    name = frame.f_code.co_name
    return f" (line {frame.f_lineno}, in {printable(name)})"


def recorded_twice(record: Callable[[Recorder], Tape], recorder: Callable[[], Recorder]) -> Tape:
    """Return the tape of a user's function; raise InputError if a second recording differs."""
    first, again = record(recorder()), recorder()
    if record(again) != first:
        raise again.impure()
    return first


def _selected(condition: Any, x: Any, y: Any) -> Any:
    known = isinstance(condition, Condition) or not isinstance(condition, Symbol)
    return select(condition if known else _condition(condition), x, y)


def _combined(linear: Linear, values: Sequence[Any]) -> Any:
    terms: dict[int, float] = {}
    constant, recorder = 0.0, None
    for slot, factor in linear.terms:
        value = values[slot]
        if not isinstance(value, Symbol):
            constant += factor * value
            continue
        recorder = value.recorder
        part = value._scaled(factor)
        constant += part._constant
        for inner, x in (part._terms if factor else dict.fromkeys(value._terms, 0.0)).items():
            total = terms.pop(inner, 0.0) + x
            if total or not factor:
                terms[inner] = total
    constant += linear.constant
    return constant if recorder is None else Symbol(recorder, constant, terms)


def _elementary(kind: str, x: Any) -> Any:
    functions = _WITH_DERIVATIVE if isinstance(x, Symbol) else FLOATS.elementary
    return functions[kind](x)


SYMBOLS: Functions[Any] = Functions(
    float, np.sqrt, np.exp, np.tanh, np.sin, np.cos, lambda table, time: time.of_table(table),
    {kind: partial(_elementary, kind) for kind in WITH_DERIVATIVE},
    lambda x: x.switch() if isinstance(x, Symbol) else FLOATS.switch(x),
    lambda x: x.floor() if isinstance(x, Symbol) else FLOATS.floor(x), _selected, _combined,
)  # fmt: skip


def _without_unused(
    operations: Sequence[Operation], outputs: Sequence[Linear], n_inputs: int
) -> Tape:
    used = {slot for output in outputs for slot, _ in output.terms}
    for slot, operation in reversed([*enumerate(operations, n_inputs)]):
        if slot in used:
            used.update(slots_of(operation))
    places = {slot: slot for slot in range(n_inputs)}
    kept: list[Operation] = []

    def moved(linear: Linear) -> Linear:
        return Linear(linear.constant, tuple((places[slot], x) for slot, x in linear.terms))

    for slot, (kind, operands, linear, table) in enumerate(operations, n_inputs):
        if slot in used:
            places[slot] = n_inputs + len(kept)
            own = None if linear is None else moved(linear)
            kept.append(Operation(kind, tuple(places[each] for each in operands), own, table))
    return Tape(tuple(kept), tuple(map(moved, outputs)), n_inputs)
