"""Sensitivities through switches, and with states of one's own, against closed forms."""

import math
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import InputError, Scene, solve, solve_many
from tests.refused import refused

MOMENTS = (2.0, 3.0, 4.0)


def brake(t: Any, omega: Any, *, strong: float = 0.2, weak: float = 0.02) -> Any:
    """Return a torque that jumps where omega3 is 0.3 rad/s."""
    return [0.0, 0.0, -np.where(omega[2] > 0.3, strong, weak)]


@pytest.mark.parametrize("reverse", [1, -1])
def test_derivatives_through_a_jump_are_those_of_the_closed_form(reverse: int) -> None:
    scene = Scene("brake", (0.0, 0.0, 0.8), MOMENTS, torque=brake)
    names = ["omega", "torque.strong", "torque.weak", "moments"]
    times = np.array([5.0, 12.0, 20.0])[::reverse]
    found: Any = solve(scene, times, sensitivities=names)
    crossing = 0.5 * 4.0 / 0.2
    late = times > crossing
    # Later omega3 is 0.3 - weak (t - 2/strong)/I3, where the 2 is I3 (omega3(0) - 0.3).
    expected = {
        "omega": np.where(late, 0.02 / 0.2, 1.0),
        "torque.strong": np.where(late, -0.02 * 0.5 / 0.2**2, -times / 4.0),
        "torque.weak": np.where(late, -(times - crossing) / 4.0, 0.0),
        "moments": np.where(late, 0.02 * times / 16.0, 0.2 * times / 16.0),
    }
    for name, values in expected.items():
        own = found.sensitivities[name][:, 2, -1]
        assert np.abs(own - values).max() <= 1e-10 * max(1.0, np.abs(values).max()), name


def saturated(t: Any, omega: Any, *, gain: float = 2.0) -> Any:
    return [0.0, 0.0, np.clip(-gain * omega[2], -0.5, 0.5)]


def by_gain() -> float:
    """Return the derivative of omega3 at 9 s by the gain of a saturated law, of forty digits."""
    with mpmath.workdps(40):

        def omega(gain: Any) -> Any:
            # Saturated until omega3 is 0.5/gain; then it decays.
            leaves = (1 - mpmath.mpf("0.5") / gain) * 8
            return mpmath.mpf("0.5") / gain * mpmath.exp(-gain / 4 * (9 - leaves))

        return float(mpmath.diff(omega, mpmath.mpf(2)))


def spring(t: Any, omega: Any, states: Any) -> Any:
    return [0.0, 0.0, -2.0 * states["turned"]], {"turned": omega[2]}


def turned(by: str) -> Any:
    """Return the derivatives of a spring's angle at 1 and 4 s; the frequency is sqrt(2/I3)."""
    times, frequency = np.array([1.0, 4.0]), math.sqrt(0.5)
    if by == "omega":
        return np.sin(frequency * times) / frequency
    angles = np.cos(frequency * times) * times / frequency - np.sin(frequency * times) / 0.5
    return angles * -frequency / 8.0


def test_motions_that_end_before_the_first_time_have_no_rows() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [states["x"], 0.0, 0.0], {"x": 1.0 + states["x"] ** 2}  # x is tan t

    scene = Scene("ends", (0.1, 0.2, 0.3), MOMENTS, torque=law, states={"x": 0.0})
    for times, rows in ([2.0], 0), ([-2.0], 0), ([1.0, 2.0], 1):
        found: Any = solve(scene, times, sensitivities=["omega", "moments"])
        assert [each.shape for each in found.sensitivities.values()] == [(rows, 4, 3)] * 2


@pytest.mark.parametrize("name", ["omega", "attitude", "moments", "inertia", "torque.gain"])
def test_differences_are_the_derivatives_where_no_switch_changes(name: str) -> None:
    def law(t: Any, omega: Any, q: Any, *, gain: float = 0.3) -> Any:
        return -gain * omega - 0.4 * q[1:]

    def switched(t: Any, omega: Any, q: Any, *, gain: float = 0.3) -> Any:
        return -gain * omega - 0.4 * q[1:] + np.where(t > 100.0, 1.0, 0.0)

    inertia = [[3.0, 0.2, 0.1], [0.2, 2.0, -0.1], [0.1, -0.1, 1.5]]
    body: dict[str, Any] = {"inertia": inertia} if name == "inertia" else {"moments": MOMENTS}
    found: Any = [
        solve(
            Scene("alike", (0.5, -0.3, 0.8), torque=torque, **body), [1.0, 6.0],
            attitude=True, sensitivities=[name],
        ).sensitivities
        for torque in (law, switched)
    ]  # fmt: skip
    assert np.abs(found[0][name] - found[1][name]).max() <= 1e-9 * np.abs(found[0][name]).max()


