"""States of the user's own: their sizes, error amplification, and steps."""

import cmath
import math
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, Stepper, solve
from tests.engine.test_own_states import MOMENTS, NAMES


def driven(
    rate: Any, x: Any = 0.0, omega: Any = (0.0, 0.0, 0.01), torque: Any = lambda w, x: (0, 0, 0)
) -> Scene:
    """Return a scene with a state x, its rate, a function of t, omega and x, and a torque."""

    def law(t: Any, w: Any, states: Any) -> Any:
        return torque(w, states["x"]), {"x": rate(t, w, states["x"])}

    return Scene("driven", omega, MOMENTS, torque=law, states={"x": x})


def test_size_of_a_state_does_not_matter() -> None:
    found = []
    for size in (1.0, 2.0**100, 2.0**-100):
        scene = driven(
            lambda t, w, x, size=size: size * (w[2] - x / size), 0.0, (0.1, 0.2, 1.0),
            lambda w, x, size=size: [0.0, 0.0, -x / size],
        )  # fmt: skip
        rows = solve(scene, np.linspace(0.0, 9.0, 10), tolerance=1e-9)
        found.append((rows.omega.tolist(), (rows.states["x"] / size).tolist(), rows.steps))
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("tolerance", [1e-3, 1e-8, 1e-9, 1e-12])
@pytest.mark.parametrize("start", [0.0, 1.7])
@pytest.mark.parametrize("power", [0, 6])
def test_a_state_that_begins_at_zero_has_a_size(tolerance: float, start: float, power: int) -> None:
    """The first step follows the omega, which is slow, and the guessed size of the state."""

    def rate(t: Any, w: Any, x: Any) -> Any:
        late = t - start if start else t
        fast = late**power * np.sin(90.0 * late)
        return np.where(t > start, fast, 0.0) if start else fast

    scene = driven(rate, torque=lambda w, x: (0.0, 0.0, 1e-9 * x))
    found: Any = solve(scene, [5.0], tolerance=tolerance)
    # The integral of s**n exp(90 i s), by parts.
    late, integral = 5.0 - start, 0j
    for k in range(power + 1):
        edge = late**k * cmath.exp(90j * late) - (k == 0)
        integral = (edge - k * integral) / 90j
    wanted = integral.imag
    size = max(late**power / 90.0, abs(wanted))
    assert found.ended in ("complete", "sensitive")
    assert found.states["x"][0] == pytest.approx(wanted, abs=tolerance * size)
    assert found.error < max(tolerance, 1e-12)


def test_a_guessed_size_does_not_shrink_with_rejected_steps() -> None:
    """The rates after the switch are rounded, the more so the nearer the step is to it."""

    def rate(t: Any, w: Any, x: Any) -> Any:
        late = t - 3.873697255942001
        return 3.1e7 * np.where(late > 0.0, late**6 * np.sin(212.0 * late), 0.0)

    scene = driven(rate, 0.0, (0.0, 0.0, 0.0126758), lambda w, x: (0.0, 0.0, 3e-11 * x))
    for tolerance in (1e-12, 1e-13, 3e-14):
        assert solve(scene, 5.559, tolerance=tolerance).ended in ("complete", "sensitive")


# Rate and value of a state; the terms are up to 1e30 times as large in the first step tried.
CANCELLING: dict[str, tuple[Any, Any]] = {
    "sine": (lambda t: 25.0 * np.sin(25.0 * t), lambda t: 1.0 - np.cos(25.0 * t)),
    "fast sine": (lambda t: 400.0 * np.sin(400.0 * t), lambda t: 1.0 - np.cos(400.0 * t)),
    "power": (lambda t: 31.0 * (1.0 - t) ** 30, lambda t: 1.0 - (1.0 - t) ** 31),
    "decay": (lambda t: np.exp(-90.0 * t), lambda t: -np.expm1(-90.0 * t) / 90.0),
    "to zero": (lambda t: 21.0 * (1.0 - t) ** 20, lambda t: 1.0 - (1.0 - t) ** 21),
    "rounded": (lambda t: 21.0 * (1.1 - t) ** 20, lambda t: 1.0 + 1.1**21 - (1.1 - t) ** 21),
}


