"""The tape: a function of time, omega and attitude, recorded as a list of operations.

It is recorded with `pyharness.model.symbols`, and evaluated with floats, decimal numbers, Taylor
series or symbols. A slot is an input or a result.
"""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.elementary import WITH_DERIVATIVE, of_float, with_exponential
from pyharness.model.functions import cosine, sine

T = TypeVar("T")

# The slots of the inputs of a torque. The result of operation number n of its tape is in slot
# N_INPUTS + n.
TIME = 0
OMEGA = (1, 2, 3)
ATTITUDE = (4, 5, 6, 7)
N_INPUTS = 8
# The kinds of operations whose results are constant between certain values of the operand.
SWITCHES = ("switch", "floor")


class Linear(NamedTuple):
    """A constant plus a linear combination: `terms` are slot-coefficient pairs, sorted by slot."""

    constant: float
    terms: tuple[tuple[int, float], ...]


class Table:
    """A piecewise cubic function of time (s).

    Row k of `pieces`, (n, 4), has coefficients of ascending powers of the time since breaks[k].
    """

    def __init__(self, breaks: Any, pieces: Any) -> None:
        # The first cubic applies also before its break.
        self.breaks: Array = np.asarray(breaks, dtype=float)
        self.pieces: Array = np.asarray(pieces, dtype=float).reshape(-1, 4)

    @cached_property
    def _key(self) -> tuple[bytes, bytes]:
        return self.breaks.tobytes(), self.pieces.tobytes()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


class Operation(NamedTuple):
    """An operation of a tape: "linear", "table", or another kind with up to three operands."""

    # "switch" is 1 where its operand is positive, else 0; "select" is its second operand where the
    # first is 1, else its third.
    kind: str
    operands: tuple[int, ...]  # slots
    linear: Linear | None = None
    table: Table | None = None