def test_elements_off_the_diagonal_change_by_the_size_of_the_body() -> None:
    """In a rotated cube they are rounding errors."""
    turn, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))
    cube = 2.0 * turn @ turn.T
    rotated, known = (
        Scene("", (0.5, -0.3, 0.8), inertia=inertia, torque=brake)
        for inertia in (0.5 * (cube + cube.T), 2.0 * np.eye(3))
    )
    slopes: list[Any] = [
        solve(scene, 1.0, tolerance=1e-12, sensitivities=["inertia"]).sensitivities
        for scene in (rotated, known)
    ]
    assert slopes[0]["inertia"] == pytest.approx(slopes[1]["inertia"], rel=1e-9, abs=1e-9)


def test_what_has_no_influence_has_a_derivative_of_zero() -> None:
    def law(t: Any, omega: Any, *, unused: float = 0.3) -> Any:
        return [0.0, 0.0, np.where(t > 50.0, unused, 0.1)]

    scene = Scene("unused", (0.5, -0.3, 0.8), MOMENTS, torque=law)
    found: Any = solve(scene, 3.0, sensitivities=["torque.unused"])
    assert np.abs(found.sensitivities["torque.unused"]).max() < 1e-9


def test_a_switch_that_is_only_touched_is_refused() -> None:
    def law(t: Any, omega: Any, *, push: float = 0.5) -> Any:
        # omega3 has its maximum 1 at t = 2 s.
        return [0.0, 0.0, np.where(omega[2] > 1.0, 4.0, push * (2.0 - t))]

    scene = Scene("touch", (0.0, 0.0, 0.75), MOMENTS, torque=law)
    words = r"does not depend smoothly on torque\.push"
    refused(words, solve, scene, 5.0, sensitivities=["torque.push"])


def test_the_work_limit_is_named() -> None:
    scene = Scene("brake", (0.1, 0.2, 0.8), MOMENTS, torque=brake)
    limited: dict[str, Any] = {"times": [20.0], "tolerance": 1e-2, "effort": 2.3e-6}
    assert solve(scene, **limited).steps
    words = r"^sensitivities: taylor .* work limit"
    refused(words, solve, scene, **limited, sensitivities=["torque.weak"])


def test_a_smaller_change_may_keep_the_work_limit() -> None:
    def law(t: Any, w: Any, *, k: float = 1.0) -> Any:
        return -w * np.exp(1200.0 * (k - 1.0)) + np.where(t > 0.5, 0.0, 0.001)

    scene = Scene("stiff", (0.1, 0.2, 0.8), MOMENTS, torque=law)
    found: Any = solve(scene, [1.0], sensitivities=["torque.k"])
    assert np.isfinite(found.sensitivities["torque.k"]).all()


def test_bodies_have_them_too() -> None:
    scene = Scene("brake", (0.0, 0.0, 0.8), MOMENTS, torque=brake)
    found: Any = solve_many(scene, 20.0, omega=[(0, 0, 0.8), (0, 0, 0.7)], sensitivities=["omega"])
    assert found.sensitivities["omega"][:, 2, 2] == pytest.approx([0.1, 0.1], rel=1e-9)


def pushed(t: Any, omega: Any, *, ts: float = 0.7) -> Any:
    return [0.0, 0.0, np.where(t > ts, 4.0, 0.0)]


def angular(t: Any, omega: Any, states: Any) -> Any:
    return [0.0, 0.0, np.where(states["angle"] > 0.56, 2.0, 0.0)], {"angle": omega[2]}


def steered(t: Any, omega: Any, q: Any) -> Any:
    return [0.0, 0.0, np.where(q[3] > np.sin(0.28), 2.0, 0.0)]


def reversed_push(t: Any, omega: Any, *, ts: float = 0.7) -> Any:
    return pushed(-t, omega, ts=ts)


# The torque, other arguments of the scene and of `solve`, the parameter, and the row at the switch.
AT_SWITCHES: dict[str, Any] = {
    "time": (pushed, {}, {"times": [0.7, 2.0]}, "torque.ts", 0.7),
    "before time 0": (reversed_push, {}, {"times": [-2.0, -0.7, 0.0, 1.0]}, "torque.ts", -0.7),
    "omega": (brake, {}, {"times": [9.0, 10.0, 11.0]}, "omega", 10.0),
    "moments": (brake, {}, {"times": 10.0}, "moments", 10.0),
    "own states": (angular, {"states": {"angle": 0.0}}, {"times": [0.7, 2.0]}, "omega", 0.7),
    "attitude": (steered, {}, {"times": 0.7, "attitude": True}, "attitude", 0.7),
    "start": (brake, {"omega": (0.0, 0.0, 0.3)}, {"times": [0.0, 5.0]}, "omega", 5.0),
}  # fmt: skip


