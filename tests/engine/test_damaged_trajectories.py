"""Files that are no trajectory, or not what was saved, are refused in a line."""

import io
import json
import os
import pickle
import random
import zipfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import Trajectory, case_scene, load, solve
from pyharness.model.archive import archive_of
from pyharness.model.symbols import MOST_OPERATIONS
from pyharness.model.tape import Tape
from tests.conftest import Patch
from tests.engine.test_trajectory_reader import arrays_of, of_program, with_attitude
from tests.engine.test_work import GENTLE, scene_with, written
from tests.refused import refused


def test_events_return(tmp_path: Path) -> None:
    path = tmp_path / "found.npz"
    path.write_bytes(_content(**EVENT))
    found: Any = load(path)
    assert [each.tolist() for each in found.t_events] == [[0.5, 0.7]]
    assert [each.tolist() for each in found.y_events] == [[[1.0] * 7] * 2]


BASES: dict[str, Callable[[], Trajectory]] = {
    "function": lambda: with_attitude(scene_with(written, True)),
    "terms": lambda: with_attitude(scene_with(GENTLE)),
    "case": lambda: solve(case_scene(5), [1.0]),
    "program": lambda: of_program("runge-kutta", 2),
    "sensitivities": lambda: solve(case_scene(5), [1.0], sensitivities=["omega", "moments"]),
    "operations": lambda: with_attitude(scene_with(written)),
}


ZERO: Any = [[0.0, []]] * 3  # the torque of a tape without operations


@cache
def _base(name: str) -> dict[str, Any]:
    return arrays_of(BASES[name]())


def _content(base: str = "function", **changes: Any) -> bytes:
    """Return the content of a file with replaced arrays; None removes an array."""
    arrays = _base(base) | changes
    return archive_of({name: each for name, each in arrays.items() if each is not None})


def _header(base: str, **changes: Any) -> bytes:
    """Return the content of a file with replaced values of the header."""
    return _content(base, header=json.dumps(json.loads(str(_base(base)["header"])) | changes))


def _torque(operations: Any, outputs: Any = ZERO) -> bytes:
    """Return the content of a file with another recorded torque."""
    scene = json.loads(str(_base("operations")["header"]))["scene"]
    torque = {**scene["torque"], "operations": operations, "outputs": outputs}
    return _header("operations", scene={**scene, "torque": torque})


def _repeated(key: str) -> bytes:
    """Return the content of a file whose header has a key twice, of which readers keep the last."""
    header = str(_base("program")["header"])
    twice = header.replace(f'"{key}"', f'"{key}": 1, "{key}"')
    assert json.loads(twice) == json.loads(header)
    return _content("program", header=twice)


def _edited(name: str) -> bytes:
    """Return the content of a file whose arrays are valid, but not those that were saved."""
    arrays = _base("terms")
    changes = EDITED[name](arrays)
    assert all(x is None or x.tobytes() != arrays[key].tobytes() for key, x in changes.items())
    edited = {key: x for key, x in (arrays | changes).items() if x is not None}
    buffer = io.BytesIO()
    np.savez(buffer, **(edited if changes else dict(sorted(edited.items()))))
    return buffer.getvalue()


def _compressed() -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **_base("function"))
    return buffer.getvalue()


class _Touch:
    """An object whose pickle calls a function as it is read."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("touched",)


def _huge() -> bytes:
    """Return an array's header that claims a shape of 8e15 bytes."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": "<f8", "fortran_order": False, "shape": (10**15,)}
    )
    return buffer.getvalue()


def _raw(name: str, data: bytes, method: int = zipfile.ZIP_STORED) -> bytes:
    """Return a trajectory's file with one entry replaced by other bytes."""
    source = zipfile.ZipFile(io.BytesIO(_content()))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as target:
        for each in source.namelist():
            target.writestr(each, data if each == name else source.read(each))
    return buffer.getvalue()


def _twice() -> bytes:
    buffer = io.BytesIO(_raw("none", b""))
    with zipfile.ZipFile(buffer, "a") as target, pytest.warns(UserWarning, match="Duplicate"):
        target.writestr("time.npy", b"")
    return buffer.getvalue()