@pytest.mark.parametrize("omega", [0.01, 1.0, 30.0])
@pytest.mark.parametrize("kind", CANCELLING)
def test_terms_of_a_state_that_cancel_shorten_the_step(kind: str, omega: float) -> None:
    rate, value = CANCELLING[kind]
    times = np.array([1.1, 2.2] if kind == "rounded" else [1.0, 2.0])
    scene = driven(lambda t, w, x: rate(t), value(0.0), (0.0, 0.0, omega))
    for tolerance in (1e-6, 1e-9, 1e-12, *[1e-13] * (kind in ("to zero", "rounded"))):
        found: Any = solve(scene, times, tolerance=tolerance)
        assert found.ended == "complete"
        assert found.states["x"] == pytest.approx(value(times), rel=max(tolerance, 4e-13))
        assert found.error < 0.1 * max(tolerance, 1e-12)


@pytest.mark.parametrize("power", [25, 26, 27])
def test_a_state_whose_first_terms_vanish_takes_few_steps(power: int) -> None:
    found = solve(driven(lambda t, w, x: t**power, 0.0, (0.1, 0.0, 0.0)), 1.0)
    assert found.states["x"][0] * (power + 1) == pytest.approx(1.0, abs=1e-9)
    assert found.steps < 40


def test_a_larger_scale_is_a_looser_tolerance() -> None:
    scenes = [driven(lambda t, w, x: np.sin(40.0 * t), x, (0, 0, 0.1)) for x in (0.0, (0.0, 1e6))]
    steps = [solve(scene, 9.0).steps for scene in scenes]
    assert steps[1] < 0.8 * steps[0]


def test_states_that_no_series_ends_are_told_with_their_time() -> None:
    found = solve(driven(lambda t, w, x: x**2, 0.5, (0.0, 0.0, 1.0)), [1.0, 3.0])
    assert found.ended == "overflow"
    assert found.states["x"] == pytest.approx([1.0], rel=1e-12)


@pytest.mark.parametrize("attitude", [False, True])
@pytest.mark.parametrize("unstable", range(8))
def test_growth_is_that_of_any_state(unstable: int, attitude: bool) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        rates = [-0.1 * x + 0.1 * omega[0] for x in states.values()]
        rates[unstable] = 0.5 * states[NAMES[unstable]]
        return [-0.1 * omega[0], 0.0, 0.0], rates

    scene = Scene("grows", (0.5, 0.0, 0.0), MOMENTS, torque=law, states=dict.fromkeys(NAMES, 1.0))
    found: Any = solve(scene, 10.0, tolerance=1e-9, attitude=attitude)
    assert math.exp(5.0) * 0.9 < found.growth < math.exp(5.0) * 20.0
    assert found.states[NAMES[unstable]][0] == pytest.approx(math.exp(5.0), rel=1e-9)


def test_rounding_that_grows_is_told() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": states["y"], "y": states["x"] - omega[2] * states["y"] * 0.0}

    # A saddle: the start is on the stable direction, and any error grows as exp(t).
    start = {"x": (1.0, 1.0), "y": (-1.0, 1.0)}
    scene = Scene("saddle", (0.0, 0.0, 0.1), MOMENTS, torque=law, states=start)
    found: Any = solve(scene, 32.0, tolerance=1e-9)
    assert found.ended == "sensitive"
    assert abs(found.states["x"][0] - math.exp(-32.0)) <= 100.0 * found.error


@pytest.mark.parametrize("attitude", [False, True])
def test_perturbations_of_states_that_rest_may_be_fast(attitude: bool) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        rates = [0.0 * x for x in states.values()]
        rates[6:] = [90.0 * states["h"], -90.0 * states["g"]]
        return [0.0, 0.0, -0.1 * omega[2]], rates

    states = dict.fromkeys(NAMES, (0.0, 1.0))
    scene = Scene("rests", (0.0, 0.0, 0.5), MOMENTS, torque=law, states=states)
    found: Any = solve(scene, 10.0, tolerance=1e-9, attitude=attitude)
    assert found.growth < 20.0
    assert found.ended == "complete"


