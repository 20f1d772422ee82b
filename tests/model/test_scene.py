"""Scenes, and the scene files that are read."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import (
    ChangingMoments,
    InputError,
    Scene,
    TorqueLaw,
    case_scene,
    principal,
    read_scene,
    torques,
)
from pyharness.engine.problem.rescaled import scaled
from pyharness.engine.problem.rotated import restarted_at, rotated
from pyharness.model.attitude import matrices
from pyharness.model.records import scene_record
from pyharness.model.scene import CHANGING, STATE_TORQUE, most_steps
from pyharness.model.scene_file import scene_text
from pyharness.model.scene_report import heading

GOOD = """
name = "spinning brick"
[body]
moments = [40.0, 30.0, 20.0]
[initial]
omega = [0, 1.0, 1.0]
[torque]
constant = [1.0, 2.0, 3.0]
rate = [0.0, 0.0, 1.0]
sines = [{ amplitude = [1.0, 0.0, 0.0], frequency = 100 }]
cosines = [{ amplitude = [0.0, 1.0, 0.0], frequency = 100.0 }]
[run]
step_size = 0.02
steps = 7
"""


def _read(folder: Path, text: str) -> Scene:
    path = folder / "scene.toml"
    path.write_text(text)
    return read_scene(path)


def test_every_key_of_a_scene_file_is_read(tmp_path: Path) -> None:
    scene = _read(tmp_path, GOOD)
    law = TorqueLaw((1, 2, 3), (0, 0, 1), [((1, 0, 0), 100)], [((0, 1, 0), 100)])
    assert scene == Scene(
        "spinning brick", (0.0, 1.0, 1.0), (40.0, 30.0, 20.0), torque=law, step_size=0.02, steps=7
    )
    assert scene.masses == (100.0, 110.0, 120.0)
    assert scene.forces == (10.0, 20.0, 40.0)


def test_only_body_and_initial_are_required(tmp_path: Path) -> None:
    scene = _read(tmp_path, "[body]\ncoefficients=[1,2,3]\n[initial]\nomega=[1,2,3]\n")
    assert scene.name == "scene"
    assert (scene.step_size, scene.steps) == (0.01, 100)
    assert scene.torque.is_zero
    assert scene.euler_coefficients == (1.0, 2.0, 3.0)


def test_torque_about_the_axes_of_space_is_read_written_and_told(tmp_path: Path) -> None:
    scene = _read(tmp_path, GOOD.replace("[torque]", '[torque]\nframe = "space"'))
    assert scene.torque == TorqueLaw(
        (1, 2, 3), (0, 0, 1), [((1, 0, 0), 100)], [((0, 1, 0), 100)], "space"
    )
    assert scene.torque.in_space
    assert _read(tmp_path, scene_text(scene)) == scene
    assert scene_record(scene)["torque"]["frame"] == "space"
    assert "N m about the axes of space; omega(0)" in heading(scene)[1]
    body = _read(tmp_path, GOOD.replace("[torque]", '[torque]\nframe = "body"'))
    assert body == _read(tmp_path, GOOD)
    assert body.body_torque is body.torque
    assert "frame" not in scene_text(body)
    assert "frame" not in scene_record(body)["torque"]
    assert "space" not in heading(body)[1]
    assert "no torque; omega(0)" in heading(replace(scene, torque=TorqueLaw(frame="space")))[1]


@pytest.mark.campaign
def test_torque_about_the_axes_of_space_stays_as_the_axes_of_the_body_turn() -> None:
    law = TorqueLaw((1, 2, 3), (0, 0, 1), [((1, 0, 0), 3)], [((0, 1, 0), 4)], "space")
    scene = Scene("", (1, 2, 3), (4, 5, 6), torque=law, attitude=(0, 1, 0, 0))
    other = rotated(scene, lambda v: (v[1], v[2], v[0]), body=True)
    assert other == replace(scene, omega=(2, 3, 1), moments=(5, 6, 4))
    full = Scene("", (1, 2, 3), inertia=((4, 1, 0), (1, 5, 0), (0, 0, 6)), torque=law)
    about_principal, axes = principal(full)
    assert about_principal.torque == law
    # By default the body starts along the axes of space, and its principal axes do not.
    assert about_principal.attitude is not None
    assert matrices(np.array([about_principal.attitude]))[0] == pytest.approx(axes)
    faster = scaled(scene, 4.0).law
    assert (faster.frame, faster.constant) == ("space", (16, 32, 48))
    later = restarted_at(scene, np.ones(3), 0.5, (0.0, 0.0, 1.0, 0.0))
    assert later.law.at(0.25) == pytest.approx(law.at(0.75))
    assert (later.law.frame, later.attitude) == ("space", (0.0, 0.0, 1.0, 0.0))


def test_cases_are_those_of_table_1() -> None:
    assert case_scene(3).euler_coefficients == ((39 - 20) / 41, (20 - 41) / 39, (41 - 39) / 20)
    assert [case_scene(n).is_impossible for n in range(1, 8)] == [False] * 5 + [True, False]
    assert case_scene(7).law.at(0.0) == (0.0, 1.0, 0.0)
    assert case_scene(7).law.at(0.25) == (math.sin(25.0), math.cos(25.0), 0.25)


def test_right_hand_side_is_the_normalized_form() -> None:
    """Compare equations 16-18 with equations 5-7 by an inertia tensor and a cross product."""
    scene = case_scene(7)
    inertia = np.array(scene.moments)
    for t, omega in ((0.0, (1.0, 2.0, 3.0)), (0.7, (-0.3, 5.0, 0.1))):
        wanted = (np.array(scene.law.at(t)) - np.cross(omega, inertia * omega)) / inertia
        np.testing.assert_allclose(scene.right_hand_side()(t, omega), wanted, rtol=1e-14)
    scene = case_scene(5)
    wanted = (np.array([100, 200, 150]) - np.cross((0, 1, 1), inertia * (0, 1, 1))) / inertia
    np.testing.assert_allclose(scene.right_hand_side()(0.0, scene.omega), wanted, rtol=1e-14)


def test_torque_of_coefficients_is_not_divided() -> None:
    law = TorqueLaw((1.0, 2.0, 3.0))
    by_coefficients = Scene("", (0.0, 0.0, 0.0), coefficients=(0.0, 0.0, 0.0), torque=law)
    by_moments = Scene("", (0.0, 0.0, 0.0), moments=(2.0, 2.0, 2.0), torque=law)
    assert by_coefficients.normalized_torque(0.0) == (1.0, 2.0, 3.0)
    assert by_moments.normalized_torque(0.0) == (0.5, 1.0, 1.5)


@pytest.mark.parametrize("given", [(1, 2, 3), [1, 2, 3], np.array([1.0, 2.0, 3.0])])
def test_three_numbers_are_a_constant_torque(given: Any) -> None:
    scene = Scene("", (0.0, 0.0, 0.0), moments=(2.0, 2.0, 2.0), torque=given)
    assert scene.torque == TorqueLaw((1.0, 2.0, 3.0))


def test_largest_number_of_steps_fits() -> None:
    assert 10_000_000 < most_steps() <= 400_000_000


def test_name_is_short(tmp_path: Path) -> None:
    for given, kept in (("long " * 30, "long " * 11 + "long"), ("x" * 70, "x" * 60)):
        assert _read(tmp_path, GOOD.replace("spinning brick", given)).name == kept


def test_rate_alone_makes_a_torque_vary() -> None:
    law = TorqueLaw(rate=(0.0, 0.0, 3.0))
    scene = Scene("ramp", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=law)
    assert law.varies
    assert not law.is_zero
    assert scene.right_hand_side()(2.0, scene.omega) == [0.0, 0.0, 6.0]


def test_times_are_the_ends_of_steps() -> None:
    assert replace(case_scene(3), step_size=0.5, steps=3).times() == [0.5, 1.0, 1.5]


def test_wave_beyond_every_angle_is_no_number() -> None:
    law = TorqueLaw(sines=(((1.0, 0.0, 0.0), 1e308),))
    scene = Scene("fast", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=law)
    assert np.isnan(scene.right_hand_side()(1e10, scene.omega)[0])


def test_a_torque_of_the_state_and_a_changing_body_have_no_law() -> None:
    damped = Scene("", (1.0, 2.0, 3.0), (3.0, 2.5, 1.0), torque=torques.damping(0.1))
    changing = Scene("", (1.0, 2.0, 3.0), ChangingMoments([[3.0, 0.1], [2.0], [1.0]]))
    for scene, message in ((damped, STATE_TORQUE), (changing, CHANGING)):
        with pytest.raises(InputError, match=re.escape(message)):
            _ = scene.law