FOREIGN: dict[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "text": lambda: b"schema = 1\n",
    "noise": lambda: random.Random(1).randbytes(5000),
    "array alone": lambda: _npy(np.zeros(3)),
    "another archive": lambda: _zip({"x.npy": _npy(np.zeros(3))}),
    "pickle": lambda: _zip({"header.npy": pickle.dumps(_Touch())}),
    "array of objects": lambda: _raw("time.npy", _npy(np.array([_Touch()], dtype=object))),
    "compressed": _compressed,
    "bomb": lambda: _raw("time.npy", b"\0" * 10_000_000, zipfile.ZIP_DEFLATED),
    "huge shape": lambda: _raw("time.npy", _huge()),
    "entry twice": _twice,
}


EVENT: dict[str, Any] = {
    "event_counts": np.array([2]), "event_times": np.array([0.5, 0.7]),
    "event_states": np.ones((2, 7)),
}  # fmt: skip


CHANGED: dict[str, dict[str, Any]] = {
    "another entry": {"other": np.zeros(3)},
    **{f"no {name}": {name: None} for name in ("header", "time", "omega", "scene")},
    "header of numbers": {"header": np.zeros(3)},
    "no JSON": {"header": "schema = 1"},
    "nested JSON": {"header": "[" * 100_000},
    "long number": {"header": '{"schema": 1' + "0" * 100_000 + "}"},
    "JSON of another": {"header": '{"kind": "others", "schema": 1}'},
    "list": {"header": "[1]"},
    "single numbers": {"omega": np.zeros((5, 3), np.float32)},
    "complex numbers": {"omega": np.zeros((5, 3), complex)},
    "fewer rows": {"omega": np.zeros((4, 3))},
    "two columns": {"omega": np.zeros((5, 2))},
    "two dimensions": {"time": np.zeros((5, 1))},
    "no dimension": {"time": np.float64(0.0)},
    "axes of another shape": {"axes": np.zeros((3, 2))},
    "half of the events": {"event_counts": np.array([0])},
    "fewer events": EVENT | {"event_counts": np.array([1, 0])},
    "a negative number of events": EVENT | {"event_counts": np.array([3, -1])},
    "events without attitudes": EVENT | {"event_states": np.zeros((2, 3))},
    "an event without a state": EVENT | {"event_states": np.zeros((1, 7))},
    "events at no time": EVENT | {"event_times": np.array([0.5, np.nan])},
    "events in no order": {
        "event_counts": np.array([3]), "event_times": np.array([0.5, 0.7, 0.6]),
        "event_states": np.ones((3, 7)),
    },
    "events backwards": EVENT | {"event_times": np.array([0.7, 0.5])},
    "functions without number": {
        "event_counts": np.zeros(20_000, "i8"), "event_times": np.zeros(0),
        "event_states": np.zeros((0, 7)),
    },
    "an infinity of events": EVENT | {"event_counts": np.array([1e300])},
    "sensitivities without names": {"sensitivities": np.zeros((5, 7, 3))},
    "scene of numbers": {"scene": np.zeros(3)},
    "scene that is no TOML": {"scene": "omega ="},
    "scene without a body": {"scene": '[initial]\nomega = [1.0, 2.0, 3.0]'},
    "scene of a later version": {"scene": "schema = 2"},
    "scene that is nested": {"scene": "a = " + "[" * 100_000},
}  # fmt: skip


