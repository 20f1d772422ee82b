"""Events at corners: roots without a change of sign that no polynomial shows."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, solve
from pyharness.events import Event, flip
from pyharness.torques import damping
from tests.campaigns import driver
from tests.campaigns.event_campaign import BODY, CORNERS, search
from tests.engine.test_events import events_of, times_of, with_attributes

POINTS = ([1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [0.3, 1.7, 2.9, 6.99], [1.75, 3.5])


@pytest.mark.parametrize(("kind", "seed"), [
    *((kind, seed) for kind in CORNERS for seed in (5000, 5001)),
    # Corners whose value is the rounding error of a larger term, and one near the start.
    ("rectified", 1014), ("rectified", 1008), ("rectified", 9091), ("corners", 9035),
])  # fmt: skip
def test_planted_corners_are_found(kind: str, seed: int) -> None:
    tally = driver.Tally()
    search(kind, seed, tally)
    assert tally.faults == []


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_equal_corners_are_all_found(points: list[float], sign: float) -> None:
    def apart(t: Any) -> list[Any]:
        return [abs(t - point) for point in points]

    functions: list[Callable[[Any], Any]] = [
        lambda t: np.prod(apart(t), axis=0),
        lambda t: np.minimum.reduce(apart(t)),
        lambda t: min(apart(float(t))),
    ]
    for function in functions:
        for side in (1.0, -1.0):
            found = times_of(BODY, 7.0 * side, lambda t, w, f=function, s=side: sign * f(s * t))
            assert found == pytest.approx([side * p for p in points], abs=1e-14)


@pytest.mark.parametrize("rate", [1.0, 3.7, 20.0])
def test_all_roots_of_a_rectified_sine_are_found(rate: float) -> None:
    roots = np.pi * np.arange(1, int(10.0 * rate / np.pi) + 1) / rate
    found = times_of(BODY, 10.0, lambda t, w: abs(np.sin(rate * t)))
    assert found == pytest.approx(roots.tolist(), abs=1e-14)
    assert times_of(BODY, 10.0, lambda t, w: abs(np.sin(rate * t)) + 1e-6) == []


@pytest.mark.parametrize("power", [0.3, 0.5, 1.0, 1.5, 3.0])
@pytest.mark.parametrize("point", [0.0141, 0.75, 1.3])
def test_powers_of_a_distance_are_0_at_one_time(power: float, point: float) -> None:
    assert times_of(BODY, 3.0, lambda t, w: abs(t - point) ** power) == [point]
    above = 1e-3 if power < 1.0 else 1e-12
    assert times_of(BODY, 3.0, lambda t, w: abs(t - point) ** power + above) == []


STATES: list[Callable[[Any, Any], Any]] = [
    lambda t, w: abs(w[0]),
    lambda t, w: -abs(w[0]) * (2.0 + np.cos(t)),
    lambda t, w: np.maximum(w[0], -w[0]),
    lambda t, w: np.sqrt(w[0] ** 2),
    lambda t, w: np.sqrt(abs(w[0])),
    lambda t, w: abs(w[0]) ** 3,
    # Not recordable.
    lambda t, w: w[0] if w[0] > 0.0 else -3.0 * w[0],
    lambda t, w: math.fabs(w[0]),
]


@pytest.mark.parametrize("function", STATES)
@pytest.mark.parametrize("tolerance", [1e-12, 1e-6])
def test_corners_are_where_omega_changes_sign(function: Any, tolerance: float) -> None:
    damped = Scene("", omega=BODY.omega, moments=(1.0, 2.0, 3.0), torque=damping(0.01))
    for scene, end in ((BODY, 20.0), (BODY, -20.0), (damped, 20.0)):
        roots = times_of(scene, end, lambda t, w: w[0], tolerance=tolerance)
        assert len(roots) >= 2
        found = times_of(scene, end, function, tolerance=tolerance)
        assert found == pytest.approx(roots, abs=1e-12)


@pytest.mark.parametrize(
    "function",
    [lambda t, w: abs(w[0]), lambda t, w: abs(w[0]) * (2.0 + w[1] / 4.0),
     lambda t, w: np.maximum(3.0 * w[0], -w[0])],
)  # fmt: skip
def test_corners_are_repeated_with_the_period(function: Any) -> None:
    roots = times_of(BODY, 3000.0, lambda t, w: w[0])
    assert times_of(BODY, 3000.0, function) == pytest.approx(roots, abs=3e-12)
    assert len(roots) > 400


def test_corners_are_events_without_a_direction() -> None:
    roots = times_of(BODY, 30.0, lambda t, w: w[0])
    for direction in (-1, 1):
        assert times_of(BODY, 30.0, with_attributes(lambda t, w: abs(w[0]), False, direction)) == []
    for count in (1, 3):
        found = solve(BODY, [0.5, 30.0], events=with_attributes(lambda t, w: abs(w[0]), count))
        assert events_of(found)[0][0] == pytest.approx(roots[:count], abs=1e-12)
        assert (found.ended, found.time.tolist()) == ("event", [0.5])
    touches = Event("", lambda t, w, q, rates: abs(w[0]), counts_touches=False)
    assert times_of(BODY, 30.0, touches) == []
    assert len(times_of(BODY, 30.0, flip(1))) == len(roots)


def test_no_corner_is_invented() -> None:
    nothing: list[Callable[[Any, Any], Any]] = [
        lambda t, w: abs(w[0]) + 1e-6,
        lambda t, w: np.maximum(w[0], -w[0]) + 1e-8,
        # A small value beside a jump.
        lambda t, w: np.where(t < 3.3, 1.0, t - 3.3 + 1e-8),
        lambda t, w: np.where(w[0] < 0.0, 0.4, w[0] + 1e-6),
    ]
    for function in nothing:
        assert times_of(BODY, 20.0, function) == []
    ball = Scene("ball", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=damping(1.0))
    for end in (20.0, 40.0, 300.0):
        assert times_of(ball, end, lambda t, w: abs(w[0])) == []
        assert times_of(ball, end, lambda t, w: np.maximum(w[0], w[0] ** 2)) == []
    # An interval of zeros about 0.5 s, however short, begins at its first end.
    law = TorqueLaw((-2.0, 0.0, 0.0))
    falling = Scene("", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=law)
    for dead in (0.25, 2e-3, 1e-5):
        found = times_of(falling, 2.0, lambda t, w, d=dead: np.maximum(abs(w[0]) - d, 0.0))
        assert found == pytest.approx([0.5 - 0.5 * dead], abs=1e-9)


@pytest.mark.parametrize("point", [0.0141, 0.3])
def test_rounding_errors_of_a_function_are_not_divided(point: float) -> None:
    count = 0

    def distance(t: Any, w: Any) -> Any:
        nonlocal count
        count += np.size(t)
        return abs(np.cos(t) - math.cos(point))

    assert times_of(BODY, 3.0, distance) == pytest.approx([point], abs=1e-13)
    assert count < 30_000