@pytest.mark.parametrize("kind", AT_SWITCHES)
def test_a_row_with_two_derivatives_is_refused(kind: str) -> None:
    torque, more, how, name, at = AT_SWITCHES[kind]
    scene = Scene(kind, **{"omega": (0.0, 0.0, 0.8), "moments": MOMENTS, "torque": torque} | more)
    words = rf"^sensitivities: at t = {at:g} s .* by {name}, .*other"
    refused(words, solve, scene, sensitivities=[name], **how)


def test_near_a_switch_a_derivative_is_right_or_refused() -> None:
    """At a switch the derivative by its time jumps from 0 to -1."""
    scene, refused = Scene("near", (0.0, 0.0, 0.8), MOMENTS, torque=pushed), []
    for exponent in range(-16, 0):
        for side in -1.0, 1.0:
            t = 0.7 + side * 10.0**exponent
            try:
                found: Any = solve(scene, t, sensitivities=["torque.ts"]).sensitivities
            except InputError:
                refused.append(exponent)
            else:
                assert found["torque.ts"][0, 2] == pytest.approx(-(t > 0.7), abs=1e-7), t
    assert -16 in refused
    assert max(refused) < -4


XS, YS = [0.0, 0.5, 1.0, 1.5], [0.0, 1.0, 0.0, 2.0]
# Torques that are continuous, but have a kink where the first row or the motion's start is.
# Torque, other arguments of the scene, times, parameter, the derivatives of omega3 or of the own
# state by it, and their relative and absolute error.
DERIVATIVES: dict[str, Any] = {
    "saturated": (saturated, {}, 9.0, "torque.gain", by_gain(), (1e-9, 0.0)),
    **{
        f"own state by {name}": (
            spring, {"states": {"turned": 0.0}, "attitude": (1, 0, 0, 0)}, [1.0, 4.0], name,
            turned(name), (1e-9, 0.0),
        )
        for name in ("omega", "moments")
    },
    "switch without influence": (
        brake, {"omega": (0.0, 0.0, 0.8)}, [10.0, 12.0], "torque.weak", [0.0, -0.5], (1e-9, 1e-12)
    ),
    "switch at a fixed time": (
        pushed, {"omega": (0.0, 0.0, 0.8)}, [-0.7, 0.0, 0.7], "omega", [1.0] * 3, (1e-9, 0.0)
    ),
    # Torques that are continuous, but have a kink where the first row or the motion's start is.
    "clip": (
        lambda t, w, *, k=4.0: -np.clip(k * w, -2.0, 2.0), {}, [1.0, 3.0], "torque.k",
        [0.0, -0.25 * np.exp(-2.0)], (1e-8, 1e-8),
    ),
    "table of time": (
        lambda t, w, *, ts=0.5: [0.0, 0.0, 4.0 * np.interp(t - ts, XS, YS)], {}, [1.0, 1.5],
        "torque.ts", [-1.0, 0.0], (1e-8, 1e-8),
    ),
    "table of omega": (
        lambda t, w: [0.0, 0.0, -2.0 * np.interp(w[2], XS, YS) - 0.4], {}, [1.0, 1.5], "omega",
        np.exp([1.0, 1.5]), (1e-8, 1e-8),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", DERIVATIVES)
def test_derivatives_are_those_of_closed_forms(kind: str) -> None:
    torque, more, times, name, expected, (rel, own) = DERIVATIVES[kind]
    scene = Scene(kind, **{"omega": (0.0, 0.0, 1.0), "moments": MOMENTS, "torque": torque} | more)
    slopes: Any = solve(scene, times, sensitivities=[name]).sensitivities
    row = 7 if scene.states else 2
    assert slopes[name][:, row, -1] == pytest.approx(expected, rel=rel, abs=own)


def test_bodies_with_a_row_at_a_switch_are_refused_alone() -> None:
    scene = Scene("brake", (0.0, 0.0, 0.8), MOMENTS, torque=brake)
    asked: dict[str, Any] = {"sensitivities": ["omega"], "parameters": {"strong": [0.1, 0.2, 0.3]}}
    found: Any = solve_many(scene, 10.0, **asked)
    assert list(found.refusals) == [1]
    assert "at t = 10 s" in found.refusals[1]
    assert found.sensitivities["omega"][[0, 2], 2, 2] == pytest.approx([1.0, 0.02 / 0.3])
