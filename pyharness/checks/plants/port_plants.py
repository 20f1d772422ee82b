"""Self-test with faults planted in a port's requests and answers."""

import copy
import json
import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pyharness.checks.plants.faults import change_at
from pyharness.checks.plants.outcome import Outcome, control
from pyharness.checks.port import Cell, compared
from pyharness.checks.port_process import PortError, PortProcess
from pyharness.checks.port_protocol import VARIABLES, read_number, read_object
from pyharness.model.listing import Listing
from pyharness.model.records import listing_record
from pyharness.model.report import counted

_MOST_CELLS = 24  # most runs in which the faults are planted

Row = list[float]
# Changes a parsed request or answer in place, unless the fault cannot occur in it.
Change = Callable[[dict[str, Any]], object]


@dataclass(frozen=True)
class PortPlant:
    """A fault planted in a port's answer or, if `in_request`, in the request."""

    name: str
    fault: str
    change: Change
    in_request: bool = False


def _middle(rows: list[Row]) -> int:
    return len(rows) // 2


def _in_row(change: Callable[[Row], Row], last: bool = False) -> Change:
    def changed(rows: list[Row]) -> list[Row]:
        n = -1 if last else _middle(rows)
        rows[n] = change(rows[n])
        return rows

    return change_at("rows", changed)


def _in_rows(change: Callable[[list[Row]], list[Row]]) -> Change:
    return change_at("rows", lambda rows: change(rows) if len(rows) > 1 else rows)


def _in_column(column: int, change: Callable[[float], float], last: bool = False) -> Change:
    return _in_row(lambda row: [*row[:column], change(row[column]), *row[column + 1 :]], last)


def _next_float(x: float) -> float:
    return math.nextafter(x, math.inf)


def _single(row: Row) -> Row:
    with np.errstate(over="ignore"):
        return [float(np.float32(x)) for x in row]


def _shifted(rows: list[Row]) -> list[Row]:
    return [[row[0], *before[1:]] for row, before in zip(rows, [rows[0], *rows], strict=False)]


def _give_ier(answer: dict[str, Any]) -> None:
    if answer["ier"] is None:
        answer["ier"] = [0] * len(answer["rows"])


def _hide_stop(answer: dict[str, Any]) -> None:
    if answer["stop"]:
        answer |= {"stop": None, "ended": "overflow"}


def _hide_test_row(answer: dict[str, Any]) -> None:
    if answer["stop"]:
        del answer["rows"][-1:]


def _without(name: str) -> Change:
    return lambda answer: answer.pop(name)


def _with_listing(of_program: Callable[[str], Listing]) -> Change:
    return lambda asked: asked.update(listing=listing_record(of_program(asked["program"])))


_OTHER_ENDING = {"complete": "overflow", "overflow": "complete"}
_requested = partial(PortPlant, in_request=True)

PLANTS = (
    *(
        PortPlant(f"bit-{name}", f"one bit of {name} in the middle row", _in_column(i, _next_float))
        for i, name in enumerate(VARIABLES)
    ),
    PortPlant("last-bit", "one bit of V3 in the last row", _in_column(6, _next_float, last=True)),
    PortPlant("nan", "NaN in place of U2 in the middle row", _in_column(2, lambda x: math.nan)),
    PortPlant("infinity", "infinity in place of V1 in the last row",
              _in_column(4, lambda x: math.inf, last=True)),
    PortPlant("sign", "omega has the opposite sign in the middle row",
              _in_row(lambda row: [row[0], *(-x for x in row[1:4]), *row[4:]])),
    PortPlant("swapped-vectors", "omega and velocity are exchanged in a row",
              _in_row(lambda row: [row[0], *row[4:7], *row[1:4]])),
    PortPlant("swapped-columns", "U1 and U2 are exchanged",
              _in_rows(lambda rows: [[row[0], row[2], row[1], *row[3:]] for row in rows])),
    PortPlant("single", "the middle row is rounded to binary32", _in_row(_single)),
    PortPlant("decimal", "the last row is written with 15 digits",
              _in_row(lambda row: [float(f"{x:.14e}") for x in row], last=True)),
    PortPlant("dropped-row", "the middle row is missing",
              _in_rows(lambda rows: rows[: _middle(rows)] + rows[_middle(rows) + 1 :])),
    PortPlant("doubled-row", "the middle row occurs twice",
              _in_rows(lambda rows: rows[: _middle(rows)] + rows[_middle(rows) - 1 : -1])),
    PortPlant("no-rows", "no row", _in_rows(lambda rows: [])),
    PortPlant("reversed", "the rows are in reverse order", _in_rows(lambda rows: rows[::-1])),
    PortPlant("stale-first-row", "the first row has the results of the second one",
              _in_rows(lambda rows: [[rows[0][0], *rows[1][1:]], *rows[1:]])),
    PortPlant("shifted", "each row has the results of the row before", _in_rows(_shifted)),
    PortPlant("time-by-product", "TIME is n h, and not a sum",
              _in_rows(lambda rows: [[n * rows[0][0], *row[1:]] for n, row in enumerate(rows, 1)])),
    PortPlant("time-from-zero", "TIME is that of the start of the step",
              _in_rows(lambda rows: [[row[0] - rows[0][0], *row[1:]] for row in rows])),
    PortPlant("short-row", "the middle row has six numbers", _in_row(lambda row: row[:-1])),
    PortPlant("wrong-ending", "the run ended in another way",
              change_at("ended", lambda end: _OTHER_ENDING.get(end, end))),
    PortPlant("missing-stop", "the stop is reported as an overflow", _hide_stop),
    PortPlant("stop-step", "the step of the stop is counted from 0",
              change_at("stop.step", lambda step: step - 1)),
    PortPlant("stop-variable", "the stop is by another variable",
              change_at("stop.variable", lambda name: "U2" if name != "U2" else "U1")),
    PortPlant("stop-quotient", "one bit of the quotient",
              change_at("stop.quotient", _next_float)),
    PortPlant("stop-row", "the row of the step that stops is missing", _hide_test_row),
    PortPlant("ier-null", "IER is missing", change_at("ier", lambda ier: None)),
    PortPlant("ier-value", "the last IER is 129 in place of 0, or the reverse",
              change_at("ier", lambda ier: [*ier[:-1], 129 - ier[-1]])),
    PortPlant("ier-given", "IER of a program that prints none", _give_ier),
    *(PortPlant(f"lacks-{name}", f"the field {name} is missing", _without(name))
      for name in ("rows", "ended", "stop", "ier")),
    _requested("corrected", "the listing is ignored: no defect is active",
               _with_listing(Listing.corrected)),
    _requested("original", "the listing is ignored: all defects are active",
               _with_listing(Listing.original)),
    _requested("readings", "the readings are ignored",
               change_at("listing.readings", lambda names: [])),
    _requested("conjectures", "the conjectures are ignored",
               change_at("listing.conjectures", lambda names: [])),
    _requested("omega", "one bit of the initial omega",
               change_at("scene.initial.omega", lambda w: [_next_float(w[0]), *w[1:]])),
    _requested("step-size", "one bit of the step size",
               change_at("scene.run.step_size", _next_float)),
    _requested("moments", "the first two moments are exchanged",
               change_at("scene.body.moments", lambda m: [m[1], m[0], m[2]])),
    _requested("one-mass", "the mass of the first axis is used for all",
               change_at("scene.masses", lambda masses: [masses[0]] * 3)),
    _requested("torque-rate", "the linear term of the torque is ignored",
               change_at("scene.torque.rate", lambda rate: [0.0] * 3)),
    _requested("cosines", "the cosines of the torque are ignored",
               change_at("scene.torque.cosines", lambda waves: [])),
    _requested("initial-torque", "the initial torque is ignored",
               change_at("scene.initial_torque", lambda torque: None)),
)  # fmt: skip
"""The planted faults."""


