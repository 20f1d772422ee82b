"""Sensitivities that begin late, change fast, cover many periods, or are very small or large."""

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, solve
from pyharness.engine.problem.problem import problem_of
from pyharness.engine.system.parameters import INERTIA_ELEMENTS, parameters_of
from pyharness.model.errors import TimedError
from pyharness.torques import damping
from tests.engine.test_parameter_sensitivity import (
    BRICK,
    MATRIX,
    check,
    differences,
    pushed_by,
    slopes,
)


def _shaken(t: Any, omega: Any, *, size: float = 0.0, rate: float = 2000.0) -> Any:
    return [size * np.sin(rate * t) * omega[1], 0.1 - 0.1 * omega[1], 0.0]


def _pushed(power: int) -> Any:
    def torque(t: Any, omega: Any, *, size: float = 0.1) -> Any:
        return [size * t**power - 0.1 * omega[0], 0.1, 0.1]

    return torque


def _driven(t: Any, omega: Any, *, drag: float = 0.02) -> Any:
    return [0.1 - drag * omega[0] ** 3, 0.1 - drag * omega[1] ** 3, -drag * omega[2] ** 3]


REST = replace(BRICK, omega=(0.0, 0.0, 0.0))


HARD: dict[str, tuple[Any, Any, list[str]]] = {
    # The first terms of the derivatives are 0.
    "cubic drag from rest": (REST, _driven, ["torque.drag"]),
    "cubic drag beside others": (REST, _driven, ["torque.drag", "omega"]),
    "square of the time": (BRICK, _pushed(2), ["torque.size"]),
    "sixth power of the time": (BRICK, _pushed(6), ["torque.size"]),
    "sixth power beside others": (BRICK, _pushed(6), ["torque.size", "omega"]),
    "moments from rest": (REST, TorqueLaw((0.1, -0.2, 0.3)), ["moments", "torque.rate"]),
    # omega grows by many orders of magnitude.
    "spin-up": (replace(BRICK, omega=(1e-8, 1e-8, -1e-8)), TorqueLaw((0.5, 0.3, -0.2)), ["omega"]),
    # The derivatives change faster than the solution.
    "fast wave without amplitude": (BRICK, TorqueLaw(sines=[((0, 0, 0), 1e3)]), ["torque.sines"]),
    "fast wave in a function": (BRICK, _shaken, ["torque.size"]),
}


@pytest.mark.parametrize("tolerance", [1e-9, 1e-12])
@pytest.mark.parametrize("kind", HARD)
def test_derivatives_that_begin_late_or_change_fast(kind: str, tolerance: float) -> None:
    scene, torque, names = HARD[kind]
    scene = replace(scene, torque=torque)
    times = [0.3, 1.0, 5.0]
    found = slopes(scene, times, "moments", *names, tolerance=tolerance)
    for name, array in slopes(scene, times, "moments", *names, tolerance=1e-15).items():
        size = np.abs(array).max(axis=(0, 1))
        assert (np.abs(found[name] - array).max(axis=(0, 1)) <= 10.0 * tolerance * size).all()


def test_a_fast_wave_without_amplitude_is_that_of_theory() -> None:
    ball = Scene("ball", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0),
                 torque=TorqueLaw(sines=[((0.0, 0.0, 0.0), 1e3)]))  # fmt: skip
    found = slopes(ball, [0.3, 2.0], "torque.sines")
    expected = (1.0 - np.cos(1e3 * np.array([0.3, 2.0]))) / 1e3
    assert found[:, 0, 0] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("tilt", [0.0, math.pi / 6.0])
@pytest.mark.parametrize("end", [0.1, 3.0])
def test_derivatives_may_begin_as_rounding_errors(tilt: float, end: float) -> None:
    """The rates of the derivatives at time 0 would be 0 without rounding."""
    c, s = math.cos(tilt), math.sin(tilt)
    axes = np.array([[c, -s, 0.0], [c * s, c * c, -s], [s * s, c * s, c]])
    inertia = axes @ np.diag([2.0, 2.0, 1.0]) @ axes.T + 1e-12
    values = [0.5 * (inertia[i, j] + inertia[j, i]) for i, j in INERTIA_ELEMENTS]

    def made(changed: list[float]) -> Scene:
        whole = np.zeros((3, 3))
        for (i, j), value in zip(INERTIA_ELEMENTS, changed, strict=True):
            whole[i, j] = whole[j, i] = value
        return Scene("steady", tuple(2.0 * axes[:, 2]), inertia=whole)

    check(slopes(made(values), end, "inertia"), differences(made, values, [end]), 1e-8)


