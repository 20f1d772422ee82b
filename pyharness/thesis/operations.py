"""Counts of the floating-point operations in a step of a program.

The author's statements and our LEQT1F run with numbers that count operations. `T**2` is one
multiplication, `T**3` and `T**4` are two each. Subscripts, jumps, ABS and WRITE do not count.
"""

import operator
import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from pyharness.model.listing import Listing
from pyharness.thesis.cards import statements_of
from pyharness.thesis.decks import deck_text
from pyharness.thesis.linear_solver import leqt1f

_NOTHING = re.compile(r"PROGRAM|DIMENSION|REAL|FORMAT|WRITE|CONTINUE|END$")
_DO = re.compile(r"DO(\d+)([A-Z]+)=(\d+),(\d+)")
_IF = re.compile(r"IF\((\w+)\.EQ\.(\d+)\)(.*)")
_TEST = re.compile(r"IF\((.*)\.GT\.(.*)\)GOTO8")
_CALL = re.compile(r"CALLLEQT1F\(A,M,N,")
_TARGET = re.compile(r"(\w+?)(?:\(([\w,]+)\))?=(.*)")
_OPERATIONS = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
}  # fmt: skip
ALIKE = dict.fromkeys(_OPERATIONS, 1)


class Count(NamedTuple):
    """The number of arithmetic operations in a step, or their time in the unit of `times`."""

    written: int  # all operations on the cards
    once: int  # repeated operations count once


class _Counter:
    def __init__(self, times: Mapping[str, int]) -> None:
        self.times, self.written = times, 0
        self.known: dict[tuple[Any, ...], _Number] = {}
        self.constants: dict[float, _Number] = {}

    def operate(self, name: str, left: Any, right: Any) -> "_Number":
        self.written += self.times[name]
        key = (name, *(id(x) if isinstance(x, _Number) else float(x) for x in (left, right)))
        if key not in self.known:
            value = _OPERATIONS[name](float(left), float(right))
            self.known[key] = _Number(self, value)
        return self.known[key]


def _operator(name: str, reflected: bool = False) -> Callable[["_Number", Any], "_Number"]:
    def operate(self: "_Number", other: Any) -> "_Number":
        return self.counter.operate(name, *((other, self) if reflected else (self, other)))

    return operate


class _Number(float):
    counter: _Counter

    def __new__(cls, counter: _Counter, value: float) -> "_Number":
        found = super().__new__(cls, value)
        found.counter = counter
        return found

    __add__, __radd__ = _operator("+"), _operator("+", reflected=True)
    __sub__, __rsub__ = _operator("-"), _operator("-", reflected=True)
    __mul__, __rmul__ = _operator("*"), _operator("*", reflected=True)
    __truediv__, __rtruediv__ = _operator("/"), _operator("/", reflected=True)

    def __pow__(self, exponent: Any, modulus: None = None) -> Any:
        square = self * self
        return {2: lambda: square, 3: lambda: square * self, 4: lambda: square * square}[exponent]()

    def __abs__(self) -> "_Number":
        return self if self >= 0.0 else _Number(self.counter, -self)


class _Array(defaultdict[tuple[int, ...], Any]):
    def __call__(self, *subscripts: int) -> Any:
        return self[subscripts]


def operations_per_step(listing: Listing, times: Mapping[str, int] = ALIKE) -> Count:
    """Return the count for a listing's first step; `times` has each operation's time."""
    statements = statements_of(deck_text(listing).splitlines())
    begin = next(n for n, (_, text) in enumerate(statements) if _DO.match(text))
    label = _DO.match(statements[begin][1])
    assert label is not None
    end = next(n for n, (name, _) in enumerate(statements) if name == label[1])
    names: dict[str, Any] = {"ABS": abs, "SQRT": lambda x: x}
    before = _Counter(times)
    _run(statements[:begin], names, before)
    counter = _Counter(times)
    for name, value in names.items():
        names[name] = _moved(value, counter)
    names[label[2]] = 1
    _run(statements[begin + 1 : end], names, counter)
    return Count(counter.written, sum(times[name] for name, _, _ in counter.known))


def _moved(value: Any, counter: _Counter) -> Any:
    if isinstance(value, _Array):
        moved = {k: _moved(x, counter) for k, x in value.items()}
        return _Array(lambda: _Number(counter, 0.0), moved)
    return _Number(counter, value) if isinstance(value, _Number) else value


def _run(statements: list[list[str]], names: dict[str, Any], counter: _Counter) -> None:
    position = 0
    while position < len(statements):
        _, text = statements[position]
        position += 1
        if match := _DO.match(text):
            end = next(n for n, each in enumerate(statements) if each[0] == match[1])
            for value in range(int(match[3]), int(match[4]) + 1):
                names[match[2]] = value
                _run(statements[position:end], names, counter)
            position = end + 1
        elif match := _TEST.match(text):
            for side in match.groups():
                _evaluated(side, names)
        elif match := _IF.match(text):
            if names[match[1]] == int(match[2]):
                _run([["", match[3]]], names, counter)
        elif _CALL.match(text):
            _solve(names)
        elif not _NOTHING.match(text):
            _assign(text, names, counter)


def _assign(text: str, names: dict[str, Any], counter: _Counter) -> None:
    match = _TARGET.fullmatch(text)
    assert match is not None, text
    name, subscripts, expression = match.groups()
    value = _evaluated(expression, names)
    if type(value) is float:
        value = counter.constants.setdefault(value, _Number(counter, value))
    if subscripts is None:
        names[name] = value
    else:
        array = names.setdefault(name, _Array(lambda: _Number(counter, 0.0)))
        array[tuple(_evaluated(each, names) for each in subscripts.split(","))] = value


def _evaluated(expression: str, names: dict[str, Any]) -> Any:
    return eval(expression, {"__builtins__": {}}, names)


def _solve(names: dict[str, Any]) -> None:
    n, m = names["N"], names["M"]
    a, b = names["A"], names["B"]
    matrix = [[a(i, j) for j in range(1, n + 1)] for i in range(1, n + 1)]
    right = [[b(i, j) for i in range(1, n + 1)] for j in range(1, m + 1)]
    solutions, _ = leqt1f(matrix, right)
    for j, column in enumerate(solutions, 1):
        for i, value in enumerate(column, 1):
            b[i, j] = value
