"""Methods with a fixed step under torques that depend on the state: formulas, orders, refusals."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, case_scene, prepare, solve, solve_many, torques
from pyharness.methods.registry import FIXED_STEP, GAUSS, METHODS
from pyharness.model.law_symbols import law_value
from pyharness.model.state_torque import opaque, replayed
from pyharness.scenes.state_scenes import draw, draw_ready
from pyharness.truth.reference import Reference, reference

MOMENTS = (4.0, 3.0, 2.0)


def as_tape(scene: Scene) -> Scene:
    """Return a scene whose torque law is recorded on a tape."""
    law = scene.law
    return replace(scene, torque=replayed(lambda t, omega, q: law_value(law, t)))


@pytest.mark.parametrize("case", [1, 5, 7])
@pytest.mark.parametrize("method", FIXED_STEP)
def test_steps_are_those_of_the_compiled_method(method: str, case: int) -> None:
    """Steps of .01 s to 0.055 s and 0.3 s: a shorter step ends at the first time."""
    scene, times = case_scene(case), [-0.2, -0.055, 0.055, 0.3]
    wanted, found = solve(scene, times, method), solve(as_tape(scene), times, method)
    assert np.abs(found.omega - wanted.omega).max() <= 2e-14 * np.abs(wanted.omega).max()
    assert (found.steps, found.evaluations) == (wanted.steps, wanted.evaluations)
    assert found.tolerance is None


@cache
def solved(number: int) -> tuple[Scene, float, Reference]:
    """Return a random scene, a time (s), and the reference at this time."""
    source = Random(f"fixed {number}")
    names = {0: ("damping", "wave"), 1: ("gradient", "drag"), 2: ("quotient", "swing", "field")}
    drawn = draw(source, names[number]) if number in names else draw_ready(source)
    scene, time = drawn[0], math.copysign(2.0 / np.abs(drawn[0].omega).max(), drawn[1])
    if "table" in scene.name or "pulses" in scene.name:
        scene = replace(scene, torque=torques.gravity_gradient(scene.moments or MOMENTS, 0.5))
    return scene, time, reference(scene, [time])


@pytest.mark.parametrize("method", FIXED_STEP)
@pytest.mark.parametrize("number", range(6))
def test_error_falls_with_the_order_of_the_step(method: str, number: int) -> None:
    """The errors of omega and attitude against the reference in decimal arithmetic."""
    scene, time, truth = solved(number)
    with_attitude = scene.attitude is not None
    errors = []
    for steps in (64, 128, 256):
        fine = replace(scene, step_size=abs(time) / steps)
        found = solve(fine, time, method, attitude=with_attitude)
        error = [float(np.abs(found.omega - truth.omega).max()) / np.abs(scene.omega).max()]
        if found.attitude is not None and truth.attitude is not None:
            error.append(float(np.abs(found.attitude - truth.attitude).max()))
        errors.append(error)
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.abs(orders[-1] - METHODS[method].order).max() < 0.25
    assert np.array(errors).min() > 1e-14  # not of rounding alone


@pytest.mark.parametrize("method", FIXED_STEP)
def test_known_decay(method: str) -> None:
    """One step for omega' = -k omega multiplies omega by a Taylor polynomial of exp(-k h)."""
    scene = Scene(
        "", (1.0, 2.0, 3.0), moments=(2, 2, 2), torque=torques.damping(0.2), step_size=0.5
    )
    factor = sum((-0.05) ** n / math.factorial(n) for n in range(METHODS[method].order + 1))
    found = solve(scene, [0.5, 1.0], method).omega
    assert found == pytest.approx(np.outer([factor, factor**2], [1.0, 2.0, 3.0]), rel=1e-15)


@pytest.mark.parametrize("method", [*FIXED_STEP, "gauss-2"])
def test_trajectory_ends_where_the_torque_is_singular(method: str) -> None:
    def torque(t: Any, w: Any) -> Any:
        return [1.0 / (t - 0.5), 0.0, 0.0]

    def root(t: Any, w: Any) -> Any:
        return [np.sqrt(0.55 - t), 0.0, 0.0]

    for each in (torque, root) if method != "gauss-2" else (root,):
        scene = Scene("", (1.0, 0.0, 0.0), moments=MOMENTS, torque=each, step_size=0.125)
        found = solve(scene, [0.25, 1.0], method)
        assert found.ended == "overflow"
        assert len(found.time) == 1
    scene = Scene("", (1.0, 0.0, 0.0), moments=(1, 1, 1), torque=lambda t, w: w**3, step_size=0.01)
    found = solve(scene, [0.25, 2.0], method)
    assert found.ended == "overflow"
    assert found.time.tolist() == [0.25]


def _braked(t: Any, w: Any) -> Any:
    return -w


MAGNET = Scene("magnet", (1, 2, 3), moments=MOMENTS, torque=lambda t, w, q: [q[1], 0.0, 0.0])
DAMPED = Scene("damped", (1, 2, 3), moments=MOMENTS, torque=torques.damping(0.2))


@pytest.mark.parametrize("method", [*FIXED_STEP, *GAUSS])
def test_what_can_not_be_solved_is_refused_in_one_line(method: str) -> None:
    calls: dict[str, Callable[[], Any]] = {
        "needs the attitude": lambda: solve(MAGNET, 1.0, method),
        "opaque torque": lambda: solve(
            replace(DAMPED, torque=opaque(_braked)), 1.0, method
        ),
        "has no prepared solver": lambda: prepare(DAMPED, method),
        f"method {method} has no prepared solver": lambda: solve_many(
            DAMPED, 1.0, omega0=np.ones((2, 3)), moments=np.ones((2, 3)), method=method
        ),
        "does not compute attitudes": lambda: solve(case_scene(3), 1.0, method, attitude=True),
    }  # fmt: skip
    for words, call in calls.items():
        with pytest.raises(InputError, match=words) as caught:
            call()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", [*FIXED_STEP, "gauss-1"])
def test_work_limit(method: str) -> None:
    with pytest.raises(InputError, match="allow more work") as caught:
        solve(replace(DAMPED, step_size=1e-4), 1e4, method, effort=1e-3)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", [*FIXED_STEP, "gauss-3"])
def test_full_inertia_and_attitude_of_the_scene(method: str) -> None:
    matrix = [[3.0, 0.1, 0.0], [0.1, 4.0, 0.2], [0.0, 0.2, 5.0]]
    scene = Scene(
        "full", (1, 2, 3), inertia=matrix, torque=lambda t, w, q: [q[1] - 0.1 * w[0], w[2], q[2]],
        attitude=(0.8, 0.0, 0.6, 0.0), step_size=1e-3,
    )  # fmt: skip
    found = solve(scene, [-0.5, 0.5], method, attitude=True)
    wanted = solve(scene, [-0.5, 0.5], attitude=True)
    assert found.attitude is not None
    assert wanted.attitude is not None
    assert np.abs(found.omega - wanted.omega).max() < 2e-5
    assert np.abs(found.attitude - wanted.attitude).max() < 2e-5