def self_test(command: str, cells: Sequence[Cell]) -> Iterator[Outcome]:
    """Yield the outcome without a fault (the control), then with each planted fault.

    After an invalid answer the control fails.
    """
    chosen = _chosen(cells)
    try:
        with PortProcess(command) as process:
            yield from _planted(process, chosen)
    except PortError as error:
        yield control(1, str(error))


def _chosen(cells: Sequence[Cell]) -> list[Cell]:
    # A sample that covers programs, listings and cases.
    order = random.Random("self-test").sample(range(len(cells)), len(cells))
    found: dict[tuple[object, ...], int] = {}
    for n in order:
        cell = cells[n]
        label = cell.listing.label if len(found) < _MOST_CELLS // 2 else "any"
        has_more = bool(cell.listing.readings), bool(cell.listing.conjectures)
        found.setdefault((cell.listing.program, label, cell.scene.case, *has_more), n)
    return [cells[n] for n in sorted(list(found.values())[:_MOST_CELLS])]


def _planted(process: PortProcess, cells: Sequence[Cell]) -> Iterator[Outcome]:
    lines = [process.ask(cell.request) for cell in cells]
    twins = [cell.twin() for cell in cells]
    checked = [compared(*each) for each in zip(cells, twins, lines, strict=True)]
    failed = [check for check in checked if not check.passed]
    example = f"{failed[0].id}: {failed[0].note}" if failed else ""
    yield control(len(failed), example or f"nothing fails in {counted(len(cells), 'run')}")
    answers = [_parsed(line) for line in lines]
    for plant in PLANTS:
        changed, notes = 0, []
        for cell, twin, answer in zip(cells, twins, answers, strict=True):
            right = json.loads(cell.request) if plant.in_request else answer
            faulty = copy.deepcopy(right)
            plant.change(faulty)
            if plant.in_request:
                has_changed = faulty != right
                asked = json.dumps(faulty).encode()
                faulty = _parsed(process.ask(asked)) if has_changed else answer
            # Compare answers as text, because NaN differs from itself, and zeros have a sign.
            if json.dumps(faulty, sort_keys=True) == json.dumps(answer, sort_keys=True):
                continue
            changed += 1
            try:
                check = compared(cell, twin, _written(faulty))
            except PortError as error:
                notes.append(f"{cell.of.id}: {error}")
            else:
                notes += [] if check.passed else [f"{check.id}: {check.note}"]
        seen = f"noticed in {len(notes)} of {counted(changed, 'changed run')}"
        note = " ".join([seen, *(f"({each})" for each in notes[:1])])
        note = note if changed else "changes no answer in these runs"
        count = len(notes)
        yield Outcome(plant.name, plant.fault, count == changed, count, note, changed > 0)


def _parsed(line: bytes) -> dict[str, Any]:
    answer = read_object(line)
    answer["rows"] = [[read_number("rows", x) for x in row] for row in answer["rows"]]
    change_at("stop.quotient", partial(read_number, "stop"))(answer)
    return answer


def _written(answer: dict[str, Any]) -> bytes:
    written = copy.deepcopy(answer)
    change_at("rows", lambda rows: [[x.hex() for x in row] for row in rows])(written)
    change_at("stop.quotient", float.hex)(written)
    return json.dumps(written).encode()
