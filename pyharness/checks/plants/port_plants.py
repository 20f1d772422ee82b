"""Planted faults in the answers of a port, and the self-test of `verify --port` with them."""

import copy
import json
import math
import random
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pyharness.checks.check import Check, Name
from pyharness.checks.port import Cell, compared
from pyharness.checks.port_process import PortError, PortProcess
from pyharness.checks.port_protocol import VARIABLES
from pyharness.checks.report import checks_report, summary_page
from pyharness.model.listing import Listing
from pyharness.model.report import Report, counted

Rows = list[list[float]]
# A change of the parsed answer. It returns None if the fault has no meaning for this answer.
AnswerFault = Callable[[dict[str, Any]], dict[str, Any] | None]
# A change of the request, as if the port ignored a field of it.
RequestFault = Callable[[dict[str, Any]], None]
_MOST_CELLS = 24  # cells in which the faults are planted


@dataclass(frozen=True)
class PortPlant:
    """A fault that is planted in a port: its name, its description, and how to plant it.

    Either `answer` changes the port's answer, or `request` changes the request that the port gets.
    """

    name: str
    fault: str
    answer: AnswerFault | None = None
    request: RequestFault | None = None


@dataclass(frozen=True)
class Noticed:
    """The runs in which a planted fault changed the port's answer, and those that failed.

    Attributes
    ----------
    plant : PortPlant or None
        The planted fault; None for the control without a fault.
    changed : int
        The number of runs in which the fault changed the answer; all runs for the control.
    failed : int
        The number of these runs whose check failed.
    example : str
        The id and the note of one failed check.
    """

    plant: PortPlant | None
    changed: int
    failed: int
    example: str

    @property
    def passed(self) -> bool:
        """Return whether each changed answer was noticed; for the control, whether none failed.

        A fault that changed no answer, as a fault of the stop test in runs without a stop, passes.
        The report counts such faults.
        """
        return self.changed == self.failed if self.plant else self.failed == 0

    @property
    def has_effect(self) -> bool:
        """Return whether the planted fault changed an answer; true for the control."""
        return self.plant is None or self.changed > 0


def _middle(rows: Rows) -> int:
    return len(rows) // 2


def _in_row(change: Callable[[list[float]], None], last: bool = False) -> AnswerFault:
    """Return a fault that changes the middle row of an answer, or its last row."""

    def plant(answer: dict[str, Any]) -> dict[str, Any] | None:
        rows: Rows = answer["rows"]
        if not rows:
            return None
        change(rows[-1 if last else _middle(rows)])
        return answer

    return plant


def _in_rows(change: Callable[[Rows], Rows], least: int = 2) -> AnswerFault:
    """Return a fault that changes the list of all rows, if there are at least `least` of them."""

    def plant(answer: dict[str, Any]) -> dict[str, Any] | None:
        if len(answer["rows"]) < least:
            return None
        answer["rows"] = change(answer["rows"])
        return answer

    return plant


def _bit(column: int) -> Callable[[list[float]], None]:
    def change(row: list[float]) -> None:
        row[column] = math.nextafter(row[column], math.inf)

    return change


def _set(column: int, value: float) -> Callable[[list[float]], None]:
    def change(row: list[float]) -> None:
        row[column] = value

    return change


def _negate(row: list[float]) -> None:
    row[1:4] = [-x for x in row[1:4]]


def _shorten(row: list[float]) -> None:
    row.pop()


def _swap(row: list[float]) -> None:
    row[1:4], row[4:7] = row[4:7], row[1:4]


def _single(row: list[float]) -> None:
    import numpy as np

    with np.errstate(over="ignore"):
        row[:] = np.array(row).astype(np.float32).tolist()


def _decimal(row: list[float]) -> None:
    row[:] = [float(f"{x:.14e}") for x in row]


def _swapped_columns(rows: Rows) -> Rows:
    return [[row[0], row[2], row[1], *row[3:]] for row in rows]


def _time_by_product(rows: Rows) -> Rows:
    return [[(n + 1) * rows[0][0], *row[1:]] for n, row in enumerate(rows)]


def _time_from_zero(rows: Rows) -> Rows:
    return [[row[0] - rows[0][0], *row[1:]] for row in rows]


def _shifted(rows: Rows) -> Rows:
    return [[row[0], *before[1:]] for row, before in zip(rows, [rows[0], *rows], strict=False)]