def test_drag_from_rest_is_that_of_differences() -> None:
    ball = Scene("rest", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0))
    found = slopes(pushed_by(_driven, ball), [0.5, 2.0], "torque.drag")
    expected = differences(
        lambda x: pushed_by(partial(_driven, drag=x[0]), ball), [0.02], [0.5, 2.0]
    )
    assert found[..., 0] == pytest.approx(expected[..., 0], rel=1e-8)


@pytest.mark.parametrize("factor", [1e-12, 1e-16, 1e6])
def test_slow_and_fast_motions(factor: float) -> None:
    slow = Scene("", tuple(factor * w for w in BRICK.omega), moments=BRICK.moments)
    found = slopes(slow, [3.0 / factor], "omega")
    assert np.abs(found - slopes(BRICK, [3.0], "omega")).max() <= 1e-10
    pushed = replace(slow, torque=TorqueLaw((0.1 * factor**2, 0.0, 0.0)))
    assert np.isfinite(slopes(pushed, [3.0 / factor], "omega", "torque.constant")["omega"]).all()


@pytest.mark.parametrize("end", [720.0, 800.0])
def test_derivatives_beyond_binary64_are_refused(end: float) -> None:
    """The derivative is exp(t), of an omega that is 1e-200 rad/s at first."""
    scene = Scene("", (1e-200, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=damping(-1.0))
    assert solve(scene, end, tolerance=1e-3).omega[0, 0] > 1e100
    with pytest.raises(TimedError, match="sensitivities overflow"):
        slopes(scene, [1.0, end], "omega", tolerance=1e-3)


PERIODIC = {
    "brick": BRICK,
    "symmetric": Scene("top", (0.3, 0.4, 1.0), moments=(2.0, 2.0, 1.2)),
    "nearly symmetric": Scene("top", (0.3, 0.4, 1.0), moments=(2.0, 2.000001, 1.2)),
    "nearly flipping": Scene("flip", (1e-5, 1.0, 2e-5), moments=(1.0, 2.0, 3.0)),
    "small nutation": Scene("spin", (1.0, 0.05, 0.05), moments=(1.0, 2.0, 3.0)),
    "steady": Scene("spin", (1.0, 0.0, 0.0), moments=(1.0, 2.0, 3.0)),
    "nearly steady": Scene("spin", (1.0, 1e-6, 0.0), moments=(1.0, 2.0, 3.0)),
    "coefficients": Scene("abc", (0.3, 1.1, -0.7), coefficients=(0.4, -0.7, 0.3)),
    "full": Scene("full", (0.3, 1.1, -0.7), inertia=MATRIX),
    "slow": Scene("slow", (3e-5, 1.1e-4, -7e-5), moments=(3.0, 2.0, 1.2)),
}


@pytest.mark.parametrize("kind", PERIODIC)
def test_many_periods_are_those_of_the_series(kind: str) -> None:
    scene = PERIODIC[kind]
    times = np.array([-400.0, -33.3, 0.0, 1.0, 77.0, 500.0]) * (1e4 if kind == "slow" else 1.0)
    names = [name for name in parameters_of(scene) if name != "torque.rate"]
    found = slopes(scene, times, "omega", *names)
    for name, array in slopes(scene, times, "omega", *names, method="taylor").items():
        limit = 1e-9 * np.abs(array).max()
        assert np.abs(found[name] - array).max() <= limit


def test_a_million_periods_take_as_long_as_one() -> None:
    # The series would need ten million steps.
    found = slopes(BRICK, [1e7, -1e7], "moments", "omega", effort=1e-3)
    assert np.isfinite(found["moments"]).all()
    # A change of all moments by the same factor changes nothing.
    assert np.abs(found["moments"] @ [3.0, 2.0, 1.2]).max() <= 1e-9 * np.abs(found["moments"]).max()
    # omega0 multiplied by c is the motion in the time t/c: w + t w' in omega and its derivative.
    scaled = found["omega"] @ np.array(BRICK.omega)
    state = solve(BRICK, [1e7, -1e7]).omega
    expected = state + np.array([[1e7], [-1e7]]) * problem_of(BRICK, False).rates(
        np.zeros(2), state
    )
    check(scaled, expected, 1e-8)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-6])
def test_few_digits_near_the_separatrix_are_of_the_same_motion(tolerance: float) -> None:
    """A tolerance above the distance from the separatrix led to the derivatives of another one."""
    scene = Scene("", (1e-5, 1.0, -1e-5), moments=(1.5, 1.7, 1.9))
    found: Any = solve(scene, [2000.0], tolerance=tolerance, sensitivities=["omega"])
    assert found.ended == "complete"
    # From mpmath's elliptic functions with 60 digits.
    assert np.abs(found.sensitivities["omega"]).max() == pytest.approx(48.57, abs=0.01)
