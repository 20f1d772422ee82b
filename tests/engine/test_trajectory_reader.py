"""Saved trajectories: every bit returns, and a file that is no trajectory is refused in a line."""

import io
import json
import os
import pickle
import random
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import (
    ChangingInertia,
    ChangingMoments,
    ImpossibleBodyWarning,
    InputError,
    Scene,
    TorqueLaw,
    case_scene,
    load,
    opaque,
    prepare,
    principal,
    run_program,
    solve,
    subset,
)
from pyharness.events import crosses, flip
from pyharness.model.archive import archive_of
from pyharness.model.scene_file import scene_text
from pyharness.model.state_torque import StateTorque
from pyharness.model.symbols import MOST_OPERATIONS
from pyharness.model.tape import Tape
from pyharness.model.trajectory import Trajectory
from pyharness.model.trajectory_file import file_content
from pyharness.torques import damping, gravity_gradient, recorded
from tests.conftest import Patch
from tests.engine.test_terms import INERTIA
from tests.engine.test_work import GENTLE, TIMES, TORQUES, scene_with, switched, written

CHANGING = ChangingMoments([[3.0, 0.1], [4.0], [5.0, 0.0, 0.2]])
MATRICES = ChangingInertia([INERTIA, np.diag([0.1, 0.2, 0.3]).tolist()])


def of_program(program: str, case: int) -> Trajectory:
    return run_program(case_scene(case), subset(program), implementation="python")


def with_attitude(scene: Scene, times: Any = TIMES, method: str = "auto") -> Trajectory:
    return solve(scene, times, method, 1e-10, attitude=True)


def prepared(attitude: bool) -> Trajectory:
    scene = scene_with(GENTLE)
    solver = prepare(scene, attitude=True) if attitude else prepare(scene)
    return solver.trajectory((0.1, 0.2, 0.3), TIMES)


def two_functions(t: Any, omega: Any) -> Any:
    angle = np.arctan2(omega[1], 2.0 + t * t) + np.arcsin(0.1 * np.sin(t))
    return [angle, np.exp(-t) + np.log(2.0 + np.cos(omega[2])), np.sqrt(1.0 + omega[0] ** 2)]


def impossible() -> Trajectory:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ImpossibleBodyWarning)
        return solve(case_scene(6), [1.0])


FOUND: dict[str, Callable[[], Trajectory]] = {
    **{
        name: lambda torque=torque: with_attitude(scene_with(torque))  # type: ignore[misc]
        for name, torque in TORQUES.items()
        if name != "opaque"
    },
    "full inertia": lambda: with_attitude(scene_with(GENTLE, True)),
    "full inertia, function": lambda: with_attitude(scene_with(written, True)),
    "full inertia, times reversed": lambda: with_attitude(scene_with(written, True), TIMES[::-1]),
    "times reversed": lambda: with_attitude(scene_with(GENTLE), TIMES[::-1]),
    "changing moments": lambda: with_attitude(scene_with(GENTLE, moments=CHANGING)),
    "changing inertia": lambda: with_attitude(
        Scene("b", (0.1, 0.2, 0.3), inertia=MATRICES, torque=gravity_gradient(MATRICES, 0.3))
    ),
    "another changing inertia": lambda: with_attitude(
        scene_with(gravity_gradient(CHANGING, 0.3), moments=(3.0, 4.0, 5.0))
    ),
    "sum of functions": lambda: with_attitude(
        scene_with(recorded(two_functions) + recorded(written) + damping(0.1))
    ),
    "principal scene": lambda: with_attitude(principal(scene_with(GENTLE, True))[0]),
    "case": lambda: solve(case_scene(5), [1.0]),
    "sliding": lambda: solve(scene_with(lambda t, w: -np.sign(w)), [0.1, 5.0]),
    "coefficients": lambda: solve(
        Scene("c", (0.3, -0.0, 0.8), coefficients=(0.5, -0.5, 0.0), masses=(1, 2, 3),
              forces=(4.0, 5.0, 6.0), step_size=0.1 + 0.2, steps=7), [0.3], "rk4",
    ),
    "name": lambda: solve(
        Scene('\x1b"\\ [body]\u2028 \u03a9', (0, 0, 1), moments=(1, 1, 1)), [1.0]
    ),
    "impossible body": impossible,
    "overflow": lambda: solve(
        Scene("r", (1e300,) * 3, coefficients=(1.0, 1.0, 1.0), step_size=1.0), [1.0], "rk4"
    ),
    "sensitive": lambda: solve(case_scene(3), [30.0], tolerance=1e-15),
    "stopped": lambda: of_program("runge-kutta", 2),
    "endless quotient": lambda: replace(
        found := of_program("runge-kutta", 2), stop=replace(found.stop, quotient=np.inf)  # type: ignore[type-var]
    ),
    "codes": lambda: of_program("two-term", 3),
    "solver": lambda: prepared(False),
    "solver of attitudes": lambda: prepared(True),
    "no scene": lambda: replace(solve(case_scene(5), [1.0]), scene=None),
    "events": lambda: solve(
        case_scene(3), [5.0, 9.0], events=[flip(1), crosses(2, 50.0), crosses(3, 10.0)]
    ),
    "terminal event": lambda: solve(
        case_scene(3), [5.0, 9.0], events=flip(1, terminal=2), attitude=True
    ),
    "no functions of events": lambda: solve(case_scene(3), 1.0, events=[]),
    "a million digits": lambda: solve(case_scene(5), np.linspace(0.0, 1.0, 100_000)),
}  # fmt: skip
RESULTS = ("energy", "power", "work", "angular_momentum", "y")


