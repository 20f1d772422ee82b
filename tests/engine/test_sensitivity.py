"""Error amplification, estimated errors, and the ending `sensitive`."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, solve, solve_many
from pyharness.engine.methods import linearised
from pyharness.engine.methods.sensitivity import closed_form_estimate, motion_growth
from pyharness.engine.problem.rescaled import scaled
from pyharness.model.scene import Triple
from pyharness.torques import damping

BESIDE = Scene("beside the middle axis", (1e-4, 2.0, 1e-4), moments=(3.0, 2.0, 1.2))
AT_REST = Scene("", (0.0, 0.0, 0.0), moments=(3.0, 2.0, 1.2))
PUSHED = case_scene(5)
RUNAWAY = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
SPHERE = Scene("", (1.0, 2.0, 3.0), moments=(2.0,) * 3, torque=TorqueLaw((1.0, 0.0, 0.0)))


def _along(scene: Scene, time: float) -> float:
    """Return the amplification by the linearised flow along the closed form."""
    times = np.linspace(0.0, time, 6000)
    omega = np.vstack([scene.omega, solve(scene, times[1:].tolist(), "closed-form", 1e-9).omega])
    return linearised.growth(linearised.propagators(scene, times, omega))


@pytest.mark.parametrize("time", [0.5, 3.0, -3.0, 30.0, -100.0])
@pytest.mark.parametrize("scene", [case_scene(2), case_scene(3), case_scene(4), BESIDE])
def test_growth_is_that_of_the_linearised_flow(scene: Scene, time: float) -> None:
    """Sampled at sixteen times: the largest value between them is at worst three times as large."""
    ratio = (motion_growth(scene, time) or 0.0) / _along(scene, time)
    assert 1.0 / 3.0 <= ratio <= 1.3


def test_growth_of_a_spin_about_the_middle_axis_is_that_of_what_leaves_it() -> None:
    scene = replace(BESIDE, omega=(0.0, 2.0, 0.0))
    a, _, c = scene.euler_coefficients
    rate = 2.0 * math.sqrt(abs(a * c))
    grown = math.cosh(10.0 * rate) * (1.0 + max(abs(a / c), abs(c / a)) ** 0.5)
    assert 0.3 * grown <= (motion_growth(scene, 10.0) or 0.0) <= 1.01 * grown
    # This is how far a perturbation of 2**-48 can grow.
    assert 2.0**46 <= (motion_growth(scene, 200.0) or 0.0) <= 2.0**51


def _rising(time: float, omega: np.ndarray) -> list[float]:
    quick = 0.0168 * time * omega[1] * (omega @ omega) - 0.05 * omega[0]
    return [0.005 + quick, 0.0, 0.074 + 0.124 * omega[2]]


def _spiky(_: float, omega: np.ndarray) -> list[float]:
    return [0.27 * omega[1] * (omega @ omega) - 0.05 * omega[0], 0.0, 0.074 + 0.124 * omega[2]]


@pytest.mark.parametrize(
    ("torque", "time", "least_steps"), [(_rising, 19.0, 8000), (_spiky, 3.0, 900)]
)
def test_growth_of_many_steps_is_that_of_a_perturbed_motion(
    torque: Callable[..., list[float]], time: float, least_steps: int
) -> None:
    """An error of a thousandth in each step hides five sixths of it, or invents a hundredfold."""
    ends = []
    for beside in (0.0, 1e-8):
        scene = Scene("violent", (-0.1, -3.8, 7.7 + beside), (1.0, 2.0, 2.5), torque=torque)
        ends.append(solve(scene, time, tolerance=1e-11))
    reached = float(np.abs(ends[1].omega[-1] - ends[0].omega[-1]).max()) / 1e-8
    assert ends[0].steps > least_steps
    assert 0.9 * reached <= (ends[0].growth or 0.0) <= 20.0 * reached


def at_rest(torque: Any, third: float = 3.0) -> Scene:
    """Return a body at rest, of which perturbations are relative to no omega."""
    return Scene("", (0, 0, 0), (1.0, 2.0, third), attitude=(1, 0, 0, 0), torque=torque)


def test_a_body_at_rest_under_control_waits_for_a_push() -> None:
    def torque(time: Any, omega: Any, q: Any) -> list[Any]:
        push = np.where(time > 5.0, 1.0, 0.0)
        return [push - q[0] * q[1] - omega[0], -q[0] * q[2] - omega[1], -q[0] * q[3] - omega[2]]

    found = solve(at_rest(torque), 20.0)
    assert found.ended == "complete"
    assert found.steps < 400


@pytest.mark.parametrize("push", [
    lambda t: np.where(t > 20.0, 1.0, 0.0), lambda t: np.exp(-3.0 * (t - 20.0) ** 2),
    lambda t: 1.0 + np.tanh(8.0 * (t - 20.0)),
])  # fmt: skip
def test_a_body_at_rest_waits_for_a_push_without_damping(push: Callable[[Any], Any]) -> None:
    scene = at_rest(lambda t, w, q: [0.1 * push(t) - q[1], -q[2], -q[3]])
    found, truth = (solve(scene, 30.0, tolerance=tolerance) for tolerance in (1e-9, 1e-12))
    assert found.ended == "complete"
    assert found.steps < 300
    assert np.abs(found.omega - truth.omega).max() <= 1e-9 * np.abs(truth.omega).max()


@pytest.mark.parametrize(("swing", "damping"), [(0.0, 0.0), (0.0, 0.2), (0.3, 0.2)])
def test_a_body_that_control_keeps_at_rest_is_complete(swing: float, damping: float) -> None:
    """Relative to its omega, which is 0, any perturbation would be infinite."""

    def torque(time: Any, omega: Any, q: Any) -> list[Any]:
        gain = 0.5 + swing * np.cos(20.0 * time)
        return [-gain * q[1 + i] - damping * omega[i] for i in range(3)]

    found = solve(at_rest(torque, 2.5), 50.0)
    assert found.ended == "complete"
    assert 1.0 <= (found.growth or 0.0) < 100.0


@pytest.mark.parametrize(("push", "impulse"), [
    (lambda t: t**6 / (1.0 + t**6), 1.953624981341453),
    (lambda t: 1.0 - np.exp(-(t**12)), 2.041714317827167),
    (lambda t: np.sin(4.4 * t) ** 8, 0.781203549776875),
])  # fmt: skip
def test_a_push_that_begins_slowly_is_judged_by_the_omega_that_it_causes(
    push: Callable[[Any], Any], impulse: float
) -> None:
    found = solve(at_rest(lambda t, w, q: [1e-9 * push(t), 0.0 * q[1], 0.0]), 3.0, tolerance=1e-9)
    assert found.ended == "complete"
    assert found.omega[0, 0] == pytest.approx(1e-9 * impulse, rel=2e-9, abs=0.0)


def coupled(function: Any, omega: Any, back: float = 1.0) -> Scene:
    """Return a body whose omega1 is pushed by omega2, and omega2 by omega1, as time goes."""
    return Scene("", omega, moments=(1.0, 2.0, 2.5), torque=lambda t, w: [
        function(t) * w[1], back * function(t) * w[0], 0.0])  # fmt: skip


@pytest.mark.parametrize("omega", [(0.0, 0.0, 1.0), (1e-9, 0.0, 1.0), (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("frequency", [3.0, 10.0, 100.0])
def test_growth_of_a_steady_motion_follows_a_torque_that_it_does_not_feel(
    omega: Triple, frequency: float
) -> None:
    scene = coupled(lambda t: 0.5 * np.cos(frequency * t), omega)
    found = solve(scene, 50.0)
    assert found.ended == "complete"
    assert found.growth == pytest.approx(1.1, abs=0.1)
    many: Any = solve_many(scene, 8.0, omega=[omega, (0.1, 0.2, 0.3)], estimates=True)
    assert (many.status == 0).all()
    assert many.growth[0] == pytest.approx(1.1, abs=0.1)


@pytest.mark.parametrize("function", [
    lambda t: np.cos(t) ** 20, lambda t: 0.4 * np.cos(5.0 * t) ** 13, lambda t: np.exp(-20.0 * t),
    lambda t: 1e-40 * np.cos(1e3 * t), lambda t: np.cos(10.0 * t * t),
    lambda t: 0.1 * sum(np.cos((1.0 + 0.1 * k) * t) for k in range(10)),
])  # fmt: skip
def test_a_steady_motion_takes_no_more_steps_than_another(function: Callable[[Any], Any]) -> None:
    steps = []
    for omega in [(0.0, 0.0, 1.0), (0.3, -0.5, 1.0)]:
        found = solve(coupled(lambda t: 0.5 * function(t), omega), 50.0)
        assert found.ended == "complete"
        steps.append(found.steps)
    assert steps[0] <= steps[1]


@pytest.mark.parametrize(("function", "coupling", "spin", "time", "wanted"), [
    (lambda t: 0.5 * np.cos(t) ** 20, 1.0, 1.0, 50.0, 1.42),
    (lambda t: 0.2 * np.cos(5.0 * t) ** 13, 0.0, 0.0, 20.0, 1.0),
])  # fmt: skip
def test_growth_of_a_steady_motion_follows_pulses(
    function: Callable[[Any], Any], coupling: float, spin: float, time: float, wanted: float
) -> None:
    """The amplification is that of the linear equations by DOP853, between 400 times."""
    found = solve(coupled(function, (0.0, 0.0, spin), coupling), time)
    assert found.ended == "complete"
    assert found.growth == pytest.approx(wanted, rel=0.2)


@pytest.mark.parametrize("aim", [0.02, -3.0, 0.0])
@pytest.mark.parametrize("is_switched", [False, True])
@pytest.mark.parametrize(("frequency", "time"), [(6.0, 60.0), (2.4, 315.0), (9.7, 102.0)])
def test_growth_of_a_motion_that_becomes_steady_follows_its_control(
    aim: float, is_switched: bool, frequency: float, time: float
) -> None:
    """The control amplifies no error, about any aim: the rate is a gain above 0 times the rest."""

    def rate(time: Any, value: Any) -> Any:
        found = (1.2 + np.cos(frequency * time)) * (aim - value)
        return np.where(value < aim - 0.5, 1.0, found) if is_switched else found

    def with_state(time: Any, omega: Any, states: Any) -> Any:
        return 0.0 * omega, {"x": rate(time, states["x"])}

    begin = aim - 0.7
    plain = Scene("", (0.0, 0.0, begin), (1.0, 2.0, 3.0), torque=lambda t, w: [
        0.0 * t, 0.0 * t, 3.0 * rate(t, w[2])])  # fmt: skip
    own = Scene("", (0.0, 0.0, 1.0), (1.0, 2.0, 3.0), states={"x": begin}, torque=with_state)
    for scene in (plain, own):
        found = solve(scene, time, tolerance=1e-9)
        assert found.ended == "complete"
        assert found.growth == pytest.approx(1.0, abs=0.01)
        assert found.y[-1, 0] == pytest.approx(aim, abs=1e-9)


@pytest.mark.parametrize("power", [-320, -299, -250, 250])
def test_growth_beside_the_attitude_has_no_unit(power: int) -> None:
    """Derivatives of the attitude by omega are as large as the unit of time."""
    unit, found = 2.0**power, []
    for each in (1.0, unit):
        omega = (0.3 * each, each, -0.4 * each)
        scene = Scene("", omega, moments=(1.0, 2.0, 2.5), torque=damping(0.3 * each))
        found.append(solve(scene, 3.0 / each, attitude=True))
    assert found[1].growth == pytest.approx(found[0].growth, rel=1e-12)


@pytest.mark.parametrize("power", [-900, -300, 1, 300, 900])
def test_growth_has_no_unit(power: int) -> None:
    factor = math.ldexp(1.0, power)
    assert motion_growth(scaled(BESIDE, factor), 7.0 / factor) == motion_growth(BESIDE, 7.0)


def test_growth_is_one_where_nothing_grows_and_unknown_where_no_method_tells() -> None:
    assert motion_growth(BESIDE, 0.0) == motion_growth(AT_REST, 5.0) == 1.0
    assert motion_growth(SPHERE, 1e6) == 1.0
    assert closed_form_estimate(RUNAWAY, (1.0, 1.0, 1.0), 0.5) == (None, None)
    # The solution grows without bound before the end.
    assert motion_growth(RUNAWAY, 2.0) is None


def test_growth_beside_a_state_that_stays_does_not_depend_on_its_axis() -> None:
    """The steps follow what a perturbation does, because the state has no terms."""
    found = set()
    for axis in range(3):

        def torque(t: Any, w: Any, axis: int = axis) -> Any:
            return [np.sin(w[i]) if i == axis else 0.0 for i in range(3)]

        still = Scene("", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=torque)
        run: Any = solve(still, [20.0], "taylor", 1e-10)
        assert run.growth == pytest.approx(math.exp(20.0), rel=1e-5)
        found.add((run.growth, run.steps))
    assert len(found) == 1
