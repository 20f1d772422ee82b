"""Inertias as functions of time, from functions, expressions or tables."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.called_function import called_once
from pyharness.model.changing import Changing
from pyharness.model.dual import with_derivatives
from pyharness.model.errors import InputError, TimedError
from pyharness.model.expressions import text_components
from pyharness.model.symbols import SYMBOLS, Recorder, Symbol, recorded_twice
from pyharness.model.tape import N_INPUTS, TIME, Table, Tape, evaluate, float_outputs, slots_of
from pyharness.model.tape_arrays import ARRAYS, value_of_table, without_equal_constants
from pyharness.model.values import three

COUNTS = {"moments": 3, "inertia": 9}
_RETURNS = {"moments": "three moments", "inertia": "three rows of three numbers"}
_CHECKED = 1000  # number of times up to the end at which moments must be above 0
_TRIED = (0.0, 0.37, 1.9, 11.3, -0.7)  # times (s) at which a matrix must be symmetric
_CONTINUOUS = 1e-9  # largest relative jump of an element that counts as rounding


@dataclass(frozen=True)
class InertiaFunction(Changing):
    """An inertia that is a continuous function of time."""

    place: str
    tape: Tape  # of three moments, or of nine matrix elements by rows
    # The expressions and numbers of a scene file, or the items of a table.
    written: tuple[Any, ...] = field(default=(), compare=False)

    def __repr__(self) -> str:
        return f"InertiaFunction({self.place}, {self.phrase})"

    @property
    def phrase(self) -> str:
        values = self.values()
        if values is None:
            return "a recorded function of t"
        if isinstance(values, dict):
            return f"a table of {len(values['times'])} times"
        return ", ".join(str(each).replace("'", "") for each in values)

    def values(self) -> list[Any] | dict[str, Any] | None:
        """Return the inertia as in a scene file; None for a Python function."""
        is_table = self.written and isinstance(self.written[0], tuple)
        return dict(self.written) if is_table else list(self.written) or None

    @property
    def is_constant(self) -> bool:
        return not self.tape.inputs

    @cached_property
    def _with_rates(self) -> Tape:
        return with_derivatives(self.tape, [TIME])

    def matrix(self, time: Any) -> list[list[Any]]:
        return self._rows(_outputs(self.tape, time))

    def matrix_rate(self, time: Any) -> list[list[Any]]:
        return self._rows(_outputs(self._with_rates, time)[COUNTS[self.place] :])

    def _rows(self, found: Sequence[Any]) -> list[list[Any]]:
        if self.is_diagonal:
            return [[found[i] if i == j else 0.0 for j in range(3)] for i in range(3)]
        # Only the upper triangle is used, because the lower one may be rounded otherwise.
        return [[found[3 * min(i, j) + max(i, j)] for j in range(3)] for i in range(3)]

    @cached_property
    def span(self) -> tuple[float, float]:
        """An infinite interval, because a moment that reaches 0 ends the integration."""
        return -np.inf, np.inf

    def check(self, times: Iterable[float]) -> None:
        """Raise InputError unless moments are above 0 at 1001 times up to each of `times` (s)."""
        for end in times:
            if not (end and np.isfinite(end)):
                continue
            tried = np.linspace(0.0, end, _CHECKED + 1)
            for time, least in zip(tried, self._least(tried), strict=True):
                if not least > 0.0:
                    raise TimedError(
                        f"[body] {self.place}: a principal moment is {least:g} kg m2 at t = "
                        "{time} s; allowed: moments above 0 at all times of the solution",
                        time,
                    )

    def _least(self, times: Array) -> Array:
        elements = [np.broadcast_to(each, len(times)) for row in self.matrix(times) for each in row]
        matrices = np.stack(elements, axis=1).reshape(-1, 3, 3)
        finite = np.isfinite(matrices).all(axis=(1, 2))
        least: Array = np.linalg.eigvalsh(np.where(finite[:, None, None], matrices, 0.0))[:, 0]
        return np.where(finite, least, np.nan)


def _outputs(tape: Tape, time: Any) -> list[Any]:
    inputs = [time, *[0.0] * (N_INPUTS - 1)]
    if isinstance(time, Symbol):
        return evaluate(tape, inputs, SYMBOLS)
    if isinstance(time, np.ndarray):
        with np.errstate(all="ignore"):
            return evaluate(tape, inputs, ARRAYS)
    try:
        return float_outputs(tape, inputs)
    except ZeroDivisionError:
        return [np.nan] * len(tape.outputs)


def inertia_function(place: str, function: Callable[[Any], Any]) -> InertiaFunction:
    """Return the inertia that a user's function computes.

    The function must be recordable, continuous, and depend on time alone.
    """
    where, allowed = f"[body] {place}", f"a function of t that returns {_RETURNS[place]}, in kg m2"

    def record(recorder: Recorder) -> Tape:
        time, *_ = recorder.inputs()
        found = np.array(called_once(function, (time,), recorder, allowed), dtype=object)
        if found.shape != ((3,) if place == "moments" else (3, 3)):
            raise InputError(f"{where}: the function returned another shape; allowed: {allowed}")
        return recorder.tape(found.ravel().tolist())

    new = partial(Recorder, place=where, instead="inertia_table, a spline through given moments")
    return checked_function(InertiaFunction(place, recorded_twice(record, new)))


def inertia_of_texts(place: str, values: Any) -> InertiaFunction:
    where = f"[body] {place}"
    rows = [values] if place == "moments" else values
    if not isinstance(values, list) or not all(
        isinstance(row, list) and len(row) == 3 for row in (values, *rows)
    ):
        raise InputError(f"{where}: another shape; allowed: {_RETURNS[place]} or expressions of t")
    flat = [each for row in rows for each in row]
    recorder = Recorder(place=where, has_lines=False)
    texts = {f"{where}, number {n}": each for n, each in enumerate(flat, 1)}
    tape = recorder.tape(text_components(texts, recorder.inputs()))
    if tape.inputs - {TIME}:
        raise InputError(f"{where}: an expression of the state; allowed: expressions of t")
    return checked_function(InertiaFunction(place, tape, tuple(values)))


def inertia_of_tables(
    place: str, tables: Iterable[Table], written: tuple[Any, ...]
) -> InertiaFunction:
    """Return the inertia whose elements are `tables` over time; `written` is for scene files."""
    recorder = Recorder(place=f"[body] {place}")
    time, *_ = recorder.inputs()
    values = [value_of_table(without_equal_constants(each), time) for each in tables]
    return checked_function(InertiaFunction(place, recorder.tape(values), written))


def checked_function(found: InertiaFunction) -> InertiaFunction:
    """Return `found`; raise InputError if it may jump or, at time 0, is not positive definite.

    An inertia matrix must be symmetric at several times.
    """
    from pyharness.model.inertia import checked_inertia

    where = f"[body] {found.place}"
    _check_continuous(found.tape, where)
    start = found.at(0.0)
    if found.is_diagonal:
        moments = three(f"{where} at time 0", start)
        if min(moments) <= 0.0:
            raise InputError(f"{where} at time 0: {min(moments):g}; allowed: numbers above 0")
    else:
        checked_inertia(f"{where} at time 0", start)
        for time in _TRIED:
            matrix = np.array(_outputs(found.tape, time)).reshape(3, 3)
            if (np.abs(matrix - matrix.T) > _CONTINUOUS * np.abs(matrix).max()).any():
                raise InputError(
                    f"{where} at t = {time:g} s: not symmetric; allowed: a symmetric one"
                )
    return found


def _check_continuous(tape: Tape, where: str) -> None:
    jumps = InputError(
        f"{where}: an inertia that may jump; allowed: minimum, maximum, abs, clip, interp, tables "
        "with the interpolation linear or cubic"
    )
    linear: dict[int, dict[int, float]] = {}
    switches: dict[int, int] = {}

    def expanded(slot: int) -> dict[int, float]:
        return linear.get(slot, {slot: 1.0})

    for slot, operation in enumerate(tape.operations, tape.n_inputs):
        kind, operands, own, table = operation
        if own is not None:
            total = {-1: own.constant}
            for each, factor in own.terms:
                for term, value in expanded(each).items():
                    total[term] = total.get(term, 0.0) + factor * value
            linear[slot] = total
        elif kind == "switch":
            switches[slot] = operands[0]
        elif kind == "floor" or (table is not None and _has_jumps(table)):
            raise jumps
        elif kind == "select":
            condition, first, second = operands
            # The choice is continuous if the difference of its two values is 0 where the condition
            # changes.
            one, other = expanded(first), expanded(second)
            difference = {x: one.get(x, 0.0) - other.get(x, 0.0) for x in {*one, *other}}
            if condition not in switches or not _are_proportional(
                difference, expanded(switches[condition])
            ):
                raise jumps
    used = [slot for output in tape.outputs for slot, _ in output.terms]
    for operation in tape.operations:
        used += slots_of(operation)[operation.kind == "select" :]
    if not switches.keys().isdisjoint(used):
        raise jumps


def _are_proportional(first: dict[int, float], second: dict[int, float]) -> bool:
    keys = sorted({*first, *second})
    one, other = (np.array([each.get(key, 0.0) for key in keys]) for each in (first, second))
    factor = (one @ other) / (other @ other)
    return bool(np.abs(one - factor * other).max() <= _CONTINUOUS * np.abs(one).max())


def _has_jumps(table: Table) -> bool:
    lengths = np.diff(table.breaks)
    c0, c1, c2, c3 = table.pieces[:-1].T
    ends = c0 + lengths * (c1 + lengths * (c2 + lengths * c3))
    # If the terms of an end cancel, their sizes limit the rounding error of the sum.
    sizes = abs(c0) + lengths * (abs(c1) + lengths * (abs(c2) + lengths * abs(c3)))
    return bool((np.abs(ends - table.pieces[1:, 0]) > _CONTINUOUS * sizes).any())