def result(found: Trajectory, name: str) -> Any:
    """Return the bytes of a result, or the message of its refusal."""
    try:
        value = getattr(found, name)
        return np.asarray(value() if callable(value) else value).tobytes()
    except InputError as refusal:
        return str(refusal)


def described(value: Any) -> Any:
    """Return a scene with the tape of its torque if no scene file has a form for the torque."""
    if isinstance(value, Scene) and isinstance(value.torque, StateTorque):
        try:
            scene_text(value)
        except InputError:
            return replace(value, torque=TorqueLaw()), value.torque.tape
    return value


def check_same(found: Trajectory, saved: Trajectory) -> None:
    """Compare each bit of two trajectories."""
    for each in fields(Trajectory):
        was, now = getattr(saved, each.name), getattr(found, each.name)
        told = (
            f"{each.name}: write it in model/trajectory_file.py, "
            "read it in engine/trajectory_reader.py"
        )
        assert type(now) is type(was), told
        if isinstance(was, np.ndarray):
            assert (now.dtype, now.shape) == (was.dtype, was.shape), told
            assert now.tobytes() == was.tobytes(), told
            assert now.flags.writeable
        elif each.name in ("t_events", "y_events") and was is not None:
            assert [(x.shape, x.tobytes()) for x in now] == [(x.shape, x.tobytes()) for x in was]
        else:
            now, was = described(now), described(was)
            assert now == was, told
            assert repr(now) == repr(was), told  # the sign of a zero too
    for name in RESULTS:
        assert result(found, name) == result(saved, name), name
    if saved.attitude is not None:
        in_space = (each.angular_momentum("space").tobytes() for each in (found, saved))
        assert len(set(in_space)) == 1


@pytest.mark.sampled
@pytest.mark.parametrize("name", FOUND)
@pytest.mark.filterwarnings("error")
def test_every_bit_returns(name: str, tmp_path: Path) -> None:
    saved = FOUND[name]()
    assert (saved.reason is not None) == (name == "sliding")
    path = tmp_path / "found.npz"
    saved.save(path)
    found = load(str(path))
    check_same(found, saved)
    assert (found.recorded_time is found.time) == (saved.recorded_time is saved.time)
    found.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()
    if found.scene is not None and saved.scene is not None and saved.attitude is not None:
        # The scene is solved again, and saved again, as the original one.
        first, second = (with_attitude(each.scene, [0.7]) for each in (found, saved))  # type: ignore[arg-type]
        check_same(first, second)


def test_events_return(tmp_path: Path) -> None:
    path = tmp_path / "found.npz"
    path.write_bytes(_content(**EVENT))
    found: Any = load(path)
    assert [each.tolist() for each in found.t_events] == [[0.5, 0.7]]
    assert [each.tolist() for each in found.y_events] == [[[1.0] * 7] * 2]


