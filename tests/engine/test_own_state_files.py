"""States of the user's own in events, steppers, results and scene files."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import ChangingMoments, Scene, Stepper, TorqueLaw, events, load, read_scene, solve
from pyharness.model.archive import archive_of
from pyharness.model.errors import InputError
from pyharness.model.scene_file import scene_text
from pyharness.model.trajectory import turned_to_space
from pyharness.torques import damping, recorded, wheels
from tests.engine.test_own_states import MOMENTS, integral, wheel
from tests.refused import refused

WHEEL = Scene("wheel", (0.3, -0.2, 1.0), MOMENTS, torque=wheel, states={"wheel": 1.5})
INTEGRAL = Scene("integral", (0.0, 0.0, 1.0), MOMENTS, torque=integral, states={"turned": 0.0})


def test_events_and_their_states() -> None:
    def low(t: Any, omega: Any, states: Any) -> Any:
        return states["turned"] - 0.3

    low.terminal = 2  # type: ignore[attr-defined]
    found: Any = solve(INTEGRAL, [1.0, 20.0], events=[low, events.crosses(3, 0.0)], tolerance=1e-11)
    assert found.ended == "event"
    decay, frequency = 0.1, 0.7
    for time, state in zip(found.t_events[0], found.y_events[0], strict=True):
        turned = math.exp(-decay * time) * math.sin(frequency * time) / frequency
        assert abs(turned - 0.3) < 1e-10
        assert abs(state[3] - 0.3) < 1e-10
    assert len(found.t_events[0]) == 2
    # The largest angle is where omega3 is 0.
    assert math.tan(frequency * found.t_events[1][0]) == pytest.approx(frequency / decay, rel=1e-9)


def test_stepper_agrees_and_states_may_be_set() -> None:
    stepper = Stepper(WHEEL, 1e-12, attitude=True)
    stepper.until(5.0)
    found = solve(WHEEL, 5.0, attitude=True)
    assert stepper.states["wheel"] == pytest.approx(found.states["wheel"][0], rel=1e-12)
    assert stepper.at(5.0) == pytest.approx(found.y[:, 0], rel=1e-11)
    stepper.states = {"wheel": 0.0}
    stepper.until(6.0)
    later = Scene(
        "later", found.omega[0], MOMENTS, attitude=found.attitude[0],
        torque=wheel, states={"wheel": 0.0},
    )  # fmt: skip
    assert stepper.omega == pytest.approx(solve(later, 1.0, attitude=True).omega[0], rel=1e-11)
    with pytest.raises(InputError, match="an argument states; give the scene's states="):
        Scene("none", (0.0, 0.0, 1.0), MOMENTS, torque=lambda t, omega, states: states["wheel"])
    with pytest.raises(InputError, match="allowed: a dict of wheel"):
        stepper.states = {"wheels": 0.0}
    with pytest.raises(InputError, match="allowed: those of the first scene"):
        stepper.scene = Scene("none", (0.0, 0.0, 1.0), MOMENTS)


def test_stepper_takes_an_inertia_that_changes() -> None:
    moments = ChangingMoments([(2.0, 0.1), (3.0, 0.0, 0.01), (4.0,)])
    scene = Scene("fuel", (0.3, -0.2, 1.0), moments, torque=integral, states={"turned": 0.0})
    stepper = Stepper(scene, 1e-13)
    stepper.until(7.0)
    found = solve(scene, 7.0)
    assert stepper.omega == pytest.approx(found.omega[0], rel=1e-12)
    assert stepper.states["turned"] == pytest.approx(found.states["turned"][0], rel=1e-12)
    stepper.held_torque = (0.0, 0.0, 0.4)
    stepper.until(7.5)

    def pushed(t: Any, omega: Any, states: Any) -> Any:
        torque, rates = integral(t, omega, states)
        return [*torque[:2], torque[2] + np.where(t > 7.0, 0.4, 0.0)], rates

    other = Scene("pushed", (0.3, -0.2, 1.0), moments, torque=pushed, states={"turned": 0.0})
    assert stepper.omega == pytest.approx(solve(other, 7.5).omega[0], rel=1e-11)


def test_results_have_the_states_by_name(tmp_path: Any) -> None:
    found: Any = solve(
        WHEEL, [4.0, 2.0], attitude=True, events=lambda t, omega, states: states["wheel"] - 1.7,
        sensitivities=["omega"],
    )  # fmt: skip
    assert found.to_pandas()["wheel"].tolist() == found.states["wheel"].tolist()
    assert found.to_xarray()["wheel"].sel(time=2.0) == found.states["wheel"][1]
    assert found.y.shape == (8, 2)
    found.save(tmp_path / "wheel.npz")
    read: Any = load(tmp_path / "wheel.npz")
    assert read.states["wheel"].tolist() == found.states["wheel"].tolist()
    assert read.scene == WHEEL
    assert (read.sensitivities["omega"] == found.sensitivities["omega"]).all()
    assert read.y_events[0].tolist() == found.y_events[0].tolist()
    again = solve(read.scene, [4.0, 2.0], attitude=True)
    assert again.own.tolist() == found.own.tolist()
    assert found.power().shape == (2,)


FILE = """\
[body]
moments = [2.0, 3.0, 4.0]
[initial]
omega = [0.3, -0.2, 1.0]
[torque]
expression = ["-w2*wheel", "w1*wheel", "-k*w3 + 0.1*sin(t)"]
constants = { k = 0.4 }
[[torque.terms]]
kind = "damping"
matrix = [[0.05, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, 0.05]]
[states.wheel]
start = 1.5
scale = 2.0
rate = "k*w3 - 0.1*sin(t)"
"""


def test_a_scene_file_has_states(tmp_path: Any) -> None:
    (tmp_path / "wheel.toml").write_text(FILE)
    scene = read_scene(tmp_path / "wheel.toml")

    def law(t: Any, omega: Any, states: Any) -> Any:
        motor = 0.4 * omega[2] - 0.1 * np.sin(t)
        h = states["wheel"]
        return [-omega[1] * h, omega[0] * h, -motor], {"wheel": motor}

    torque = damping(0.05) + recorded(law, ["wheel"])
    other = Scene("wheel", (0.3, -0.2, 1.0), MOMENTS, torque=torque, states={"wheel": (1.5, 2.0)})
    found, expected = (solve(each, [1.0, 6.0]) for each in (scene, other))
    assert found.y == pytest.approx(expected.y, rel=1e-12)
    (tmp_path / "again.toml").write_text(scene_text(scene))
    assert read_scene(tmp_path / "again.toml") == scene
    found.save(tmp_path / "wheel.npz")
    assert load(tmp_path / "wheel.npz").scene == scene


@pytest.mark.parametrize(("old", "new", "words"), [
    ("rate =", "rates =", r"\[states.wheel\]: unknown key"),
    ('rate = "k*w3 - 0.1*sin(t)"', "", r"\[states.wheel\]: rate is missing"),
    ("[states.wheel]", "[states.w1]", "another meaning"),
    ("[states.wheel]", "[states.k]", "another meaning"),
    ("expression = [", "constant = [1.0]  # [", "expression is missing, which a scene with"),
    ('rate = "k', 'rate = "u', "'u'"),
    ("scale = 2.0", "scale = -2.0", "from 0 on"),
])  # fmt: skip
def test_a_mistake_in_a_scene_file_is_told(tmp_path: Any, old: str, new: str, words: str) -> None:
    assert old in FILE
    (tmp_path / "wrong.toml").write_text(FILE.replace(old, new))
    with pytest.raises(InputError, match=words) as raised:
        read_scene(tmp_path / "wrong.toml")
    assert "\n" not in str(raised.value)


def test_ready_events_see_omega_and_attitude_alone() -> None:
    ready = [events.tilt(1, (1, 0, 0), 1.0), events.extremum(2)]
    found: Any = solve(WHEEL, 6.0, attitude=True, events=ready, dense_output=True)
    assert len(found.t_events[0]) > 0
    assert len(found.t_events[1]) > 0
    for state in found.y_events[0]:
        axis = turned_to_space(state[None, 3:7], np.array([[1.0, 0.0, 0.0]]))[0]
        assert math.acos(axis[0]) == pytest.approx(1.0, abs=1e-10)
    for time in found.t_events[1]:
        assert abs(found.sol.derivative(time)[1]) < 1e-11


def test_rows_at_time_0_have_the_start() -> None:
    assert solve(WHEEL, 0.0, attitude=True).states["wheel"].tolist() == [1.5]
    assert solve(WHEEL, [-1.0, 0.0, 1.0], attitude=True).states["wheel"][1] == 1.5


def test_another_torque_brings_its_own_states() -> None:
    first, second = (wheels((0.0, 0.0, h), motor=lambda t, omega, h: -omega) for h in (1.0, 2.0))
    scene = Scene("wheel", (0.0, 0.1, 1.0), MOMENTS, torque=first)
    assert replace(scene, omega=(0.0, 0.0, 1.0)).states == scene.states
    assert replace(scene, torque=second).states == replace(scene, torque=second, states=()).states
    assert replace(scene, torque=second).states != scene.states
    given = tuple(each._replace(start=3.0) for each in scene.states)
    assert {each.start for each in replace(scene, torque=second, states=given).states} == {3.0}
    assert replace(scene, torque=TorqueLaw()).states == ()


def test_a_file_without_its_states_is_refused(tmp_path: Any) -> None:
    solve(INTEGRAL, [1.0, 2.0]).save(tmp_path / "whole.npz")
    with np.load(tmp_path / "whole.npz") as archive:
        arrays = {name: archive[name] for name in archive if name not in ("own", "sha256")}
    (tmp_path / "part.npz").write_bytes(archive_of(arrays))
    refused("missing or damaged", load, tmp_path / "part.npz")


def test_wheels_under_a_law_keep_the_total_momentum() -> None:
    def motor(t: Any, omega: Any, attitude: Any, h: Any) -> Any:
        return 0.5 * omega + 0.3 * attitude[1:] - 0.01 * h

    moments = (4.0, 3.0, 2.0)
    scene = Scene(
        omega=(0.1, 0.2, -0.1), moments=moments, attitude=(1, 0.2, 0.1, 0),
        torque=wheels((0.0, 0.0, 0.5), motor),
    )  # fmt: skip
    assert [(each.name, each.start) for each in scene.states] == [
        ("wheel1", 0.0), ("wheel2", 0.0), ("wheel3", 0.5),
    ]  # fmt: skip
    found: Any = solve(scene, [0.0, 5.0, 60.0], tolerance=1e-12)
    h = np.stack([found.states[f"wheel{axis}"] for axis in (1, 2, 3)], axis=1)
    assert np.ptp(found.rotation().apply(found.omega * moments + h), axis=0).max() < 3e-13
    assert np.abs(found.omega[-1]).max() < 0.01
    # A constant law is that of a constant torque of the motors.
    constant = [
        solve(Scene(omega=(0.1, 0.2, -0.1), moments=moments, torque=each), 9.0).omega[0]
        for each in (
            wheels((0, 0, 0.5), lambda t, omega, h: (0.0, 0.0, 0.1)) + damping(0.1),
            wheels((0, 0, 0.5), (0.0, 0.0, 0.1)) + damping(0.1),
        )
    ]
    assert constant[0] == pytest.approx(constant[1], abs=1e-12)
    own = Scene(
        omega=(0.1, 0.2, -0.1), moments=moments, attitude=(1, 0, 0, 0),
        torque=wheels((0, 0, 0.5), motor),
        states={"wheel1": 0.2, "wheel2": 0.0, "wheel3": (0.0, 1.0)},
    )  # fmt: skip
    assert own.states[0].start == 0.2
    refused("wheels motor: the function has 2 arguments", wheels, (0, 0, 1), lambda t, omega: omega)
