"""Counts of the floating-point operations in a step of a program, made on the cards themselves.

The statements of a deck are interpreted as the author wrote them, with numbers that count the
operations applied to them. The linear solver LEQT1F is our own version, because the original source
is not published. `T**2` counts as one multiplication, and `T**3` and `T**4` count as two each.
Operations in subscripts, jumps, ABS and WRITE are not counted.
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pyharness.model.listing import Listing
from pyharness.original.decks import deck_text
from pyharness.original.linear_solver import leqt1f

_NOTHING = re.compile(r"PROGRAM|DIMENSION|REAL|FORMAT|WRITE|CONTINUE|END$")
_DO = re.compile(r"DO(\d+)([A-Z]+)=(\d+),(\d+)")
_IF = re.compile(r"IF\((\w+)\.EQ\.(\d+)\)(.*)")
_TEST = re.compile(r"IF\((.*)\.GT\.(.*)\)GOTO8")
_CALL = re.compile(r"CALLLEQT1F\(A,M,N,")
_TARGET = re.compile(r"(\w+?)(?:\(([\w,]+)\))?=(.*)")
ALIKE = {"+": 1, "-": 1, "*": 1, "/": 1}


class Count(NamedTuple):
    """The number of additions, subtractions, multiplications and divisions in a program's step.

    With unit times it is the time that these operations take one after the other.

    Attributes
    ----------
    written : int
        The number of all operations that the statements on the cards perform.
    once : int
        The number of distinct operations. An operation is not counted if the same operation was
        applied to the same operands earlier in the step.
    """

    written: int
    once: int


class _Counter:
    """A counter of the operations in a step, which stores the result of each distinct operation."""

    def __init__(self, times: Mapping[str, int]) -> None:
        self.times, self.written = times, 0
        self.known: dict[tuple[Any, ...], _Number] = {}
        self.constants: dict[float, _Number] = {}

    def operate(self, name: str, left: Any, right: Any) -> "_Number":
        self.written += self.times[name]
        key = (name, _identity(left), _identity(right))
        if key not in self.known:
            x, y = _value(left), _value(right)
            value = {"+": x + y, "-": x - y, "*": x * y}[name] if name != "/" else x / y
            self.known[key] = _Number(self, value)
        return self.known[key]


def _identity(x: Any) -> Any:
    return id(x) if isinstance(x, _Number) else float(x)


def _value(x: Any) -> float:
    return x.value if isinstance(x, _Number) else float(x)


class _Number:
    """A floating-point value of a program, with the counter that counts each operation on it.

    If an operation was already applied to the same operands in the same order, the object that
    resulted then is returned again. Therefore two objects are identical exactly if their values
    were computed in the same way.
    """

    def __init__(self, counter: _Counter, value: float) -> None:
        self.counter, self.value = counter, value

    def __add__(self, other: Any) -> "_Number":
        return self.counter.operate("+", self, other)

    def __radd__(self, other: Any) -> "_Number":
        return self.counter.operate("+", other, self)

    def __sub__(self, other: Any) -> "_Number":
        return self.counter.operate("-", self, other)

    def __rsub__(self, other: Any) -> "_Number":
        return self.counter.operate("-", other, self)

    def __mul__(self, other: Any) -> "_Number":
        return self.counter.operate("*", self, other)

    def __rmul__(self, other: Any) -> "_Number":
        return self.counter.operate("*", other, self)

    def __truediv__(self, other: Any) -> "_Number":
        return self.counter.operate("/", self, other)

    def __rtruediv__(self, other: Any) -> "_Number":
        return self.counter.operate("/", other, self)

    def __pow__(self, exponent: int) -> "_Number":
        square = self * self
        return {2: lambda: square, 3: lambda: square * self, 4: lambda: square * square}[exponent]()

    def __abs__(self) -> "_Number":
        return self if self.value >= 0.0 else _Number(self.counter, -self.value)

    def __gt__(self, other: Any) -> bool:
        return self.value > _value(other)

    def __lt__(self, other: Any) -> bool:
        return self.value < _value(other)

    def __eq__(self, other: object) -> bool:
        return self.value == _value(other)

    __hash__ = None  # type: ignore[assignment]


class _Array(defaultdict[tuple[int, ...], Any]):
    """An array whose elements are read with subscripts in parentheses, as in FORTRAN."""

    def __call__(self, *subscripts: int) -> Any:
        return self[subscripts]


def operations_per_step(listing: Listing, times: Mapping[str, int] = ALIKE) -> Count:
    """Return the number of arithmetic operations of a listing's program in its first step.

    The result is a `Count`. A listing is a program with a choice of its defects. The scene is the
    case of Table 1 of the thesis that is on the published cards of the program. `times` has the
    weight of each operation, for example its unit time on a machine.
    """
    statements = list(_statements(deck_text(listing)))
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
    """Return a copy of a program's value from before a step, for counting the step's operations.

    The operations that computed the value are not counted. Operations on the copy are counted by
    `counter`. `value` is a number or an array of numbers. Any other object is returned unchanged.
    """
    if isinstance(value, _Array):
        moved = {k: _moved(x, counter) for k, x in value.items()}
        return _Array(lambda: _Number(counter, 0.0), moved)
    return _Number(counter, value.value) if isinstance(value, _Number) else value


def _statements(text: str) -> Iterator[tuple[str, str]]:
    """Return the label and the text of every statement of a deck, both without blanks.

    `text` is the deck as fixed-form FORTRAN.
    """
    found: list[list[str]] = []
    for line in text.splitlines():
        label, goes_on, rest = line[:5].strip(), line[5], "".join(line[6:72].split())
        if line.startswith("C"):
            continue
        if goes_on != " ":
            found[-1][1] += rest
        else:
            found.append([label, rest])
    return ((label, rest) for label, rest in found)


def _run(statements: list[tuple[str, str]], names: dict[str, Any], counter: _Counter) -> None:
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
                _run([("", match[3])], names, counter)
        elif _CALL.match(text):
            _solve(names, counter)
        elif not _NOTHING.match(text):
            _assign(text, names, counter)


def _assign(text: str, names: dict[str, Any], counter: _Counter) -> None:
    match = _TARGET.fullmatch(text)
    assert match is not None, text
    name, subscripts, expression = match.groups()
    value = _evaluated(expression, names)
    if isinstance(value, float):
        value = counter.constants.setdefault(value, _Number(counter, value))
    if subscripts is None:
        names[name] = value
    else:
        array = names.setdefault(name, _Array(lambda: _Number(counter, 0.0)))
        array[tuple(_evaluated(each, names) for each in subscripts.split(","))] = value


def _evaluated(expression: str, names: dict[str, Any]) -> Any:
    return eval(expression, {"__builtins__": {}}, names)


def _solve(names: dict[str, Any], counter: _Counter) -> None:
    n, m = names["N"], names["M"]
    a, b = names["A"], names["B"]
    matrix = [[a(i, j) for j in range(1, n + 1)] for i in range(1, n + 1)]
    right = [[b(i, j) for i in range(1, n + 1)] for j in range(1, m + 1)]
    solutions, _ = leqt1f(matrix, right)
    for j, column in enumerate(solutions, 1):
        for i, value in enumerate(column, 1):
            b[i, j] = value