@pytest.mark.parametrize("times", [[-10.0, 10.0], [-10.0, -5.0, 5.0, 10.0]])
@pytest.mark.parametrize("ends", [[1.0], [1.0, -1.2]])
def test_events_of_few_rows_return(times: list[float], ends: list[float], tmp_path: Path) -> None:
    """Terminal events leave no row, one row, or rows before time 0 alone."""
    events: list[Any] = [flip(2)]
    for end in ends:
        events.append(lambda t, omega, end=end: t - end)
        events[-1].terminal = True
    found = solve(Scene("top", (0.1, 2, 0.1), moments=(1, 2, 3)), times, events=events)
    found.save(tmp_path / "found.npz")
    check_same(load(tmp_path / "found.npz"), found)


@pytest.mark.campaign
def test_attitudes_and_numbers_of_scenes_return() -> None:
    """Draw scenes whose numbers have all digits; quaternions are not rounded again."""
    draw = np.random.default_rng(7)
    found = solve(case_scene(5), [1.0])
    for _ in range(300):
        scale = 10.0 ** draw.uniform(-6, 6)
        scene = Scene(
            "s", draw.normal(size=3) * scale, moments=draw.uniform(3.0, 4.0, 3) * scale,
            attitude=draw.normal(size=4), torque=TorqueLaw(draw.normal(size=3)),
            masses=draw.uniform(1.0, 2.0, 3), forces=draw.normal(size=3),
        )  # fmt: skip
        saved = replace(found, scene=scene)
        check_same(_read(file_content(saved)), saved)


def _read(content: bytes) -> Trajectory:
    read, write = os.pipe()
    with open(write, "wb") as file:
        file.write(content)
    try:
        return load(f"/dev/fd/{read}")
    finally:
        os.close(read)


def test_file_is_readable_with_numpy(tmp_path: Path) -> None:
    saved = with_attitude(scene_with(damping(0.3)))
    saved.save(tmp_path / "found.npz")
    with np.load(tmp_path / "found.npz", allow_pickle=False) as file:
        assert (file["omega"] == saved.omega).all()
        assert 'kind = "damping"' in str(file["scene"])
        assert json.loads(str(file["header"]))["schema"] == 1


def test_rows_of_an_opaque_torque_are_saved_without_the_scene(tmp_path: Path) -> None:
    found = with_attitude(scene_with(opaque(switched)), method="dop853")
    path = tmp_path / "found.npz"
    replace(found, scene=None).save(path)
    assert load(path).omega.tobytes() == found.omega.tobytes()


def test_file_is_replaced_completely_or_not_at_all(tmp_path: Path, monkeypatch: Patch) -> None:
    path = tmp_path / "found.npz"
    found = solve(case_scene(5), [1.0])
    found.save(path)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("pyharness.model.output_files.os.replace", full)
        with pytest.raises(InputError, match="No space left on device"):
            replace(found, ended="sensitive").save(path)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == before
    replace(found, ended="sensitive").save(path)
    assert load(path).ended == "sensitive"


def arrays_of(found: Trajectory) -> dict[str, Any]:
    """Return the arrays of the file of a trajectory."""
    with np.load(io.BytesIO(file_content(found))) as file:
        return dict(file)


@cache
def _base() -> dict[str, Any]:
    return arrays_of(with_attitude(scene_with(written, True)))


def _content(**changes: Any) -> bytes:
    """Return the content of a file with replaced arrays; None removes an array."""
    arrays = _base() | changes
    return archive_of({name: each for name, each in arrays.items() if each is not None})


def _compressed() -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **_base())
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
# Two events of one function.
EVENT: dict[str, Any] = {
    "event_counts": np.array([2]), "event_times": np.array([0.5, 0.7]),
    "event_states": np.ones((2, 7)),
}  # fmt: skip
# Arrays of a file that is otherwise that of a trajectory.
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


@pytest.mark.parametrize("name", [*FOREIGN, *CHANGED])
def test_foreign_file_is_refused_in_a_line(name: str, tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "found.npz"
    path.write_bytes(FOREIGN[name]() if name in FOREIGN else _content(**CHANGED[name]))
    with pytest.raises(InputError) as caught:
        load(path)
    words = str(caught.value)
    assert words.startswith(f"trajectory file '{path}': ")
    assert "\n" not in words
    assert len(words) < 1000
    assert list(tmp_path.iterdir()) == [path]


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
}