def _stale_first(rows: Rows) -> Rows:
    return [[rows[0][0], *rows[1][1:]], *rows[1:]]


def _with_ier(change: Callable[[list[int]], list[int] | None]) -> AnswerFault:
    def plant(answer: dict[str, Any]) -> dict[str, Any] | None:
        if not answer["ier"]:
            return None
        answer["ier"] = change(answer["ier"])
        return answer

    return plant


def _ier_of_none(answer: dict[str, Any]) -> dict[str, Any] | None:
    if answer["ier"] is not None:
        return None
    answer["ier"] = [0] * len(answer["rows"])
    return answer


def _at_stop(**values: Callable[[Any], Any]) -> AnswerFault:
    def plant(answer: dict[str, Any]) -> dict[str, Any] | None:
        if answer["stop"] is None:
            return None
        for name, change in values.items():
            answer["stop"][name] = change(answer["stop"][name])
        return answer

    return plant


def _no_stop(answer: dict[str, Any]) -> dict[str, Any] | None:
    if answer["stop"] is None:
        return None
    return {**answer, "stop": None, "ended": "overflow"}


def _ended(answer: dict[str, Any]) -> dict[str, Any] | None:
    if answer["ended"] == "stopped":
        return None
    return {**answer, "ended": "overflow" if answer["ended"] == "complete" else "complete"}


def _without(name: str) -> AnswerFault:
    def plant(answer: dict[str, Any]) -> dict[str, Any] | None:
        del answer[name]
        return answer

    return plant


def _without_test_row(answer: dict[str, Any]) -> dict[str, Any] | None:
    return {**answer, "rows": answer["rows"][:-1]} if answer["stop"] else None


def _all_corrected(asked: dict[str, Any]) -> None:
    asked["listing"] = {
        "label": "corrected", **{k: [] for k in ("defects", "readings", "conjectures")},
    }  # fmt: skip


def _all_original(asked: dict[str, Any]) -> None:
    listing = Listing.original(asked["program"])
    asked["listing"] = {
        "label": "original", "readings": [], "defects": sorted(listing.defects),
        "conjectures": sorted(listing.conjectures),
    }  # fmt: skip


def _without_kind(kind: str) -> RequestFault:
    def change(asked: dict[str, Any]) -> None:
        asked["listing"][kind] = []

    return change


def _in_scene(*path: str, change: Callable[[Any], Any]) -> RequestFault:
    def plant(asked: dict[str, Any]) -> None:
        place = asked["scene"]
        for name in path[:-1]:
            place = place[name]
        if path[-1] in place:
            place[path[-1]] = change(place[path[-1]])

    return plant


def _one_mass(masses: list[float]) -> list[float]:
    return [masses[0]] * 3


def _next_float(x: float) -> float:
    return math.nextafter(x, math.inf)


def _first_up(values: list[float]) -> list[float]:
    return [_next_float(values[0]), *values[1:]]


def _exchanged(values: list[float]) -> list[float]:
    return [values[1], values[0], values[2]]


