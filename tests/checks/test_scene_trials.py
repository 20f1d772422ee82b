"""The trials of `stress --scene`, on scenes with any torque."""

import json
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, read_scene, solve, torques
from pyharness.checks import scene_trials as room
from pyharness.checks.check import Check
from pyharness.checks.scenes.random_scenes import random_scene
from pyharness.checks.stress import SCENE_TRIALS, TRIALS, stress
from pyharness.engine.plan.registry import METHODS
from pyharness.engine.problem.rotated import restarted_at
from pyharness.model.scene_file import scene_text
from tests.conftest import Patch, ResultOf

DAMPED = "docs/damped.toml"
MOMENTS = (4.0, 3.0, 2.0)
SCENES: dict[str, Callable[[], Scene]] = {
    "expressions": lambda: replace(read_scene(DAMPED), step_size=1.0),
    "terms": lambda: Scene(
        "terms", (0.2, 1.0, -0.3), moments=MOMENTS, attitude=(0.5, 0.5, -0.5, 0.5), steps=200,
        torque=torques.gravity_gradient(MOMENTS, 0.7)
        + torques.table([0.0, 0.6, 1.3], np.eye(3), "cubic"),
    ),
    "coefficients": lambda: Scene(
        "coefficients", (0.2, 1.0, -0.3), coefficients=(0.25, -0.7, 0.5), steps=200,
        torque=lambda t, w: [-0.2 * w[0], np.sin(t * w[1]), 0.0],
    ),
    "law": lambda: replace(random_scene("driven", 3, "law"), step_size=0.01, steps=100),
    "free": lambda: Scene("free", (0.2, 1.0, -0.3), moments=MOMENTS, steps=200),
}  # fmt: skip


def checks_of(scene: Scene, *only: str) -> list[Check]:
    """Return the requested checks of the trials of a scene."""
    return list(stress(only, room.scene_trials(scene, " --scene x.toml")))


@pytest.mark.campaign
@pytest.mark.parametrize("kind", SCENES)
def test_all_checks_pass_and_have_names_of_their_own(kind: str) -> None:
    found = checks_of(SCENES[kind]())
    assert [(check.id, check.note) for check in found if not check.passed] == []
    assert len({check.id for check in found}) == len(found) > 60
    assert set(SCENE_TRIALS) <= set(TRIALS)
    is_law = kind in ("law", "free")
    left_out = set() if is_law else {"step-size"}
    assert {check.suite for check in found} == set(SCENE_TRIALS) - left_out
    bounded = {check.name.subject for check in found if check.limit is not None}
    assert bounded >= {"auto", "taylor", "dop853"}
    assert {"gauss-8", "rk4"} <= bounded or not is_law
    assert all(check.replay.endswith(" --scene x.toml") for check in found)
    # The bounds are useful: none of them is near the largest possible difference.
    assert max(check.limit for check in found if check.limit is not None) < 0.3


def _off(real: Callable[..., Any], only_at: Callable[[Scene], bool]) -> Callable[..., Any]:
    def wrong(scene: Scene, *given: Any, **more: Any) -> Any:
        found = real(scene, *given, **more)
        return replace(found, omega=found.omega * 1.001) if only_at(scene) else found

    return wrong


@pytest.mark.parametrize("trial", ["invariance/taylor/axes", "invariance/taylor/back",
                                   "invariance/taylor/split", "length/taylor"])  # fmt: skip
def test_fault_is_seen(trial: str) -> None:
    """Omega has an error of .001 in some of the calls."""
    scene = SCENES["terms"]()
    place = "checks.compare.candidates" if "length" in trial else "checks.scene_trials"
    is_same = trial.endswith(("split", "length/taylor"))
    wrong = _off(solve, lambda each: is_same == (each.torque == scene.torque))
    with patch(f"pyharness.{place}.solve", wrong):
        found = [each for each in checks_of(scene, trial) if each.name.quantity != "angle"]
    assert found
    assert not any(check.passed for check in found)


def test_a_restarted_scene_has_the_torque_of_later_times() -> None:
    sines, cosines = [((1.0, 2.0, 3.0), 1.5)], [((0.3, -0.2, 0.5), 0.7)]
    law = TorqueLaw((0.1, 0.2, 0.3), (0.4, -0.5, 0.6), sines, cosines)
    later = restarted_at(Scene("", (0.2, 1.0, -0.3), moments=MOMENTS, torque=law), np.ones(3), 2.0)
    moved: Any = later.torque
    assert (later.omega, later.moments) == ((1.0, 1.0, 1.0), MOMENTS)
    for time in (0.0, 0.7, -1.3):
        assert moved.at(time) == pytest.approx(law.at(time + 2.0), rel=1e-13)


def test_a_restarted_scene_has_the_terms_of_later_times() -> None:
    scene: Any = SCENES["terms"]()
    later: Any = restarted_at(scene, np.ones(3), 0.9, scene.attitude)
    for time in (-0.5, 0.1, 0.3):
        given = (0.3, 0.2, 0.1), scene.attitude
        wanted = scene.torque.at(time + 0.9, *given)
        assert later.torque.at(time, *given) == pytest.approx(wanted, rel=1e-13)


def test_wrong_order_and_other_bits_are_seen() -> None:
    scene = SCENES["law"]()
    with patch.object(room, "FIXED_STEP", ("improved-euler",)), patch.dict(
        METHODS, {"improved-euler": replace(METHODS["improved-euler"], order=3)}
    ):  # fmt: skip
        (check,) = checks_of(scene, "step-size")
    assert not check.passed
    bits = iter(range(10**6))
    with patch.object(room, "_bits", lambda scene, method: str(next(bits)).encode()):
        assert not any(check.passed for check in checks_of(scene, "threads/auto"))


@pytest.mark.campaign
def test_verb_stress_with_a_scene(result_of: ResultOf, tmp_path: Path, monkeypatch: Patch) -> None:
    path = tmp_path / "a scene.toml"
    path.write_text(scene_text(SCENES["expressions"]()))
    monkeypatch.chdir(tmp_path)
    command = f"stress --scene '{path}' --only length/auto"
    checks = json.loads(result_of(shlex.split(f"{command} --format json")).out)["checks"]
    assert checks
    again = shlex.split(checks[0]["replay"])[3:]
    assert json.loads(result_of([*again, "--format", "json"]).out)["checks"] == checks[:1]
    assert [each.name for each in tmp_path.iterdir()] == ["a scene.toml"]
