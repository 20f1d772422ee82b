"""The self-test of `verify --port`, which must detect faults planted in a port."""

import copy
import json
import random
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from pyharness.checks.plants.outcome import Outcome, control
from pyharness.checks.plants.port_plants import PLANTS, PortPlant
from pyharness.checks.port import Cell, compared
from pyharness.checks.port_process import PortError, PortProcess
from pyharness.model.report import counted

_MOST_CELLS = 24  # cells in which the faults are planted


def self_test(command: str, cells: Sequence[Cell]) -> Iterator[Outcome]:
    """Yield the outcomes without a fault, then with each planted fault.

    Without valid answers, only a failed control is yielded.
    """
    chosen = _chosen(cells)
    try:
        with PortProcess(command) as process:
            yield from _planted(process, chosen)
    except PortError as error:
        yield control(1, str(error))


def _chosen(cells: Sequence[Cell]) -> list[Cell]:
    """Return at most `_MOST_CELLS` runs, a sample of all programs, listings and cases."""
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
        seen = f"noticed in {len(notes)} of {counted(changed, 'changed run')}"
        note = " ".join([seen, *(f"({each})" for each in notes[:1])])
        if not changed:
            note = "changes no answer in these runs"
        is_seen = len(notes) == changed
        yield Outcome(plant.name, plant.fault, is_seen, len(notes), note, changed > 0)


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
    """Return a valid answer as a dictionary, with numbers written as text converted to floats."""
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
    # Compared as text, because NaN differs from itself, and zeros have a sign.
    return json.dumps(faulty, sort_keys=True) == json.dumps(answer, sort_keys=True)
