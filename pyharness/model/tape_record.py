"""Conversion of tapes to data for JSON, and back.

A linear combination is a list of its constant and pairs of slot and coefficient. An operation is a
list of its kind, and its operands, linear combination, or breaks and pieces.
"""

import math
from dataclasses import fields
from itertools import pairwise
from typing import Any

from pyharness.model.symbols import MOST_OPERATIONS
from pyharness.model.tape import N_INPUTS, Functions, Linear, Operation, Table, Tape

# The number of operands by kind of operation.
_OPERANDS = {"product": 2, "quotient": 2} | {
    each.name: 1 for each in fields(Functions) if each.name not in ("number", "table")
}


def tape_record(tape: Tape) -> dict[str, Any]:
    """Return a tape as a dictionary for JSON."""
    return {
        "operations": [_operation_record(each) for each in tape.operations],
        "outputs": [_linear_record(each) for each in tape.outputs],
    }


def _operation_record(operation: Operation) -> list[Any]:
    if operation.linear is not None:
        return [operation.kind, _linear_record(operation.linear)]
    if operation.table is not None:
        return [operation.kind, *operation.table]
    return [operation.kind, operation.operands]


def _linear_record(linear: Linear) -> list[Any]:
    return [linear.constant, linear.terms]


def tape_of(record: Any) -> Tape:
    """Return the tape that a dictionary from JSON describes.

    Raise ValueError, TypeError, KeyError or OverflowError if it describes no tape.
    """
    operations = record["operations"]
    if len(operations) > MOST_OPERATIONS:
        raise ValueError("more operations than can be recorded")
    known = tuple(_operation(each, N_INPUTS + n) for n, each in enumerate(operations))
    outputs = tuple(_linear(each, N_INPUTS + len(known)) for each in record["outputs"])
    if len(outputs) != 3:
        raise ValueError("the outputs are not three")
    return Tape(known, outputs)


def _operation(record: Any, slots: int) -> Operation:
    """Return the operation that `record` describes, with operands in slots below `slots`."""
    kind, *rest = record
    if kind == "linear":
        (linear,) = rest
        return Operation(kind, (), _linear(linear, slots))
    if kind == "table":
        breaks, pieces = rest
        return Operation(kind, (), None, _table(breaks, pieces))
    (operands,) = rest
    found = tuple(_slot(each, slots) for each in operands)
    if len(found) != _OPERANDS[kind]:
        raise ValueError("wrong number of operands")
    return Operation(kind, found)


def _linear(record: Any, slots: int) -> Linear:
    constant, terms = record
    found = tuple((_slot(slot, slots), _number(factor)) for slot, factor in terms)
    if any(first >= second for (first, _), (second, _) in pairwise(found)):
        raise ValueError("slots are not in ascending order")
    return Linear(_number(constant), found)


def _table(breaks: Any, pieces: Any) -> Table:
    times = tuple(map(_number, breaks))
    if not times or any(a >= b for a, b in pairwise(times)):
        raise ValueError("breaks are not in ascending order")
    found = []
    for piece, _ in zip(pieces, times, strict=True):
        c0, c1, c2, c3 = map(_number, piece)
        found.append((c0, c1, c2, c3))
    return Table(times, tuple(found))


def _slot(value: Any, slots: int) -> int:
    if type(value) is not int or not 0 <= value < slots:
        raise ValueError("no slot")
    return value


def _number(value: Any) -> float:
    if type(value) is not float or not math.isfinite(value):
        raise ValueError("no finite number")
    return value
