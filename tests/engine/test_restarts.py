"""Integrations that start on a root of an event: it is inactive until its function has left 0."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, solve
from pyharness.events import Event, crosses, extremum, flip, tilt
from pyharness.torques import damping, pulses

BODY = Scene("body", omega=(0.1, 1.0, 0.1), moments=(1.0, 2.0, 3.0))
BALL = Scene("ball", (0.0, 0.0, 1.0), moments=(1.0, 1.0, 1.0))
TOLERANCES = 1e-13, 1e-12, 1e-9, 1e-6, 1e-3
# Make an event from the time (s) at which the integration starts, and the attribute `terminal`.
Maker = Callable[[float, Any], Any]


@dataclass(frozen=True)
class Motion:
    """A scene, the end of its integration (s), and options of `solve`."""

    scene: Scene
    end: float
    options: dict[str, Any]

    def events(self, make: Maker) -> Any:
        """Return the events that one integration lists."""
        found: Any = solve(self.scene, self.end, events=make(0.0, False), **self.options)
        return found.t_events[0]

    def phases(self, make: Maker, count: int, most: int) -> list[float]:
        """Return the events up to each terminal one, the `count`-th, from whose state it continues.

        End after `most` events.
        """
        scene, begin, seen = self.scene, 0.0, list[float]()
        while len(seen) < most and begin != self.end:
            rest = self.end - begin
            found: Any = solve(scene, rest, events=make(begin, count), **self.options)
            seen += (begin + found.t_events[0]).tolist()
            if found.status != 1:
                break
            begin = seen[-1]
            state = found.y_events[0][-1]
            scene = replace(scene, omega=state[:3], attitude=tuple(state[3:]) or None)
        return seen


def random_motion(source: np.random.Generator) -> Motion:
    moments = tuple(np.sort(source.uniform(1.0, 2.0, 3)).tolist())
    omega = source.normal(size=3) * 10.0 ** source.uniform(-2.0, 2.0)
    size = float(np.abs(omega).max())
    torque: Any = (
        TorqueLaw(), TorqueLaw(tuple(0.1 * size**2 * source.normal(size=3))),
        damping(0.05 * source.random() * size),
    )[source.integers(3)]  # fmt: skip
    scene = Scene("", tuple(omega), moments=moments, torque=torque)
    end = float(source.choice([-1.0, 1.0]) * source.uniform(5.0, 40.0) / size)
    options: dict[str, Any] = {"tolerance": float(source.choice(TOLERANCES))}
    options["method"] = str(source.choice(["auto", "taylor"]))
    options["attitude"] = bool(source.random() < 0.3)
    if isinstance(torque, TorqueLaw) and source.random() < 0.2:
        scene = replace(scene, step_size=0.05 / size)
        options = {"method": "rk4", "attitude": False}
    return Motion(scene, end, options)


def random_event(source: np.random.Generator, motion: Motion) -> Maker:
    k, direction = int(source.integers(3)), int(source.choice([-1, 0, 1]))
    size = max(map(abs, motion.scene.omega))
    level = float(solve(motion.scene, source.uniform(0.1, 0.9) * motion.end).omega[0, k])
    rate, shift = size * source.uniform(0.5, 3.0), source.uniform(0.0, 9.0)
    toward, angle = source.normal(size=3).tolist(), source.uniform(0.3, 2.8)

    def at_extremum() -> Maker:
        found: Any = solve(motion.scene, motion.end, events=extremum(k + 1))
        top = float(found.y_events[0][-1, k]) if len(found.y_events[0]) else level
        return lambda begin, terminal: crosses(k + 1, top, terminal=terminal, direction=direction)

    def made(function: Callable[[Any, Any], Any]) -> Maker:
        return lambda begin, terminal: Event(
            "", lambda t, w, q, rates: function(t + begin, w), terminal, direction
        )

    makers = [
        lambda: made(lambda t, w: w[k] - level),
        lambda: made(lambda t, w: (w[k] - level) * (1.0 + (w[0] / size) ** 2)),
        lambda: made(lambda t, w: np.where(w[k] > level, 1.0, -1.0)),
        lambda: made(lambda t, w: np.sin(rate * t + shift)),
        lambda: made(lambda t, w: np.sin(rate * t + shift) ** 2),
        lambda: made(lambda t, w: w[k] - 0.5 * size * np.sin(rate * t + shift)),
        lambda: lambda begin, terminal: extremum(k + 1, terminal=terminal, direction=direction),
        at_extremum,
    ]
    if motion.options["attitude"]:
        makers.append(
            lambda: (
                lambda begin, terminal: tilt(
                    k + 1, toward, angle, terminal=terminal, direction=direction
                )
            )
        )
    return makers[source.integers(len(makers))]()


def compare_phases(seed: int) -> int:
    source = np.random.default_rng([20261203, seed])
    motion = random_motion(source)
    make = random_event(source, motion)
    whole = motion.events(make)
    seen = motion.phases(make, int(source.choice([1, 1, 3])), len(whole) + 3)
    error = 1e-7 + 1e3 * motion.options.get("tolerance", 0.0)
    assert seen == pytest.approx(whole.tolist(), rel=0.0, abs=error * abs(motion.end)), seed
    return len(whole)


@pytest.mark.parametrize("first", range(0, 60, 4))
def test_phases_have_the_events_of_one_integration(first: int) -> None:
    assert sum(compare_phases(seed) for seed in range(first, first + 4)) > 0


@pytest.mark.campaign
def test_many_phases_have_the_events_of_one_integration() -> None:
    assert sum(compare_phases(seed) for seed in range(1000, 1400)) > 1000


@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("end", [60.0, -60.0])
def test_phases_of_zeros_of_omega(direction: int, end: float) -> None:
    motion = Motion(BODY, end, {})
    whole = motion.events(lambda begin, terminal: flip(1, direction=direction))
    assert len(whole) >= 2
    seen = motion.phases(
        lambda begin, terminal: flip(1, terminal=terminal, direction=direction), 1, 99
    )
    assert seen == pytest.approx(whole.tolist(), abs=1e-6)


@pytest.mark.parametrize("tolerance", [1e-13, 1e-9])
def test_late_phases_of_a_free_body_have_the_events_of_one_integration(tolerance: float) -> None:
    fast = replace(BODY, omega=(1.0, 10.0, 1.0))

    def jump(begin: float, terminal: Any) -> Event:
        return Event("", lambda t, w, q, rates: np.where(w[0] > 0.3, 1.0, -1.0), terminal)

    makers: list[tuple[float, Maker]] = [
        (1e4, lambda begin, terminal: crosses(1, 0.3, terminal=terminal)), (30.0, jump),
    ]  # fmt: skip
    for end, make in makers:
        motion = Motion(fast, end, {"tolerance": tolerance})
        whole = motion.events(make)
        seen = motion.phases(make, len(whole) // 2, len(whole) + 3)
        np.testing.assert_allclose(seen, whole, rtol=0.0, atol=1e-9 * end)


@pytest.mark.parametrize("function", [
    lambda t: 0.0 * t,
    lambda t: t,
    lambda t: t**2,
    lambda t: -(t**3),
    lambda t: np.sin(t) ** 3,
    lambda t: t - 1e-17,
    lambda t: np.sin(math.pi + t),
    lambda t: np.where(np.abs(t) < 1.0, 0.0, t),
    lambda t: np.where(np.abs(t) < 1.0, 0.0, np.abs(t)),
    lambda t: np.where(t < 1.0, 0.0, np.cos(t)),
])  # fmt: skip
@pytest.mark.parametrize("ends", [1.5, -1.5, [-1.5, 1.5]])
def test_a_root_at_the_start_is_no_event(function: Callable[[Any], Any], ends: Any) -> None:
    for direction in (-1, 0, 1):
        event = Event("", lambda t, w, q, rates: function(t), True, direction)
        found: Any = solve(BODY, ends, events=event)
        assert found.t_events[0].size == 0
        assert found.status == 0


def test_the_error_of_a_state_may_delay_the_root_at_the_start() -> None:
    """The state may be that at a root, but for an error of 1e-10 of the largest component."""
    for off in (-3e-11, -1e-15, 1e-15, 3e-11):
        start = replace(BODY, omega=(0.5, 1.0, off))
        for end in (1.0, -1.0):
            found: Any = solve(start, end, events=[flip(3), crosses(3, terminal=True)])
            assert (found.status, np.concatenate(found.t_events).size) == (0, 0)
    # A larger distance is none of the error.
    start = replace(BODY, omega=(0.5, 1.0, -1e-8))
    found = solve(start, [-1.0, 1.0], events=flip(3))
    assert len(found.t_events[0]) == 1


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("gap", "power"), [(1e-6, 1), (1e-4, 1), (1e-2, 1), (1e-3, 2), (1e-2, 3)])
@pytest.mark.parametrize("start", [0.0, 0.5])
def test_a_root_near_the_start_is_found(sign: float, gap: float, power: int, start: float) -> None:
    def function(t: Any, omega: Any) -> Any:
        return (t - sign * start * gap) ** power * (t - sign * gap)

    found: Any = solve(BODY, sign, events=function).t_events
    expected = [gap] if start == 0.0 else [0.5 * gap, gap]
    assert sign * found[0] == pytest.approx(expected, rel=1e-3 if power > 1 else 1e-8)


def test_an_interval_of_zeros_is_entered_once() -> None:
    # Omega rises from 1 s to 1 in 2 s, and falls from 3 s to 0 in 4 s, for a second.
    push = pulses([1.0, 3.0, 5.0], [1.0] * 3, [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    scene = replace(BALL, omega=(0.0, 0.0, 0.0), torque=push)
    found: Any = solve(scene, 9.0, events=[crosses(1), crosses(1, 1.0)]).t_events
    assert found[0] == pytest.approx([4.0])
    assert found[1] == pytest.approx([2.0, 6.0])
    for middle, expected in ((0.5, []), (2.5, [1.5]), (1.0, [])):

        def outside(t: Any, omega: Any, middle: float = middle) -> Any:
            return np.maximum(np.abs(t - middle) - 1.0, 0.0)

        found = solve(BALL, 6.0, events=outside).t_events
        assert found[0] == pytest.approx(expected)