PLANTS = (
    *(
        PortPlant(f"bit-{name}", f"one bit of {name} in the middle row", _in_row(_bit(i)))
        for i, name in enumerate(VARIABLES)
    ),
    PortPlant("last-bit", "one bit of V3 in the last row", _in_row(_bit(6), last=True)),
    PortPlant("nan", "NaN in place of U2 in the middle row", _in_row(_set(2, math.nan))),
    PortPlant("infinity", "infinity in place of V1 in the last row",
              _in_row(_set(4, math.inf), last=True)),
    PortPlant("sign", "omega has the opposite sign in the middle row", _in_row(_negate)),
    PortPlant("swapped-vectors", "omega and velocity are exchanged in a row", _in_row(_swap)),
    PortPlant("swapped-columns", "U1 and U2 are exchanged", _in_rows(_swapped_columns)),
    PortPlant("single", "the middle row is rounded to binary32", _in_row(_single)),
    PortPlant("decimal", "the last row is written with 15 digits", _in_row(_decimal, last=True)),
    PortPlant("dropped-row", "the middle row is missing",
              _in_rows(lambda rows: rows[: _middle(rows)] + rows[_middle(rows) + 1 :])),
    PortPlant("doubled-row", "the middle row occurs twice",
              _in_rows(lambda rows: rows[: _middle(rows)] + rows[_middle(rows) - 1 : -1])),
    PortPlant("no-rows", "no row", _in_rows(lambda rows: [])),
    PortPlant("reversed", "the rows are in reverse order", _in_rows(lambda rows: rows[::-1])),
    PortPlant("stale-first-row", "the first row has the results of the second one",
              _in_rows(_stale_first)),
    PortPlant("shifted", "each row has the results of the row before", _in_rows(_shifted)),
    PortPlant("time-by-product", "TIME is n h, and not a sum", _in_rows(_time_by_product)),
    PortPlant("time-from-zero", "TIME is that of the start of the step", _in_rows(_time_from_zero)),
    PortPlant("short-row", "the middle row has six numbers", _in_row(_shorten)),
    PortPlant("wrong-ending", "the run ended in another way", _ended),
    PortPlant("missing-stop", "the stop is reported as an overflow", _no_stop),
    PortPlant("stop-step", "the step of the stop is counted from 0",
              _at_stop(step=lambda step: step - 1)),
    PortPlant("stop-variable", "the stop is by another variable",
              _at_stop(variable=lambda name: "U2" if name != "U2" else "U1")),
    PortPlant("stop-quotient", "one bit of the quotient", _at_stop(quotient=_next_float)),
    PortPlant("stop-row", "the row of the step that stops is missing", _without_test_row),
    PortPlant("ier-null", "IER is missing", _with_ier(lambda ier: None)),
    PortPlant("ier-value", "the last IER is 129 in place of 0, or the reverse",
              _with_ier(lambda ier: [*ier[:-1], 129 - ier[-1]])),
    PortPlant("ier-given", "IER of a program that prints none", _ier_of_none),
    *(PortPlant(f"lacks-{name}", f"the field {name} is missing", _without(name))
      for name in ("rows", "ended", "stop", "ier")),
    PortPlant("corrected", "the listing is ignored: no defect is active", request=_all_corrected),
    PortPlant("original", "the listing is ignored: all defects are active", request=_all_original),
    PortPlant("readings", "the readings are ignored", request=_without_kind("readings")),
    PortPlant("conjectures", "the conjectures are ignored", request=_without_kind("conjectures")),
    PortPlant("omega", "one bit of the initial omega",
              request=_in_scene("initial", "omega", change=_first_up)),
    PortPlant("step-size", "one bit of the step size",
              request=_in_scene("run", "step_size", change=_next_float)),
    PortPlant("moments", "the first two moments are exchanged",
              request=_in_scene("body", "moments", change=_exchanged)),
    PortPlant("one-mass", "the mass of the first axis is used for all",
              request=_in_scene("masses", change=_one_mass)),
    PortPlant("torque-rate", "the linear term of the torque is ignored",
              request=_in_scene("torque", "rate", change=lambda rate: [0.0] * 3)),
    PortPlant("cosines", "the cosines of the torque are ignored",
              request=_in_scene("torque", "cosines", change=lambda waves: [])),
    PortPlant("initial-torque", "the initial torque is ignored",
              request=_in_scene("initial_torque", change=lambda torque: None)),
)  # fmt: skip
"""The planted faults: first those in the answers of a port, then those in the requests."""


def self_test(command: str, cells: Sequence[Cell]) -> Iterator[Noticed]:
    """Yield what the check of a port notices, first without any fault, then with each fault.

    A fault has to be noticed in each run in which it changes the port's answer. At most
    `_MOST_CELLS` of the runs `cells`, chosen always in the same way, are used. If the port gives no
    valid answer, only a failed control is yielded. `command` starts the port.
    """
    chosen = _chosen(cells)
    try:
        with PortProcess(command) as process:
            yield from _planted(process, chosen)
    except PortError as error:
        yield Noticed(None, len(chosen), 1, str(error))


def _chosen(cells: Sequence[Cell]) -> list[Cell]:
    """Return at most `_MOST_CELLS` runs, with every program, if possible every case and ending."""
    order = random.Random("self-test").sample(range(len(cells)), len(cells))
    found: dict[tuple[object, ...], int] = {}
    for n in order:
        cell = cells[n]
        label = cell.listing.label if len(found) < _MOST_CELLS // 2 else "any"
        has_more = bool(cell.listing.readings), bool(cell.listing.conjectures)
        found.setdefault((cell.listing.program, label, cell.scene.case, *has_more), n)
    return [cells[n] for n in sorted(list(found.values())[:_MOST_CELLS])]