def test_growth_counts_what_a_state_does_to_the_time_of_a_switch() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        rates = [0.0 * x for x in states.values()]
        # An error of h by d changes the time of the switch by d, and g by 10 d.
        rates[6:] = [np.where(states["h"] > 1.0, 5.0, -5.0), 1.0]
        return [0.0, 0.0, 0.0], rates

    scene = Scene("late", (0.0, 0.0, 0.5), MOMENTS, torque=law, states=dict.fromkeys(NAMES, 0.0))
    found = solve(scene, 2.0, tolerance=1e-9)
    assert found.growth == pytest.approx(math.hypot(1.0, 10.0 * 2.0 / 5.0), rel=0.01)
    assert found.states["g"] == pytest.approx([0.0], abs=1e-12)


@pytest.mark.parametrize("start", [0.0, 2.0])
def test_steps_are_as_short_as_a_fast_state_needs(start: float) -> None:
    scene = driven(lambda t, w, x: 40.0 * np.cos(40.0 * t), start)
    for tolerance in (1e-4, 1e-10):
        stepper = Stepper(scene, tolerance)
        while stepper.time < 3.0:
            stepper.step(3.0 - stepper.time)
            exact = start + math.sin(40.0 * stepper.time)
            allowed = 3.0 * tolerance * stepper.steps + 1e-13
            assert abs(stepper.states["x"] - exact) <= allowed
        assert stepper.steps < 150


@pytest.mark.parametrize("size", [1.0, 2.0**-300, 2.0**200])
def test_events_of_a_state_of_any_size(size: float) -> None:
    scene = driven(
        lambda t, w, x: size * w[2], 0.0, (0.0, 0.0, 1.0), lambda w, x: [0, 0, -2.0 * x / size]
    )
    found: Any = solve(scene, 10.0, events=lambda t, omega, states: states["x"] - 0.5 * size)
    frequency = math.sqrt(0.5)
    first = math.asin(0.5 * frequency) / frequency
    roots = [first, math.pi / frequency - first, first + 2.0 * math.pi / frequency]
    assert found.t_events[0] == pytest.approx(roots, rel=1e-12)


def test_a_constant_torque_keeps_the_states() -> None:
    scene = driven(lambda t, w, x: 1.0, 0.0, (0.0, 0.0, 0.0), lambda w, x: (0.2, 0.0, 0.0))
    found = solve(scene, 3.0)
    assert found.states["x"] == pytest.approx([3.0])
    assert found.omega[0] == pytest.approx([0.3, 0.0, 0.0])


@pytest.mark.parametrize(("rate", "start", "spin", "end"), [
    (lambda t, w, x: 0.0, 1e-9, 1.0, 500.0), (lambda t, w, x: 0.3, 0.0, 1000.0, 1.5),
    (lambda t, w, x: w[0], 0.0, 0.1, 500.0), (lambda t, w, x: w[0] - x, 0.0, 5.0, 50.0),
    (lambda t, w, x: -x, 1e-100, 1.0, 10.0),
])  # fmt: skip
def test_growth_is_not_that_of_the_size_of_a_state(
    rate: Any, start: float, spin: float, end: float
) -> None:
    scene = driven(rate, start, (0.0, 0.0, spin), lambda w, x: [-0.1 * w[0], -0.1 * w[1], 0.0])
    for tolerance in (1e-6, 1e-9, 1e-12):
        found: Any = solve(scene, end, tolerance=tolerance)
        assert found.ended == "complete"
        assert found.growth < 20.0
        assert found.error < tolerance


def test_the_first_step_from_0_is_as_short_as_a_very_fast_state_needs() -> None:
    stepper = Stepper(driven(lambda t, w, x: 4e6 * np.cos(4e6 * t)), 1e-12)
    stepper.step()
    assert abs(stepper.states["x"] - math.sin(4e6 * stepper.time)) < 1e-11


def test_the_size_of_a_state_is_the_largest_so_far() -> None:
    stepper, ends = Stepper(driven(lambda t, w, x: -2.0 * x, 1.0), 1e-6), [0.0]
    while stepper.time < 20.0:
        stepper.step()
        ends.append(stepper.time)
    assert ends[-1] - ends[-2] > 1.5 * ends[1]
