"""Repeated calls of `solve` with one scene, which keep its preparation."""

import copy
import gc
import pickle
import re
import weakref
from dataclasses import fields, replace
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, Trajectory, solve, torques
from pyharness.checks.scenes.random_scenes import KINDS, random_scene
from pyharness.checks.scenes.state_scenes import STEADY, TURNING, draw
from pyharness.engine.prepared.ends import kept_end

_TOP = Scene("top", (0.3, 0.2, 0.9), moments=(1.0, 2.0, 2.5))
_MATRIX = ((2.0, 0.1, 0.0), (0.1, 1.5, 0.2), (0.0, 0.2, 1.2))
_TURNED = Scene("turned", (0.3, 0.2, 0.9), inertia=_MATRIX)
_FUNCTIONS: dict[str, Any] = {
    "no torque": TorqueLaw(),
    "waves": TorqueLaw((0.1, 0.0, 0.2), sines=[((1.0, 2.0, 3.0), 5.0), ((1.0, 0.0, 0.0), 5.0)]),
    "torque in space": TorqueLaw((0.1, 0.0, 0.2), frame="space"),
    "function": lambda t, w: [-0.1 * w[0] * abs(w[0]), np.sin(3.0 * t), -0.3 * w[2]],
    "switch": lambda t, w: -np.clip(w, -0.5, 0.5),
    "control": torques.attitude_control(0.3, 0.2),
}


def _all_equal(first: Trajectory, second: Trajectory) -> None:
    assert type(first) is type(second)
    for each in fields(first):
        x, y = getattr(first, each.name), getattr(second, each.name)
        if isinstance(x, np.ndarray):
            assert (x.shape, x.tobytes()) == (y.shape, y.tobytes()), each.name
        elif each.name != "scene":
            assert x == y, each.name


def _solved_twice(scene: Scene, time: float, **options: Any) -> bool:
    """Return whether the second call used what the first had kept."""
    again, refused = replace(scene), ""
    try:
        first = solve(scene, [time], **options)
    except InputError as refusal:
        refused = str(refusal)
    for _ in range(3):
        if refused:
            with pytest.raises(InputError, match=re.escape(refused)):
                solve(again, time, **options)
        else:
            _all_equal(first, solve(again, time, **options))
    key = "auto", options["tolerance"], 1.0, options.get("attitude")
    return not refused and kept_end(again, time, key) is not None


@pytest.mark.parametrize("kind", KINDS)
def test_random_scenes_have_the_same_results_in_every_call(kind: str) -> None:
    used = 0
    for number in range(4):
        source = Random(f"kept {kind} {number}")
        scene = random_scene(kind, f"kept {kind} {number}")
        used += _solved_twice(
            scene, source.uniform(-3.0, 8.0), tolerance=10.0 ** source.uniform(-13.0, -3.0),
            attitude=source.choice([None, True, False]),
        )  # fmt: skip
    assert used or kind == "extreme"


@pytest.mark.parametrize("names", [STEADY, TURNING])
def test_recorded_torques_have_the_same_results_in_every_call(names: tuple[str, ...]) -> None:
    for number in range(5):
        scene, time = draw(Random(f"kept {number}"), names)
        _solved_twice(scene, time, tolerance=1e-9, attitude=True)


@pytest.mark.parametrize("name", _FUNCTIONS)
@pytest.mark.parametrize("body", [_TOP, _TURNED])
def test_bodies_about_any_axes(body: Scene, name: str) -> None:
    scene = replace(body, torque=_FUNCTIONS[name], attitude=(0.5, -0.1, 0.7, 0.5))
    for attitude in (None, True) if scene.torque.needs_attitude else (None, True, False):
        for tolerance in (1e-12, 1e-5):
            assert _solved_twice(scene, 3.0, tolerance=tolerance, attitude=attitude)


def test_equal_arguments_of_other_types_are_refused_in_every_call() -> None:
    scene = replace(_TOP)
    for _ in range(3):
        solve(scene, 2.0)
        for options in ({"effort": True}, {"attitude": 1}, {"dense_output": 0}, {"tolerance": "1"}):
            with pytest.raises(InputError):
                solve(scene, 2.0, **options)


@pytest.mark.parametrize(("body", "calm", "long"), [
    ({"moments": (4.0, 3.0, 2.0)}, 1e13, 1e14),
    ({"inertia": ((4.0, 0.3, 0.1), (0.3, 3.0, 0.2), (0.1, 0.2, 2.0))}, 1e5, 1e8),
])  # fmt: skip
def test_a_long_free_motion_is_sensitive_in_every_call(body: Any, calm: float, long: float) -> None:
    scene = Scene("", (1.0, 0.5, 0.2), **body)
    ended = [solve(scene, time).ended for time in (calm, long) for _ in range(2)]
    assert ended == ["complete", "complete", "sensitive", "sensitive"]


def test_results_are_independent_of_each_other() -> None:
    scene = replace(_TURNED)
    found = [solve(scene, 2.0) for _ in range(3)]
    found[1].axes[:] = 0.0
    found[1].omega[:] = 0.0
    _all_equal(found[2], solve(scene, 2.0))


def test_estimates_are_computed_when_read_and_travel() -> None:
    scene = replace(_TOP)
    solve(scene, 2.0)
    found = solve(scene, 2.0)
    assert "growth" not in vars(found)
    for other in (pickle.loads(pickle.dumps(found)), copy.copy(found), replace(found)):
        assert (other.error, other.growth) == (found.error, found.growth)
    assert found.growth is not None
    assert found.growth > 1.0


def test_a_scene_keeps_little() -> None:
    scene = replace(_TOP)
    for number in range(60):
        for _ in range(2):
            found = solve(scene, 2.0, tolerance=1e-9 + 1e-12 * number)
    assert len(vars(scene)["_kept"]) <= 20
    _all_equal(found, solve(replace(scene), 2.0, tolerance=1e-9 + 59e-12))


def test_scenes_are_pickled_and_freed_without_what_is_kept() -> None:
    scene = replace(_TOP)
    before = pickle.dumps(scene)
    solve(scene, 2.0)
    solve(scene, 2.0)
    assert pickle.dumps(scene) == before
    seen = weakref.ref(scene)
    del scene
    gc.collect()
    assert seen() is None