def _planted(process: PortProcess, cells: Sequence[Cell]) -> Iterator[Noticed]:
    lines = [process.ask(cell.request) for cell in cells]
    twins = [cell.twin() for cell in cells]
    checked = [compared(*each) for each in zip(cells, twins, lines, strict=True)]
    failed = [check for check in checked if not check.passed]
    example = f"{failed[0].id}: {failed[0].note}" if failed else ""
    yield Noticed(None, len(cells), len(failed), example)
    answers = [_parsed(line) for line in lines]
    for plant in PLANTS:
        changed, notes = 0, []
        for cell, twin, answer in zip(cells, twins, answers, strict=True):
            faulty = _faulty(process, plant, cell, answer)
            if faulty is None or _same(faulty, answer):
                continue
            changed += 1
            try:
                check = compared(cell, twin, _written(faulty))
            except PortError as error:
                check = replace(checked[0], name=cell.of, passed=False, note=str(error))
            if not check.passed:
                notes.append(f"{check.id}: {check.note}")
        yield Noticed(plant, changed, len(notes), notes[0] if notes else "")


def _faulty(
    process: PortProcess, plant: PortPlant, cell: Cell, answer: dict[str, Any]
) -> dict[str, Any] | None:
    if plant.answer is not None:
        return plant.answer(copy.deepcopy(answer))
    assert plant.request is not None
    asked = json.loads(cell.request)
    before = copy.deepcopy(asked)
    plant.request(asked)
    return None if asked == before else _parsed(process.ask(json.dumps(asked).encode()))


def _parsed(line: bytes) -> dict[str, Any]:
    """Return a valid answer as a dictionary, with floats in place of numbers that are texts."""
    answer: dict[str, Any] = json.loads(line)
    answer["rows"] = [[_float(x) for x in row] for row in answer["rows"]]
    if answer["stop"] is not None:
        answer["stop"]["quotient"] = _float(answer["stop"]["quotient"])
    return answer


def _float(x: float | str) -> float:
    if isinstance(x, str):
        return float.fromhex(x) if "x" in x.lower() else float(x)
    return float(x)


def _written(answer: dict[str, Any]) -> bytes:
    rows = {"rows": [[x.hex() for x in row] for row in answer["rows"]]} if "rows" in answer else {}
    stop = answer.get("stop")
    if stop is not None:
        rows["stop"] = {**stop, "quotient": stop["quotient"].hex()}  # type: ignore[assignment]
    return json.dumps({**answer, **rows}).encode()


def _same(faulty: dict[str, Any], answer: dict[str, Any]) -> bool:
    # As text, because NaN differs from itself, and because zeros have a sign.
    return json.dumps(faulty, sort_keys=True) == json.dumps(answer, sort_keys=True)


def as_check(noticed: Noticed) -> Check:
    """Return the result for a planted fault as a check, which passes if the fault was noticed.

    Its value is the number of runs in which the fault was noticed.
    """
    name = Name("self-test", "port", noticed.plant.name if noticed.plant else "none")
    return Check(name, noticed.passed, float(noticed.failed), None, None, _told(noticed))


def _told(noticed: Noticed) -> str:
    if noticed.plant is None:
        return noticed.example or f"nothing fails in {counted(noticed.changed, 'run')}"
    if not noticed.has_effect:
        return "changes no answer in these runs"
    seen = f"noticed in {noticed.failed} of {counted(noticed.changed, 'changed run')}"
    return f"{seen} ({noticed.example})" if noticed.example else seen


def report(command: str, found: Sequence[Noticed]) -> Report:
    """Return the report of the self-test: for each planted fault, in how many runs it was noticed.

    `command` started the port, and `found` has the results, the control first.
    """
    again = f"python -m pyharness verify --port {shlex.quote(command)} --self-test"
    lines = []
    for each in found:
        plant = each.plant
        name, fault = (plant.name, plant.fault) if plant else ("none", "no fault: nothing may fail")
        lines += [f"{'' if each.passed else 'FAILED '}{name}: {fault}", f"  {_told(each)}"]
    missed = sum(not each.passed for each in found)
    idle = sum(not each.has_effect for each in found)
    end = f"{missed} not as it should be" if missed else "each noticed"
    end += f", but {idle} without effect in these runs" if idle else ""
    title = [f"{command}: faults planted in its answers"]
    text = [title, lines, [f"{counted(len(found) - 1, 'plant')} and a control: {end}"]]
    checks = [replace(as_check(each), again=again) for each in found]
    page = summary_page("verify --port --self-test", checks, title)
    return checks_report("verify", checks, text, page, port=command)