@dataclass(frozen=True)
class Tape:
    """A recorded function: `n_inputs` slots of inputs, operations in order, and outputs."""

    operations: tuple[Operation, ...]
    outputs: tuple[Linear, ...]
    n_inputs: int = N_INPUTS

    @property
    def inputs(self) -> frozenset[int]:
        """The slots of the inputs on which the function depends."""
        used = {slot for each in self.operations for slot in slots_of(each)}
        used |= {slot for output in self.outputs for slot, _ in output.terms}
        return frozenset(slot for slot in used if slot < self.n_inputs)

    @property
    def needs_attitude(self) -> bool:
        return not self.inputs.isdisjoint(ATTITUDE)

    @cached_property
    def _hash(self) -> int:  # caches have tapes as keys
        return hash((self.operations, self.outputs, self.n_inputs))

    def __hash__(self) -> int:
        return self._hash

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for `pickle`, without the hash, which differs between processes."""
        return {name: value for name, value in vars(self).items() if name != "_hash"}

    @cached_property
    def has_branches(self) -> bool:
        """Whether there is a "select", whose unused operand may be singular."""
        return any(each.kind == "select" for each in self.operations)

    @property
    def n_switches(self) -> int:
        return sum(each.kind in SWITCHES for each in self.operations)

    @property
    def breaks(self) -> list[float]:
        """The times (s) between pieces of tables, ascending."""
        tables = [each.table for each in self.operations if each.table is not None]
        times = [table.breaks[1:] for table in tables]
        return np.unique(np.concatenate(times)).tolist() if times else []


def slots_of(operation: Operation) -> tuple[int, ...]:
    if operation.table is not None:
        return (TIME,)
    if operation.linear is None:
        return operation.operands
    return tuple(slot for slot, _ in operation.linear.terms)


@dataclass(frozen=True)
class Functions(Generic[T]):
    """The functions that a tape needs besides + - * and /."""

    number: Callable[[float], T]  # converts a constant of the tape
    sqrt: Callable[[T], T]
    exp: Callable[[T], T]
    tanh: Callable[[T], T]
    sine: Callable[[T], T]
    cosine: Callable[[T], T]
    table: Callable[[Table, T], T]  # the value of a table at a time
    elementary: Mapping[str, Callable[[T], T]]  # those of WITH_DERIVATIVE
    switch: Callable[[T], T]
    floor: Callable[[T], T]
    select: Callable[[T, T, T], T]
    combined: Callable[[Linear, Sequence[T]], T] | None = None  # a faster linear combination


def evaluate(tape: Tape, inputs: Sequence[T], functions: Functions[T]) -> list[T]:
    """Return the outputs of a tape for its inputs, in the arithmetic of `functions`."""
    values = slot_values(tape, inputs, functions)
    return [_combined(each, values, functions) for each in tape.outputs]


def _combined(linear: Linear, values: Sequence[Any], functions: Functions[Any]) -> Any:
    if functions.combined:
        return functions.combined(linear, values)
    number = functions.number
    terms = [
        values[k] if factor == 1.0 else number(factor) * values[k] for k, factor in linear.terms
    ]
    if linear.constant or not terms:
        terms.append(number(linear.constant))
    return reduce(operator.add, terms)


def slot_values(tape: Tape, inputs: Sequence[T], functions: Functions[T]) -> list[T]:
    values: list[Any] = list(inputs)
    for operation in tape.operations:
        values.append(_result(operation, values, functions))
    return values


def _result(operation: Operation, values: Sequence[Any], functions: Functions[Any]) -> Any:
    kind, operands, linear, table = operation
    if linear is not None:
        return _combined(linear, values, functions)
    if table is not None:
        return functions.table(table, values[TIME])
    if kind == "product":
        return values[operands[0]] * values[operands[1]]
    if kind == "quotient":
        return values[operands[0]] / values[operands[1]]
    if kind == "select":
        return functions.select(*(values[each] for each in operands))
    function = functions.elementary.get(kind) or getattr(functions, kind)
    return function(values[operands[0]])


def live_slots(
    tape: Tape, compute: Callable[[int], object], is_true: Callable[[int], bool],
    for_series: bool = True,
) -> list[int]:  # fmt: skip
    """Call `compute` for the slots that the outputs need, operands first; return these slots.

    `is_true` evaluates the condition in a slot. Only Taylor series (`for_series`) need derivatives.
    """
    known = set(range(tape.n_inputs))
    wanted = [slot for output in tape.outputs for slot, _ in output.terms]
    while wanted:
        slot = wanted[-1]
        operands: tuple[int, ...] = ()
        if slot not in known:
            operation = tape.operations[slot - tape.n_inputs]
            operands = slots_of(operation)
            if operation.kind in WITH_DERIVATIVE and not for_series:
                operands = operands[:1]
            elif operation.kind == "select":
                # The other operand may be singular.
                condition, first, second = operands
                operands = (condition,)
                if condition in known:
                    operands = (first,) if is_true(condition) else (second,)
        missing = [each for each in operands if each not in known]
        if missing:
            wanted += missing
            continue
        wanted.pop()
        if slot not in known:
            compute(slot)
            known.add(slot)
    return sorted(known)[tape.n_inputs :]


def _sqrt(x: float) -> float:
    return math.sqrt(x) if x >= 0.0 else math.nan


def exponential(x: float) -> float:
    try:
        return math.exp(x)
    except OverflowError:
        return math.inf


def step(x: float) -> float:
    return 1.0 if x > 0.0 else 0.0


def whole(x: float) -> float:
    return float(math.floor(x)) if math.isfinite(x) else math.nan


def selected(condition: float, first: float, second: float) -> float:
    return first if condition else second


def _value(table: Table, time: float) -> float:
    piece = max(0, int(table.breaks.searchsorted(time, "right")) - 1)
    c0, c1, c2, c3 = table.pieces[piece].tolist()
    s = time - float(table.breaks[piece])
    return float(c0 + s * (c1 + s * (c2 + s * c3)))


# For arguments of type float. A division by zero raises ZeroDivisionError.
FLOATS: Functions[float] = Functions(
    float, _sqrt, exponential, math.tanh, sine, cosine, _value,
    {kind: of_float(kind) for kind in WITH_DERIVATIVE}, step, whole, selected,
)  # fmt: skip
# Exponentials of larger arguments are replaced by powers of 2, as in tape_values.f90.
_LARGE_ARGUMENT = 210.0
# Replacements of exponentials of very negative arguments, by kind.
_SMALL = {"large": 2.0**-303, "moderate": 2.0**-140}
_UNSEEN = 2.0**-150


def float_outputs(tape: Tape, inputs: Sequence[float]) -> list[float]:
    """Return the outputs of a tape in floats; division by 0 raises ZeroDivisionError."""
    found: list[float] = []
    try:
        found = evaluate(tape, inputs, FLOATS)
    except ZeroDivisionError:
        if not any(each.kind in (*WITH_DERIVATIVE, "select") for each in tape.operations):
            raise
    if found and all(map(math.isfinite, found)):
        return found
    if tape.has_branches or not found:
        # An unused branch or derivative, as of abs(x)**1.3, may be singular.
        tape = _without_branches(tape, inputs)
        found = evaluate(tape, inputs, FLOATS)
    if all(map(math.isfinite, found)) or all(each.kind != "exp" for each in tape.operations):
        return found
    # A large number replaces an exponential that overflows, as in sinh(x)/cosh(x), unless outputs
    # depend on the choice of this number.
    own, other, large, moderate = (
        evaluate(tape, inputs, _saturating(kind)) for kind in ("own", "other", "large", "moderate")
    )
    # An output that is infinite has no scale.
    scales = (abs(x) if math.isfinite(x) else 0.0 for x in moderate)
    if all(
        max(abs(x - z), abs(y - z)) <= _UNSEEN * max(abs(x), scale) and math.isfinite(y)
        for x, y, z, scale in zip(own, other, large, scales, strict=True)
    ):
        return own
    return found


def _without_branches(tape: Tape, inputs: Sequence[float]) -> Tape:
    """Return the tape with 0 in place of unneeded operations."""
    values: list[Any] = [*inputs, *[0.0] * len(tape.operations)]

    def compute(slot: int) -> None:
        values[slot] = _result(tape.operations[slot - tape.n_inputs], values, FLOATS)

    live = set(live_slots(tape, compute, lambda slot: bool(values[slot]), for_series=False))
    nothing = Operation("linear", (), Linear(0.0, ()))
    kept = enumerate(tape.operations, tape.n_inputs)
    return replace(tape, operations=tuple(each if slot in live else nothing for slot, each in kept))


def _saturating(kind: str) -> Functions[float]:
    exp = partial(_saturated, kind)
    return replace(FLOATS, exp=exp, elementary={**FLOATS.elementary, **with_exponential(exp)})


def _saturated(kind: str, x: float) -> float:
    if x < -_LARGE_ARGUMENT and kind in _SMALL:
        return _SMALL[kind]
    if not x > _LARGE_ARGUMENT:
        return exponential(x)
    if kind == "large":
        return 2.0**1000
    # Replacements depend on the argument; otherwise a quotient of two would be 1 for each kind.
    part = math.fmod(math.frexp(min(x, 1e308))[0] * (1e7 if kind == "other" else 1e4), 1.0)
    return 1.01 + part if kind == "moderate" else math.ldexp(1.0, 167 + int(600.0 * part))
