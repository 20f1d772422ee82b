"""Faults planted in the requests to a port and in its answers."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pyharness.checks.port_protocol import VARIABLES
from pyharness.model.listing import Listing

Rows = list[list[float]]
# A change of the parsed answer; None if the fault can't occur in it.
AnswerFault = Callable[[dict[str, Any]], dict[str, Any] | None]
# A change of the request, as if the port ignored a field of it.
RequestFault = Callable[[dict[str, Any]], None]


@dataclass(frozen=True)
class PortPlant:
    """A fault planted in a port's answer, or in the request to it."""

    name: str
    fault: str
    answer: AnswerFault | None = None
    request: RequestFault | None = None


def _middle(rows: Rows) -> int:
    return len(rows) // 2


def _in_row(change: Callable[[list[float]], None], last: bool = False) -> AnswerFault:
    def plant(answer: dict[str, Any]) -> dict[str, Any] | None:
        rows: Rows = answer["rows"]
        if not rows:
            return None
        change(rows[-1 if last else _middle(rows)])
        return answer

    return plant


def _in_rows(change: Callable[[Rows], Rows], least: int = 2) -> AnswerFault:
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
"""The planted faults."""
