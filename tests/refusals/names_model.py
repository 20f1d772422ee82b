"""More names for the calls: scenes and their files, torques, sweeps."""

from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pyharness import ChangingMoments, Scene, StateTorque, TorqueLaw, read_scene
from pyharness.engine.torques.scene_reader import scene_of
from pyharness.model.expressions import parsed
from pyharness.model.scene_file import scene_text
from pyharness.sweep.sweep_file import read_sweep
from pyharness.torques import wheels
from tests.sweep.sweeps import BASE, PROGRAM, TILT, text

__all__ = ["BASE", "BODY", "BOOMS", "DAMPED_BASE", "DAMPING", "GAINED", "GRAVITY", "INTEGRAL",
           "LAW", "PROGRAM", "READINGS", "START", "TILT", "TILTED", "TURNED", "WHEELED", "Decimal",
           "Fraction", "axis", "expression", "in_file", "parsed", "scene", "scene_text", "sweep",
           "text", "torque"]  # fmt: skip

LAW = TorqueLaw((1.0, 2.0, 3.0), sines=[((1.0, 0.0, 0.5), 4.0)])
TILTED = ((40.0, 2.0, -1.0), (2.0, 30.0, 3.0), (-1.0, 3.0, 20.0))
BOOMS = ChangingMoments([[40.0, 1.5], [30.0, 0.5], [20.0]])


def INTEGRAL(t: Any, omega: Any, states: Any) -> Any:
    """Return a torque and the rate of the scene's own state `turned`."""
    return [0.0, 0.0, -states["turned"]], {"turned": omega[2]}


TURNED = Scene("turned", (0.0, 0.0, 1.0), (2.0, 3.0, 4.0), torque=INTEGRAL, states={"turned": 0.0})


def _gained(t: Any, omega: Any, *, gain: float = 0.5) -> Any:
    return -gain * omega


MOTORS = wheels((0.0, 0.0, 0.5), lambda t, omega, attitude, h: 0.5 * omega + 0.3 * attitude[1:])
WHEELED = Scene("", (0.1, 0.2, -0.1), (4, 3, 2), attitude=(1, 0.2, 0.1, 0), torque=MOTORS)
GAINED = Scene("gained", (0.0, 0.0, 1.0), (2.0, 3.0, 4.0), torque=_gained)
# Parts of scene files.
BODY = "[body]\nmoments = [3, 2, 1]\n"
START = "[initial]\nomega = [1, 2, 3]\n"
DAMPING = {"kind": "damping", "matrix": 0.1}
GRAVITY = '[[torque.terms]]\nkind = "gravity_gradient"\nrate = 0.5\n'
# Parts of sweep files.
DAMPED_BASE = BASE + '[scene.torque]\nexpression = ["-k*w1", "0", "0"]\nconstants = { k = 1.0 }\n'
READINGS = """
reductions = ["status"]
[scene]
case = 3
[[axis]]
field = "program"
values = ["four-term", "runge-kutta"]
[[axis]]
field = "reading"
values = ["adopted", "do-variable"]
"""

_FOLDER = TemporaryDirectory()  # beside that of the row, in which no file may be made


def file(content: str | bytes, name: str) -> Path:
    path = Path(_FOLDER.name) / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def scene(content: str | bytes) -> Scene:
    return read_scene(file(content, "scene.toml"))


def in_file(more: str) -> Scene:
    """Read a scene file that has `more` in addition to a body and omega."""
    return scene(BODY + START + more)


def torque(**table: Any) -> Scene:
    """Read a scene with a table [torque]."""
    body, initial = {"moments": [3, 2, 1]}, {"omega": [1, 2, 3]}
    return scene_of({"body": body, "initial": initial, "torque": table}, "scene")


def expression(text: str, **constants: Any) -> StateTorque | TorqueLaw:
    """Read the second of three expressions."""
    return parsed(["0", text, "0"], constants)


def sweep(*axes: str, **parts: str) -> Any:
    return read_sweep(file(text(*axes, **parts), "sweep.toml"))


def axis(field: str, more: str) -> str:
    """Return a table of a sweep file."""
    return f'[[axis]]\nfield = "{field}"\n{more}\n'
