"""Writing of trajectory files, which `pyharness.engine.torques.trajectory_reader` reads.

The archive has an array for each attribute, the text `scene` of a scene file, and the JSON text
`header` with the rest, such as recorded operations. A linear combination is its constant and a list
of pairs of slot and coefficient. An operation is its kind, followed by a list of operands, a linear
combination, or the breaks and pieces of a table.
"""

import json
import math
import os
from dataclasses import asdict, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.archive import archive_of, checked_file
from pyharness.model.changing import Changing, ChangingInertia, ChangingMoments
from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.errors import InputError
from pyharness.model.fields import FACTS, ROWS
from pyharness.model.inertia_function import InertiaFunction
from pyharness.model.output_files import write_files
from pyharness.model.scene import Scene
from pyharness.model.scene_file import scene_text
from pyharness.model.schema import SCHEMAS
from pyharness.model.state_torque import StateTorque, is_opaque
from pyharness.model.symbols import MOST_OPERATIONS
from pyharness.model.tape import N_INPUTS, SWITCHES, Linear, Operation, Table, Tape
from pyharness.model.torque_law import TorqueLaw

if TYPE_CHECKING:
    from pyharness.model.trajectory import Trajectory

KIND = "pyharness trajectory"  # in the header of each file
OWN = "own"  # an array with a column for each own state, an unknown that `Scene.states` adds
AXES = "axes"  # an array without rows, shape (3, 3)
# The number of events of each function; the times and states of all events.
EVENTS = ("event_counts", "event_times", "event_states")
SENSITIVITIES = "sensitivities"  # columns of all parameters; the header has names and widths
MOST_FUNCTIONS = 10_000  # of events; each has arrays of its own
_TAPED = "The torque was recorded from a function. Its operations are in the header."
# The number of operands by kind of operation.
_OPERANDS = (
    dict.fromkeys(("sqrt", "exp", "tanh", "sine", "cosine", *SWITCHES), 1)
    | dict.fromkeys(("product", "quotient", *WITH_DERIVATIVE), 2)
    | {"select": 3}
)


def save(found: "Trajectory", path: str | os.PathLike[str]) -> None:
    name = checked_file("trajectory file", path)
    write_files({name: file_content(found)}, "trajectory file")


def file_content(found: "Trajectory") -> bytes:
    """Return the bytes of a file, which depend on the trajectory alone."""
    if found.exact is not None:
        raise InputError(
            "the trajectory has numbers in another arithmetic than binary64, which can't be "
            "written to a file; allowed: a trajectory in binary64"
        )
    header: dict[str, Any] = {"kind": KIND, "schema": SCHEMAS["trajectory file"]}
    header |= {name: getattr(found, name) for name in FACTS}
    header["stop"] = None if found.stop is None else asdict(found.stop)
    header["moments"] = _moments_record(found.moments)
    header |= {SENSITIVITIES: None, "scene": None}
    arrays: dict[str, Any] = {}
    if found.scene is not None:
        header["scene"], arrays["scene"] = _scene_record(found.scene)
    for name, each in ROWS.items():
        # In results of a method, `recorded_time` is the array `time`.
        if name != "recorded_time" or found.recorded_time is not found.time:
            value = getattr(found, name)
            arrays |= {} if value is None else {name: np.asarray(value, each.kind)}
    others = {OWN: found.own, AXES: found.axes}
    arrays |= {name: each for name, each in others.items() if each is not None}
    if found.t_events is not None and found.y_events is not None:
        if len(found.t_events) > MOST_FUNCTIONS:
            raise InputError(
                f"the trajectory has the events of {len(found.t_events)} functions; allowed in a "
                f"file: up to {MOST_FUNCTIONS}"
            )
        counts = np.array([len(times) for times in found.t_events], "i8")
        width = len(found.y)
        times = np.concatenate([np.zeros(0), *found.t_events])
        states = np.concatenate([np.zeros((0, width)), *found.y_events])
        arrays |= dict(zip(EVENTS, (counts, times, states), strict=True))
    if found.sensitivities is not None:
        columns = found.sensitivities
        header[SENSITIVITIES] = [[name, each.shape[2]] for name, each in columns.items()]
        none = np.zeros((len(found.time), len(found.y), 0))
        arrays[SENSITIVITIES] = np.concatenate([none, *columns.values()], axis=2)
    arrays["header"] = json.dumps(header, default=np.generic.item)
    return archive_of(arrays)


def _moments_record(moments: Any) -> Any:
    if isinstance(moments, ChangingMoments):
        return {moments.place: moments.polynomials}
    if isinstance(moments, ChangingInertia):
        return {moments.place: moments.matrices}
    if isinstance(moments, InertiaFunction):
        return {moments.place: _tape_record(moments.tape)}
    assert not isinstance(moments, Changing)
    return moments


def _scene_record(scene: Scene) -> tuple[dict[str, Any], str]:
    """Return the data that a scene file lacks, for JSON, and the file's text."""
    record: dict[str, Any] = {
        "masses": scene.masses,
        "forces": scene.forces,
        "case": scene.case,
        "moments_low": scene.moments_low if any(scene.moments_low) else None,
        "torque": None,
    }
    torque = scene.torque
    if isinstance(scene.changing, InertiaFunction) and scene.changing.values() is None:
        record["inertia"] = _moments_record(scene.changing)
        scene = replace(scene, changing=None, moments=(1.0, 1.0, 1.0))
    if is_opaque(torque):
        raise InputError(
            "[torque]: an opaque function can't be written to a file; allowed: a torque that can "
            "be recorded, or dataclasses.replace(trajectory, scene=None) to save the rows alone"
        )
    try:
        return record, scene_text(scene)
    except InputError:
        if not isinstance(torque, StateTorque) or torque.tape is None:
            raise
        record["torque"] = _tape_record(torque.tape)
        if scene.states:
            record["states"] = scene.states
        return record, scene_text(replace(scene, torque=TorqueLaw(), states=()), [_TAPED])


def _tape_record(tape: Tape) -> dict[str, Any]:
    operations = []
    for kind, operands, linear, table in tape.operations:
        own = [linear or operands]
        if table is not None:
            own = [table.breaks.tolist(), table.pieces.tolist()]
        operations.append([kind, *own])
    return {"operations": operations, "outputs": tape.outputs}


def tape_of(record: Any, n_own: int = 0, n_outputs: int = 3) -> Tape:
    """Return the tape that a dictionary from JSON describes, with `n_own` own states.

    Raise ValueError, TypeError, KeyError or OverflowError for invalid data.
    """
    operations = record["operations"]
    if len(operations) > MOST_OPERATIONS:
        raise ValueError("more operations than can be recorded")
    inputs = N_INPUTS + n_own
    known = tuple(_operation(each, inputs + n) for n, each in enumerate(operations))
    outputs = tuple(_linear(each, inputs + len(known)) for each in record["outputs"])
    if len(outputs) != n_outputs + n_own:
        raise ValueError("not an output for each component and rate of a state")
    return Tape(known, outputs, inputs)


def _operation(record: Any, slots: int) -> Operation:
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
    return Table(times, found)


def _slot(value: Any, slots: int) -> int:
    if type(value) is not int or not 0 <= value < slots:
        raise ValueError("no slot")
    return value


def _number(value: Any) -> float:
    if type(value) is not float or not math.isfinite(value):
        raise ValueError("no finite number")
    return value
