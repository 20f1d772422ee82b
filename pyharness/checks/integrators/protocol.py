"""Requests to an integrator and its answers; docs/how-to/integrators.md describes the fields."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pyharness.checks.port_process import PortError, PortProcess, refuse_other
from pyharness.checks.port_protocol import read_list, read_name, read_object, read_row
from pyharness.checks.scenes.random_scenes import MODERATE, draw_moderate
from pyharness.model.records import scene_record
from pyharness.model.scene import Scene
from pyharness.model.schema import SCHEMAS
from pyharness.model.trajectory import Array

CONTROLS = ("step_size", "tolerance")
"""The fields of a request by which an integrator may control its accuracy."""
ROUNDINGS = {"binary64": 2.0**-53, "binary32": 2.0**-24}
"""Relative rounding error of each arithmetic that an answer may name."""


@dataclass(frozen=True, eq=False)
class Motion:
    """An integrator's states at the requested times, or its refusal."""

    omega: Array  # rad/s, about the body axes, shape (n, 3)
    attitude: Array | None = None  # unit quaternions, scalar first, body to space, shape (n, 4)
    norm: float = 0.0  # largest deviation of a quaternion's norm from 1 in the answer
    control: str = CONTROLS[0]  # the request's field that sets the accuracy
    rounding: float = ROUNDINGS["binary64"]  # relative rounding error of the arithmetic
    refusal: str = ""

    @property
    def lost(self) -> int:
        """The number of states that are not finite."""
        parts = [self.omega] if self.attitude is None else [self.omega, self.attitude]
        return int((~np.isfinite(np.hstack(parts)).all(axis=1)).sum())


def request(scene: Scene, times: Sequence[float], step_size: float, tolerance: float) -> bytes:
    """Return the JSON line that requests states at `times`, multiples of `step_size` (both in s).

    `tolerance` is relative to the largest omega.
    """
    asked = {
        "schema": SCHEMAS["integrator request"],
        **{name: list(getattr(scene, name) or ()) for name in ("moments", "omega", "attitude")},
        "torque": scene_record(scene)["torque"],
        **{"times": list(times), "step_size": step_size, "tolerance": tolerance},
    }
    return json.dumps(asked, allow_nan=False).encode()


Ask = Callable[[bytes, int], Motion]
"""A function of a request and its number of times that returns the answer."""


def asking_of(process: PortProcess) -> Ask:
    return lambda line, rows: read_motion(process.ask(line), rows)


def refuse_integrator(command: str) -> None:
    """Raise an InputError that advises `--integrator` if `command` starts an integrator."""
    line = request(draw_moderate("", MODERATE[0], 0), [1.0], 0.5, 1e-3)
    refuse_other(command, "--port", "--integrator", line, lambda answer: read_motion(answer, 1))


def read_motion(line: bytes, rows: int) -> Motion:
    """Return an integrator's answer for `rows` times; raise PortError if it is invalid."""
    given = read_object(line)
    if "refused" in given:
        if not isinstance(given["refused"], str) or not given["refused"].strip():
            raise PortError("refused is no text; give the reason in a few words")
        return Motion(np.empty((0, 3)), refusal=given["refused"].strip())
    if "omega" not in given:
        raise PortError("no 'omega'; an answer has omega and attitude, or refused")
    control = read_name("control", given.get("control", CONTROLS[0]), CONTROLS)
    precision = read_name("precision", given.get("precision", "binary64"), tuple(ROUNDINGS))
    rounding = ROUNDINGS[precision]
    omega = _rows("omega", given["omega"], rows, 3)
    if given.get("attitude") is None:
        return Motion(omega, control=control, rounding=rounding)
    attitude = _rows("attitude", given["attitude"], rows, 4)
    with np.errstate(all="ignore"):
        norms = np.hypot.reduce(attitude, axis=1)  # because sums of squares overflow earlier
        unit = attitude / norms[:, None]
    if not norms.all():
        raise PortError(f"attitude, row {int((norms == 0.0).argmax()) + 1}: all four numbers are 0")
    off = float(np.abs(norms - 1.0).max())
    return Motion(omega, unit, off if math.isfinite(off) else math.inf, control, rounding)


def _rows(what: str, value: object, rows: int, width: int) -> Array:
    found = read_list(what, value)
    if len(found) != rows:
        raise PortError(f"{what} has {len(found)} rows; {rows} times were requested")
    named = ((f"{what}, row {number}", row) for number, row in enumerate(found, 1))
    numbers = [read_row(where, row, width, f"allowed: {width}") for where, row in named]
    return np.array(numbers, dtype=float).reshape(-1, width)
