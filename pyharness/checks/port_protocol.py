"""Requests to a port and its answers, described in docs/how-to/ports.md."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pyharness.checks.port_process import PortError
from pyharness.model.errors import kind_of
from pyharness.model.facts import facts
from pyharness.model.json_text import parse_json
from pyharness.model.listing import Listing
from pyharness.model.records import listing_record, scene_record
from pyharness.model.scene import Scene
from pyharness.model.schema import SCHEMAS
from pyharness.model.trajectory import STOP_VARIABLES, Array, Stop
from pyharness.model.values import parsed_float
from pyharness.thesis.equations import card_torque

VARIABLES = ("TIME", "U1", "U2", "U3", "V1", "V2", "V3")
"""Columns of a row of results, as in TAPE5: TIME (s), omega (rad/s), velocity (m/s)."""
ENDINGS = ("complete", "stopped", "overflow")


@dataclass(frozen=True, eq=False)
class Answer:
    rows: Array  # TIME (s), omega and velocity after each step, shape (n, 7)
    ended: str  # one of `ENDINGS`
    stop: Stop | None
    ier: list[int] | None  # error code of each step; None for a program that prints none


def request(
    scene: Scene, listing: Listing, lipschitz: float | None = None, may_stop: bool = True
) -> bytes:
    """Return the JSON line that requests a run; `lipschitz` is the stop test's constant (1/s)."""
    asked = {
        "schema": SCHEMAS["port request"],
        "program": listing.program,
        "scene": requested_scene(scene),
        "listing": listing_record(listing),
        "lipschitz": facts("cases")["deck"]["lipschitz"] if lipschitz is None else lipschitz,
        "may_stop": may_stop,
    }
    return json.dumps(asked, allow_nan=False).encode()


def requested_scene(scene: Scene) -> dict[str, Any]:
    return {
        **scene_record(scene),
        "masses": scene.masses,
        "forces": scene.forces,
        "initial_torque": card_torque(scene),
    }


def read_answer(line: bytes, steps: int) -> Answer:
    """Return a port's answer for `steps` steps, or raise PortError."""
    given = read_object(line)
    for name in ("rows", "ended", "stop", "ier"):
        if name not in given:
            raise PortError(f"no '{name}'; an answer has rows, ended, stop and ier")
    ended = read_name("ended", given["ended"], ENDINGS)
    told = f"it takes {len(VARIABLES)}: {' '.join(VARIABLES)}"
    numbered = enumerate(read_list("rows", given["rows"]), 1)
    rows = [read_row(f"row {number}", row, len(VARIABLES), told) for number, row in numbered]
    if len(rows) > steps or (ended == "complete" and len(rows) < steps):
        raise PortError(f"{len(rows)} rows of a run of {steps} steps that ended '{ended}'")
    stop = None if given["stop"] is None else _stop(given["stop"])
    if (stop is None) == (ended == "stopped"):
        raise PortError(f"ended '{ended}' with {'no' if stop is None else 'a'} stop")
    ier = given["ier"]
    if ier is not None:
        ier = [read_whole("ier", value) for value in read_list("ier", ier)]
        if len(ier) != len(rows):
            raise PortError(f"{len(ier)} values of ier with {len(rows)} rows")
    return Answer(np.array(rows).reshape(-1, len(VARIABLES)), ended, stop, ier)


def read_object(line: bytes) -> dict[str, Any]:
    try:
        given = parse_json(line)
    except ValueError as error:
        shown = repr(line[:60].decode(errors="replace"))
        raise PortError(f"no JSON: {shown} ({error})") from None
    if not isinstance(given, dict):
        raise PortError(f"{kind_of(given)} where an object belongs")
    return given


def _stop(stop: object) -> Stop:
    if not isinstance(stop, dict) or {"step", "variable", "quotient"} - set(stop):
        raise PortError("stop is no object with step, variable and quotient")
    if stop["variable"] not in STOP_VARIABLES:
        allowed = ", ".join(STOP_VARIABLES)
        raise PortError(f"stop variable {json.dumps(stop['variable'])[:60]}; allowed: {allowed}")
    step = read_whole("stop step", stop["step"])
    return Stop(step, stop["variable"], read_number("stop quotient", stop["quotient"]))


def read_list(where: str, value: object) -> list[Any]:
    if not isinstance(value, list):
        raise PortError(f"{where}: {kind_of(value)} where a list belongs")
    return value


def read_row(where: str, row: object, width: int, told: str) -> list[float]:
    """Return a JSON list of `width` numbers; a PortError for another length ends with `told`."""
    values = read_list(where, row)
    if len(values) != width:
        raise PortError(f"{where} has {len(values)} numbers; {told}")
    return [read_number(where, value) for value in values]


def read_name(field: str, value: object, allowed: Sequence[str]) -> str:
    if value not in allowed:
        raise PortError(f"{field} is {json.dumps(value)[:60]}; allowed: {', '.join(allowed)}")
    return str(value)


def read_whole(where: str, value: object) -> int:
    if type(value) is not int:
        raise PortError(f"{where}: {kind_of(value)} where a whole number belongs")
    return value


def read_number(where: str, value: object) -> float:
    """Return a number from JSON or from decimal or hexadecimal text, or raise PortError."""
    if type(value) is float:
        return value
    try:
        if type(value) is int:
            return float(value)
        if isinstance(value, str):
            return float.fromhex(value) if "x" in value.lower() else parsed_float(value)
    except (ValueError, OverflowError):
        raise PortError(f"{where}: {json.dumps(value)[:60]} is no number of binary64") from None
    raise PortError(f"{where}: {kind_of(value)} where a number belongs")
