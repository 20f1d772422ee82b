"""Points without a Taylor series where the torque is finite, as where a root or norm is 0."""

import math
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, Stepper, solve, solve_many
from tests.campaigns import driver, singular_campaign

SPHERE = (1.0, 1.0, 1.0)


def _about_z(law: Any, omega: float = 0.0, **more: Any) -> Scene:
    return Scene("z", (0.0, 0.0, omega), moments=SPHERE,
                 torque=lambda t, w: [0.0 * t, 0.0 * t, law(t, w)], **more)  # fmt: skip


def _drag(t: Any, w: Any) -> Any:
    return 1.0 - 0.5 * np.linalg.norm(w) * w[2]


def _short_push(t: Any, w: Any) -> Any:
    return np.where((t > 3.0) & (t < 3.125), 9.0, 0.0) - np.linalg.norm(w) * w[2]


def _tan_tanh(start: float, t: float) -> float:
    """Return the solution of w' = 1 - |w| w/2."""
    k = math.sqrt(0.5)
    zero = math.atan(-k * start) / k
    return math.tan(k * (t - zero)) / k if t < zero else math.tanh(k * (t - zero)) / k


CASES: dict[str, tuple[Scene, list[float], list[float]]] = {
    "t**1.5": (_about_z(lambda t, w: t**1.5), [1.0, 4.0], [0.4, 12.8]),
    "root of time": (_about_z(lambda t, w: np.sqrt(t)), [1.0, 4.0], [2 / 3, 16 / 3]),
    "power of time": (_about_z(lambda t, w: t**0.3, 0.5), [1.0], [0.5 + 1 / 1.3]),
    "root of a distance": (
        _about_z(lambda t, w: np.sqrt(np.abs(t - 1.0))), [1.0, 2.0, 5.0], [2 / 3, 4 / 3, 6.0],
    ),
    "root and jump": (
        _about_z(lambda t, w: np.sqrt(np.abs(t - 1.0)) + np.where(t > 1.0, 1.0, 0.0)),
        [2.0], [7 / 3],
    ),
    "arccosine": (_about_z(lambda t, w: np.arccos(np.cos(t))), [1.0, 2.0], [0.5, 2.0]),
    "norm": (_about_z(_drag, -1.0), [0.5, 2.0], [_tan_tanh(-1.0, 0.5), _tan_tanh(-1.0, 2.0)]),
    "norm at rest": (_about_z(_drag), [0.5, 2.0], [_tan_tanh(0.0, 0.5), _tan_tanh(0.0, 2.0)]),
    "norm at rest, pushed later": (
        _about_z(lambda t, w: np.where(t > 3.0, 1.0, 0.0) - 0.5 * np.linalg.norm(w) * w[2]),
        [2.0, 5.0], [0.0, _tan_tanh(0.0, 2.0)],
    ),
    "norm at rest, short push": (
        _about_z(_short_push),
        [2.0, 5.0], [0.0, 1.0 / (1.0 / (3.0 * math.tanh(0.375)) + 1.875)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_motion_goes_on(name: str) -> None:
    scene, times, wanted = CASES[name]
    for tolerance in (1e-12, 1e-9, 1e-4):
        found: Any = solve(scene, times, tolerance=tolerance, dense_output=True)
        assert found.ended == "complete"
        limit = tolerance * max(map(abs, [*wanted, scene.omega[2]]))
        assert found.omega[:, 2] == pytest.approx(wanted, abs=limit)
        assert found.sol(times)[2] == pytest.approx(wanted, abs=limit)
        assert found.error <= tolerance
    many = solve_many([scene, scene], times[-1])
    assert many.omega[:, 2] == pytest.approx([wanted[-1]] * 2, rel=1e-11)


# From rest, the rounding error of the arccosine is large.
@pytest.mark.parametrize("name", [name for name in CASES if name != "arccosine"])
def test_a_stepper_goes_on(name: str) -> None:
    scene, times, wanted = CASES[name]
    stepper = Stepper(scene, 1e-9)
    stepper.until(times[-1])
    assert stepper.omega[2] == pytest.approx(wanted[-1], rel=1e-7)


@pytest.mark.parametrize("start", [0.0, 0.3])
@pytest.mark.parametrize("n", [17, 20, 26, 40])
def test_high_powers_of_time_from_rest(n: int, start: float) -> None:
    found: Any = solve(_about_z(lambda t, w: (n + 1) * t**n, start), [0.5, 1.0])
    assert found.ended == "complete"
    assert found.omega[:, 2] - start == pytest.approx([0.5 ** (n + 1), 1.0], abs=1e-12)
    pulse = solve(_about_z(lambda t, w: (4.0 * t * (1.0 - t)) ** n, start), 1.0).omega[0, 2]
    assert pulse - start == pytest.approx(4.0**n * math.gamma(n + 1) ** 2 / math.gamma(2 * n + 2))


@pytest.mark.parametrize("omega", [0.0, 0.3])
def test_high_powers_of_time_in_a_state(omega: float) -> None:
    for n in (17, 26, 40):
        scene = Scene("", (0.0, 0.0, omega), moments=SPHERE, states={"x": 0.0},
                      torque=lambda t, w, s, *, n=n: (0.0 * w, {"x": (n + 1) * t**n}))  # fmt: skip
        found: Any = solve(scene, 1.0)
        assert found.states["x"] == pytest.approx([1.0], rel=1e-11)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-9])
@pytest.mark.parametrize("rate", [200.0, 800.0])
def test_a_state_that_grows_out_of_rounding_errors(rate: float, tolerance: float) -> None:
    def torque(t: Any, w: Any, s: Any) -> Any:
        return 0.0 * w, {"x": np.tanh(rate * (t - 0.4)) - np.tanh(rate * (t - 0.401))}

    scene = Scene("", (0.0, 0.0, 1.0), moments=(1.0, 2.0, 1.0), torque=torque, states={"x": 0.0})
    found: Any = solve(scene, 1.0, tolerance=tolerance)
    assert found.ended == "complete"
    assert found.states["x"] == pytest.approx([0.002], rel=2.0 * tolerance)


def test_a_crossing_changes_perturbations_by_the_jump() -> None:
    """Behind a root that jumps, omega depends on the time at which it was 0."""

    def law(t: Any, w: Any) -> Any:
        return np.where(w[2] > 0.0, 2.0, 1.0) + 0.01 * np.sqrt(np.abs(w[2]))

    ends = [solve(_about_z(law, start), 2.0, tolerance=1e-11) for start in (-1.0, -1.0 + 1e-6)]
    change = (ends[1].omega[0, 2] - ends[0].omega[0, 2]) / 1e-6
    assert ends[0].growth == pytest.approx(change, rel=0.05)


def test_campaign_finds_no_fault() -> None:
    assert (
        driver.campaign(singular_campaign.MODULE, singular_campaign.try_scene, 8, "test").faults
        == []
    )


def _root(x: Any) -> Any:
    return np.sign(x) * np.sqrt(np.abs(x))


# Rates of a motion that begins at 1, and its values at 1, 2.5 and 4 s.
STOPS: dict[str, tuple[Any, list[float]]] = {
    "root": (lambda t, x: -_root(x), [0.25, 0.0, 0.0]),
    "root of a level": (lambda t, x: -np.sqrt(x), [0.25, 0.0, 0.0]),
    "power 1/4": (lambda t, x: -np.sign(x) * np.abs(x) ** 0.25, [0.25 ** (4 / 3), 0.0, 0.0]),
    "power 2/3": (lambda t, x: -1.5 * np.sign(x) * np.abs(x) ** (2 / 3), [0.125, 0.0, 0.0]),
    "pushed later": (
        lambda t, x: np.where(t > 3.0, 1.0, 0.0) - _root(x), [0.25, 0.0, 0.487609534846501],
    ),
    "pushed more and more": (
        lambda t, x: np.where(t > 3.0, t - 3.0, 0.0) - _root(x), [0.25, 0.0, 0.25],
    ),
}  # fmt: skip


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-9, 1e-12])
@pytest.mark.parametrize("name", STOPS)
def test_what_stops_in_a_finite_time_remains_at_0(name: str, tolerance: float, side: float) -> None:
    law, wanted = STOPS[name]
    times = [side * t for t in (1.0, 2.5, 4.0)]

    def with_state(t: Any, w: Any, states: Any) -> Any:
        return [0.1 * np.cos(t), 0.0 * t, 0.0 * t], {"x": side * law(side * t, states["x"])}

    plain = _about_z(lambda t, w: side * law(side * t, w[2]), 1.0)
    own = Scene("own", (0.3, 0.2, 0.1), moments=SPHERE, states={"x": 1.0}, torque=with_state)
    for scene in (plain, own):
        found: Any = solve(scene, times, tolerance=tolerance, dense_output=True)
        limit = tolerance + 4e-15 * found.growth
        if (name, tolerance) == ("root of a level", 1e-5):
            # Before the stop perturbations grow without limit, so that rounding errors decide.
            assert found.ended in ("complete", "sensitive")
        else:
            assert found.ended == "complete"
        assert found.ended == "sensitive" or found.error <= limit
        assert found.y[-1] == pytest.approx(wanted, rel=0.0, abs=limit)
        assert found.sol(times)[-1] == pytest.approx(wanted, rel=0.0, abs=limit)


@pytest.mark.parametrize("power", [0.5, 2 / 3])
def test_what_may_leave_0_is_not_kept_there(power: float) -> None:
    """Past its touch of 0 the motion is not unique: it may stay for any time."""
    found = solve(_about_z(lambda t, w: np.abs(w[2]) ** power, -1.0), [1.0, 2.5 / (1.0 - power)])
    assert found.ended in ("sensitive", "singular")
    if found.ended == "sensitive":
        assert found.omega[-1, 2] > 0.0
