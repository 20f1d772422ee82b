"""Roots by compiled code are those of the general search, to which all other roots are left."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, solve
from pyharness.engine.events import events
from pyharness.engine.events.event_functions import EventFunction, event_functions
from pyharness.engine.events.event_search import distinct_roots

Function = Callable[..., Any]
BODY = Scene(
    omega=(1.0, 0.5, 0.3),
    moments=(0.7, 0.9, 1.3),
    torque=lambda t, w, q: -0.3 * q[1:] - 0.1 * w + 0.05 * np.cos(3.0 * t),
    attitude=(1.0, 0.0, 0.0, 0.0),
)
SMOOTH: list[Function] = [
    lambda t, w: w[0] - 0.02,
    lambda t, w: np.sin(3.0 * t) * w[1] - 0.01,
    lambda t, w: np.exp(w[2]) / (1.5 + w[0]) - 0.7,
    lambda t, w: np.tanh(4.0 * w[0]) * np.sqrt(2.0 + w[1]) - 0.05,
    lambda t, w: np.arctan(w[0]) + np.log(2.0 + w[1]) - 0.69,
    lambda t, w, q: 0.9 - 2.0 * (q[1] ** 2 + q[2] ** 2),
    lambda t, w, q: (t - 3.0) * (q[0] - 0.8),
]
UNCLEAR: dict[str, Function] = {
    "double": lambda t, w: (t - 3.0) ** 2,
    "nearly double": lambda t, w: (t - 3.0) ** 2 - 1e-14,
    "triple": lambda t, w: (t - 3.0) ** 3,
    "at the start": lambda t, w: w[0] - 1.0,
    "at the end": lambda t, w: t - 20.0,
    "zero": lambda t, w: 0.0 * w[0],
    "corner": lambda t, w: abs(w[0]),
    "jump": lambda t, w: np.floor(t) - 2.5,
    "branch": lambda t, w: np.where(t < 5.0, w[0], w[1]),
    "unrecorded": lambda t, w: float(w[0]),
}


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[bool]]:
    """Compare roots with those of the general search; list whether that was needed."""
    needed: list[bool] = []

    def compared(g: EventFunction, solution: Any) -> Any:
        found = distinct_roots(g, solution)
        needed.append(found is None)
        if found is not None:
            expected = events._all_roots(g, solution)
            apart = 2.0 * found.noise / np.abs(found.slope) + 8.0 * np.spacing(np.abs(found.time))
            assert found.change.tolist() == expected.change.tolist()
            assert (np.abs(found.time - expected.time) <= apart).all()
        return found

    monkeypatch.setattr(events, "distinct_roots", compared)
    yield needed
    assert needed


def test_smooth_functions(both: list[bool]) -> None:
    found = solve(BODY, [-7.0, 20.0], events=SMOOTH)
    assert found.t_events is not None
    assert all(len(times) > 1 for times in found.t_events)
    assert not any(both)


def test_random_levels(both: list[bool]) -> None:
    rng = np.random.default_rng(20261130)
    for level in rng.uniform(-0.3, 0.3, 12).tolist():
        functions: list[Function] = [
            lambda t, w, level=level: w[1] - level,
            lambda t, w, q, level=level: q[1] * q[2] - level,
        ]
        solve(BODY, float(rng.choice([-15.0, 15.0])), events=functions)
    assert sum(both) < 4


def test_own_states(both: list[bool]) -> None:
    scene = Scene(
        omega=(1.0, 0.5, 0.3),
        moments=(0.7, 0.9, 1.3),
        torque=lambda t, w, s: ((1e-4 * s["x"], 0.0, 0.0), {"x": 1e3 * (w[1] - 1e-3 * s["x"])}),
        states={"x": 0.2},
    )
    found = solve(scene, 8.0, events=lambda t, w, s: s["x"] - 100.0)
    assert found.t_events is not None
    assert found.t_events[0].size
    assert not any(both)


@pytest.mark.parametrize("name", UNCLEAR)
def test_what_is_not_clear_is_left(both: list[bool], name: str) -> None:
    solve(BODY, 20.0, events=UNCLEAR[name])
    assert all(both)


def test_a_function_that_changes_is_not_recorded() -> None:
    calls: list[float] = []

    def changing(t: Any, w: Any) -> Any:
        calls.append(0.0)
        return w[0] - 0.01 * len(calls)

    (g,) = event_functions(changing, attitude=False)
    assert g.tape(3) is not None
    assert not g.is_tape(np.arange(3.0), np.ones((3, 3)))
    assert g.tape(3) is None