@pytest.mark.parametrize("name", [*EDITED, "another order"])
def test_file_that_was_edited_is_refused_in_a_line(name: str, tmp_path: Path) -> None:
    """Every array of the file is valid, but not that of the trajectory which was saved."""
    path = tmp_path / "found.npz"
    arrays = arrays_of(with_attitude(scene_with(GENTLE)))
    np.savez(path, **arrays)
    load(path)
    edited = dict(sorted(arrays.items()))
    if name in EDITED:
        changes = EDITED[name](arrays)
        assert all(x is None or x.tobytes() != arrays[key].tobytes() for key, x in changes.items())
        edited = {key: x for key, x in (arrays | changes).items() if x is not None}
    np.savez(path, **edited)
    with pytest.raises(InputError, match=str(path)):
        load(path)


def test_file_of_another_version_is_not_called_damaged(tmp_path: Path) -> None:
    """A later version may write other arrays."""
    path = tmp_path / "found.npz"
    header = json.dumps({"kind": "pyharness trajectory", "schema": 99})
    path.write_bytes(_content(header=header, another=np.zeros(3)))
    with pytest.raises(InputError, match="99"):
        load(path)


def test_file_of_another_kind_or_size_is_refused_at_once(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    path = tmp_path / "found.npz"
    for name in (path, tmp_path, "/dev/zero"):
        with pytest.raises(InputError, match="trajectory file"):
            load(name)
    with path.open("wb") as file:
        file.truncate(1 << 42)  # without any data on the disk
    # Not even a part of the file is read.
    monkeypatch.setattr("pyharness.model.pipes.os.read", lambda *_: pytest.fail("was read"))
    with pytest.raises(InputError, match=str(path)):
        load(path)


def test_damaged_file_is_refused_or_has_the_same_bits(tmp_path: Path) -> None:
    """Change bytes, and cut the file, at places drawn by lot."""
    saved = with_attitude(scene_with(written, True))
    content = file_content(saved)
    path = tmp_path / "found.npz"
    draw = random.Random(3)
    refused = []
    for number in range(600):
        damaged = bytearray(content)
        place = draw.randrange(len(content))
        if number % 3:
            damaged[place] ^= 1 << draw.randrange(8)
        else:
            del damaged[place:]
        path.write_bytes(damaged)
        try:
            found = load(path)
        except InputError as refusal:
            refused.append(str(refusal))
        else:  # dates and other facts of the archive that are not used
            check_same(found, saved)
    assert len(refused) > 500
    assert "\n" not in "".join(refused)


HOSTILE: tuple[Any, ...] = (
    None, True, -1, 0, 3, 1.5, 1e400, float("nan"), "", "complete", [], [1.0], {}, {"a": 1},
    [[1.0]], [1.0, 2.0, 3.0], ["1", "2", "3"], 10**400,
)  # fmt: skip


def _places(record: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path to each value of nested dictionaries and lists."""
    pairs = record.items() if isinstance(record, dict) else enumerate(record)
    found = []
    for key, value in pairs:
        found.append((*path, key))
        if isinstance(value, (dict, list)):
            found += _places(value, (*path, key))
    return found


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ended", "later"), ("ended", 0), ("reason", 1), ("steps", -1), ("steps", True),
        ("evaluations", 2.0),
        ("error", 1), ("growth", "1.0"), ("tolerance", []), ("moments", [1.0, 2.0]),
        ("moments", {"masses": [1.0]}), ("stop", {"step": 1}), ("scene", []),
        ("stop", {"step": 1, "variable": "W", "quotient": 1.0}),
        ("stop", {"step": 1, "variable": "U", "quotient": None}),
        ("stop", {"step": -1, "variable": "U", "quotient": 1.0}),
        ("sensitivities", [["omega", 3]]), ("sensitivities", [["omega", -1]]),
        ("sensitivities", 1),
    ],
)  # fmt: skip
def test_wrong_value_of_the_header_is_refused(name: str, value: Any, tmp_path: Path) -> None:
    arrays = arrays_of(solve(case_scene(5), [1.0]))
    header = json.dumps(json.loads(str(arrays["header"])) | {name: value})
    (tmp_path / "found.npz").write_bytes(archive_of({**arrays, "header": header}))
    with pytest.raises(InputError, match=r"^trajectory file"):
        load(tmp_path / "found.npz")


@pytest.mark.parametrize("key", ["kind", "schema", "steps", "quotient"])
def test_a_key_twice_in_the_header_is_named(key: str, tmp_path: Path) -> None:
    arrays = arrays_of(of_program("runge-kutta", 2))
    twice = str(arrays["header"]).replace(f'"{key}"', f'"{key}": 1, "{key}"')
    assert json.loads(twice) == json.loads(str(arrays["header"]))
    (tmp_path / "found.npz").write_bytes(archive_of({**arrays, "header": twice}))
    with pytest.raises(InputError, match=f'header: the key "{key}" occurs twice'):
        load(tmp_path / "found.npz")


def test_a_parameter_twice_is_refused(tmp_path: Path) -> None:
    """The columns of the first would be lost."""
    saved = solve(case_scene(5), [1.0], sensitivities=["omega", "moments"])
    arrays = arrays_of(saved)
    twice = str(arrays["header"]).replace('["moments", 3]', '["omega", 3]')
    assert twice.count('["omega", 3]') == 2
    (tmp_path / "found.npz").write_bytes(archive_of({**arrays, "header": twice}))
    with pytest.raises(InputError, match="a value is missing or damaged"):
        load(tmp_path / "found.npz")


@pytest.mark.campaign
def test_each_value_of_the_header_is_checked(tmp_path: Path) -> None:
    saved = replace(
        with_attitude(scene_with(written, moments=CHANGING)), stop=of_program("runge-kutta", 2).stop
    )
    arrays = arrays_of(saved)
    header = json.loads(str(arrays["header"]))
    path = tmp_path / "found.npz"
    draw = random.Random(5)
    places = _places(header)
    outer = [place for place in places if "torque" not in place or len(place) < 5]
    refused = []
    for place in [*outer, *draw.sample(places, 60)]:
        for hostile in draw.sample(HOSTILE, 8):
            changed = json.loads(str(arrays["header"]))
            inner = changed
            for key in place[:-1]:
                inner = inner[key]
            inner[place[-1]] = hostile
            path.write_bytes(archive_of({**arrays, "header": json.dumps(changed)}))
            try:
                found = load(path)
            except InputError as refusal:
                refused.append(str(refusal))
                continue
            for each in RESULTS:
                result(found, each)
            repr(found), found._repr_html_(), found.message, repr(found.scene)
    assert len(refused) > 400
    assert "\n" not in "".join(refused)


def test_torque_of_a_file_reads_only_what_is_there(tmp_path: Path) -> None:
    """An operation that reads a later slot, or too many operations, would crash a kernel."""
    arrays = arrays_of(with_attitude(scene_with(written)))
    header = json.loads(str(arrays["header"]))
    given = header["scene"]["torque"]["operations"]
    bad: list[Any] = [
        ["product", [8, 0]], ["product", [-1, 0]], ["product", [0]], ["sqrt", [0, 1]],
        ["sqrt", [True]], ["sine", [1.0]], ["other", [0]], ["linear", [0.0, [[8, 1.0]]]],
        ["linear", [0.0, [[1, 1.0], [1, 1.0]]]], ["linear", [float("inf"), []]],
        ["table", [], []], ["table", [1.0, 1.0], [[0.0] * 4] * 2], ["table", [1.0], [[0.0] * 3]],
        ["table", [1.0], []], ["product"], [], "product", None,
    ]  # fmt: skip
    first = {**header["scene"]["torque"], "operations": None}
    path = tmp_path / "found.npz"

    def written_with(operations: Any, outputs: Any) -> None:
        torque = {**first, "operations": operations, "outputs": outputs}
        changed = {**header, "scene": {**header["scene"], "torque": torque}}
        path.write_bytes(archive_of({**arrays, "header": json.dumps(changed)}))

    zero = [[0.0, []]] * 3
    written_with([["sqrt", [0]]], zero)
    scene: Any = load(path).scene
    assert isinstance(scene.torque.tape, Tape)
    for operation in bad:
        written_with([operation], zero)
        with pytest.raises(InputError):
            load(path)
    for outputs in (zero[:2], [[0.0, [[8, 1.0]]], *zero[:2]], None):
        written_with([], outputs)
        with pytest.raises(InputError):
            load(path)
    written_with([["sqrt", [0]]] * MOST_OPERATIONS, zero)
    load(path)
    written_with([["sqrt", [0]]] * (MOST_OPERATIONS + 1), zero)
    with pytest.raises(InputError):
        load(path)
    assert len(given) > 5