def _npy(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def _zip(entries: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return buffer.getvalue()


EDITED: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "a NaN": lambda given: {"omega": np.vstack([given["omega"][:-1], [[1.0, 2.0, np.nan]]])},
    "a bit": lambda given: {"omega": np.nextafter(given["omega"], 9.0)},
    "unordered times": lambda given: {"time": np.roll(given["time"], 1)},
    "fewer rows": lambda given: {x: given[x][:-1] for x in ("time", "omega", "attitude")},
    "another ending": lambda given: {
        "header": np.array(str(given["header"]).replace("complete", "sensitive"))
    },
    "another error": lambda given: {
        "header": np.array(json.dumps({**json.loads(str(given["header"])), "error": 0.0}))
    },
    "another scene": lambda given: {
        "scene": np.array(str(given["scene"]).replace("omega = [", "omega = [1"))
    },
    "no attitude": lambda given: {"attitude": None},
    "no digest": lambda given: {"sha256": None},
    "another digest": lambda given: {"sha256": np.array("0" * 64)},
    "digest of numbers": lambda given: {"sha256": np.zeros(64)},
    "another order": lambda given: {},
}


WRONG: list[tuple[str, Any]] = [
    ("ended", "later"), ("ended", 0), ("reason", 1), ("steps", -1), ("steps", True),
    ("evaluations", 2.0), ("error", 1), ("growth", "1.0"), ("tolerance", []),
    ("moments", [1.0, 2.0]), ("moments", {"masses": [1.0]}), ("stop", {"step": 1}), ("scene", []),
    ("stop", {"step": 1, "variable": "W", "quotient": 1.0}),
    ("stop", {"step": 1, "variable": "U", "quotient": None}),
    ("stop", {"step": -1, "variable": "U", "quotient": 1.0}),
    ("sensitivities", [["omega", 3]]), ("sensitivities", [["omega", -1]]), ("sensitivities", 1),
]  # fmt: skip


OPERATIONS: list[Any] = [
    ["product", [8, 0]], ["product", [-1, 0]], ["product", [0]], ["sqrt", [0, 1]],
    ["sqrt", [True]], ["sine", [1.0]], ["other", [0]], ["linear", [0.0, [[8, 1.0]]]],
    ["linear", [0.0, [[1, 1.0], [1, 1.0]]]], ["linear", [float("inf"), []]],
    ["table", [], []], ["table", [1.0, 1.0], [[0.0] * 4] * 2], ["table", [1.0], [[0.0] * 3]],
    ["table", [1.0], []], ["product"], [], "product", None,
]  # fmt: skip


DAMAGED: dict[str, tuple[Callable[[], bytes], str]] = {
    **{name: (make, "") for name, make in FOREIGN.items()},
    **{name: (partial(_content, **changes), "") for name, changes in CHANGED.items()},
    **{f"edited: {name}": (partial(_edited, name), "") for name in EDITED},
    **{f"{x} is {value}": (partial(_header, "case", **{x: value}), "") for x, value in WRONG},
    **{
        f"{key} twice": (partial(_repeated, key), f'header: the key "{key}" occurs twice')
        for key in ("kind", "schema", "steps", "quotient")
    },
    # The columns of the first would be lost.
    "parameter twice": (
        partial(_header, "sensitivities", sensitivities=[["omega", 3], ["omega", 3]]),
        "a value is missing or damaged",
    ),
    # A later version may write other arrays.
    "another version": (
        partial(_content, header='{"kind": "pyharness trajectory", "schema": 99}', another=[0.0]),
        "99",
    ),
    **{f"operation {each}": (partial(_torque, [each]), "") for each in OPERATIONS},
    **{
        f"torques {each}": (partial(_torque, [], each), "")
        for each in (ZERO[:2], [[0.0, [[8, 1.0]]], *ZERO[:2]], None)
    },
    "too many operations": (partial(_torque, [["sqrt", [0]]] * (MOST_OPERATIONS + 1)), ""),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_is_refused_in_a_line(name: str, tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)
    make, words = DAMAGED[name]
    path = tmp_path / "found.npz"
    path.write_bytes(make())
    message = refused(words, load, path)
    assert message.startswith(f"trajectory file '{path}': ")
    assert len(message) < 1000
    assert list(tmp_path.iterdir()) == [path]


def test_files_that_are_not_damaged_are_read(tmp_path: Path) -> None:
    path = tmp_path / "found.npz"
    for base in BASES:
        path.write_bytes(_content(base))
        load(path)
    for count in (1, MOST_OPERATIONS):
        path.write_bytes(_torque([["sqrt", [0]]] * count))
        scene: Any = load(path).scene
        assert isinstance(scene.torque.tape, Tape)


def test_file_of_another_kind_or_size_is_refused_at_once(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    path = tmp_path / "found.npz"
    for name in (path, tmp_path, "/dev/zero"):
        refused("trajectory file", load, name)
    with path.open("wb") as file:
        file.truncate(1 << 42)  # without any data on the disk
    # Not even a part of the file is read.
    monkeypatch.setattr("pyharness.model.pipes.os.read", lambda *_: pytest.fail("was read"))
    refused(str(path), load, path)
