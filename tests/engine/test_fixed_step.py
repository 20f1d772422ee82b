"""The methods of III.2: their formulas, and steps that do not divide the time."""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, prepare, solve
from pyharness.engine.plan.registry import FIXED_STEP, METHODS
from pyharness.model.trajectory import Array

_LAW = TorqueLaw(
    (1.0, 2.0, 3.0), (0.5, 0.0, -1.0), (((10.0, 2.0, 3.0), 3.0), ((1.0, 0.0, 0.0), 0.0)),
    (((3.0, 2.0, 10.0), 2.0),),
)  # fmt: skip


def _scene(torque: TorqueLaw, step: float) -> Scene:
    return Scene("", (0.3, 1.0, 5.0), moments=(40.0, 30.0, 20.0), torque=torque, step_size=step)


def _formula(method: str, scene: Scene) -> Callable[[float, Array, float], Array]:
    """Return one step of the method as the thesis writes it, in plain numpy."""
    right_hand_side = scene.right_hand_side()

    def f(t: float, y: Array) -> Array:
        return np.array(right_hand_side(t, y.tolist()))

    def step(t: float, y: Array, h: float) -> Array:
        k1 = f(t, y)
        if method == "improved-euler":
            return np.asarray(y + h / 2 * (k1 + f(t + h, y + h * k1)))
        if method == "taylor-3":
            # The derivative of the torque, by central differences of high order.
            d = 1e-3
            torque = [np.array(scene.normalized_torque(t + i * d)) for i in (-2, -1, 1, 2)]
            slope = (torque[0] - 8 * torque[1] + 8 * torque[2] - torque[3]) / (12 * d)
            products = [k1[i - 2] * y[i - 1] + y[i - 2] * k1[i - 1] for i in range(3)]
            second = slope + np.array(scene.euler_coefficients) * products
            return np.asarray(y + h * k1 + h * h / 2 * second)
        assert method == "rk4", f"write the formula of {method} here"
        k2 = f(t + h / 2, y + h / 2 * k1)
        k3 = f(t + h / 2, y + h / 2 * k2)
        return np.asarray(y + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(t + h, y + h * k3)))

    return step


@pytest.mark.parametrize("torque", [TorqueLaw(), TorqueLaw((100.0, 50.0, 20.0)), _LAW])
@pytest.mark.parametrize("method", FIXED_STEP)
def test_formulas_and_the_shortened_step(method: str, torque: TorqueLaw) -> None:
    """Times 0.25 and 0.55 with steps of 0.1: a shorter step ends at each time."""
    scene = _scene(torque, 0.1)
    step = _formula(method, scene)
    y, t = np.array(scene.omega), 0.0
    wanted = []
    for h in (0.1, 0.1, 0.05, 0.1, 0.1, 0.1):
        y = step(t, y, h)
        t += h
        if h == 0.05 or t > 0.5:
            wanted.append(y)
    found = solve(scene, [0.25, 0.55], method, 1.0)
    np.testing.assert_allclose(found.omega, wanted, rtol=0, atol=1e-12)
    assert (found.steps, found.evaluations) == (6, 6 * METHODS[method].evaluations)


@pytest.mark.parametrize("method", FIXED_STEP)
def test_torque_goes_on_where_many_steps_pause(method: str) -> None:
    """A kernel pauses now and then to check for Ctrl-C; the torque must then be at its own time."""
    law = TorqueLaw(cosines=(((0.0, 0.0, 1.0), 1.0),))
    scene = Scene("", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=law, step_size=1e-5)
    assert abs(solve(scene, [5.0], method, 1.0).omega[0, 2] - math.sin(5.0)) < 1e-9


@pytest.mark.parametrize("time", [2.0, -1.7])
@pytest.mark.parametrize("torque", [TorqueLaw(), _LAW])
@pytest.mark.parametrize("method", FIXED_STEP)
def test_prepared_takes_the_same_steps_in_any_thread(
    method: str, torque: TorqueLaw, time: float
) -> None:
    """With or without a shorter last step, a prepared solver and `solve` give the same bits."""
    scene = _scene(torque, 0.125)
    wanted = solve(scene, [time], method, 1.0)

    def end(_: int) -> Array:
        solver = prepare(scene, method, 1.0, attitude=False)
        omega = solver(np.array(scene.omega), time)
        assert (solver.status, solver.steps) == ("complete", wanted.steps)
        return omega

    with ThreadPoolExecutor(8) as pool:
        for found in pool.map(end, range(40)):
            np.testing.assert_array_equal(found, wanted.omega[0])
