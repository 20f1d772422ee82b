"""Saved trajectories: every bit returns, and a file that is no trajectory is refused in a line."""

import io
import json
import os
import random
import warnings
from collections.abc import Callable
from dataclasses import fields, replace
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
        found := of_program("runge-kutta", 2), stop=replace(found.stop, quotient=np.inf)
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
            "read it in engine/torques/trajectory_reader.py"
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
        first, second = (with_attitude(each.scene, [0.7]) for each in (found, saved))
        check_same(first, second)


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


# Two events of one function.
# Arrays of a file that is otherwise that of a trajectory.
# An operation that reads a later slot, or too many operations, would crash a kernel.
# A file, and words of its refusal.
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
