"""Error amplification, estimated errors, and the ending `sensitive`."""

import math
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from random import Random
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pyharness.engine.sensitivity as room
from pyharness import Scene, TorqueLaw, case_scene, prepare, run_program, solve, solve_many, subset
from pyharness.engine import linearised, taylor
from pyharness.engine import solver as solver_module
from pyharness.engine.rescaled import scaled, unscaled
from pyharness.engine.sensitivity import closed_form_estimate, is_sensitive, motion_growth
from pyharness.model.codes import Statuses
from pyharness.model.scene import Triple
from pyharness.model.trajectory import ROUNDING, Trajectory, digits_left
from pyharness.torques import damping
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import reference
from tests.checks.scenes import free_motions

BESIDE = Scene("beside the middle axis", (1e-4, 2.0, 1e-4), moments=(3.0, 2.0, 1.2))
AT_REST = Scene("", (0.0, 0.0, 0.0), moments=(3.0, 2.0, 1.2))
PUSHED = case_scene(5)
RUNAWAY = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
SPHERE = Scene("", (1.0, 2.0, 3.0), moments=(2.0,) * 3, torque=TorqueLaw((1.0, 0.0, 0.0)))


def _along(scene: Scene, time: float) -> float:
    """Return the amplification by the linearised flow along the closed form."""
    times = np.linspace(0.0, time, 6000)
    path = solve(scene, times[1:].tolist(), "closed-form", 1e-9)
    omega = np.vstack([scene.omega, path.omega])
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
    largest = np.abs(truth.omega).max()
    assert np.abs(found.omega - truth.omega).max() <= 1e-9 * largest


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
    scene = at_rest(lambda t, w, q: [1e-9 * push(t), 0.0 * q[1], 0.0])
    found = solve(scene, 3.0, tolerance=1e-9)
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


@pytest.mark.parametrize("time", [1.0, 30.0, 300.0, -1000.0])
@pytest.mark.parametrize("scene", [case_scene(3), BESIDE, SPHERE])
def test_error_of_a_closed_form_is_what_it_may_be(scene: Scene, time: float) -> None:
    """The closed form in double-double has errors of a few roundings, whatever the growth."""
    found: Any = solve(scene, [time], "closed-form", 1e-9)
    if scene is SPHERE:
        truth = reference(scene, [time]).omega[-1]
    else:
        truth = np.array(torque_free(scene, time), dtype=float)
    scale = max(np.abs(truth).max(), max(map(abs, scene.omega)))
    assert np.abs(found.omega[-1] - truth).max() / scale <= found.error
    assert found.error / ROUNDING == pytest.approx(17.0)
    if scene is not SPHERE:
        rounded = Scene("", scene.omega, inertia=np.diag(scene.moments or ()).tolist())
        other: Any = solve(rounded, [time], "closed-form", 1e-9)
        assert other.error / ROUNDING == pytest.approx((found.growth or 0.0) + 16.0)


def closed(seed: str, kind: str) -> tuple[Scene, float, Any, float]:
    """Return a random scene, its time, its closed form, and the true relative error of that."""
    moments, omega, _, time = free_motions.draw(Random(seed), kind)
    scene = Scene("", omega, moments)
    found: Any = solve(scene, [time], "closed-form", 1e-13)
    truth = np.array(torque_free(scene, time))
    error = float(max(abs(truth - [Decimal(x) for x in found.omega[0].tolist()])))
    return scene, time, found, error / max(np.abs(found.omega).max(), np.abs(scene.omega).max())


@pytest.mark.parametrize("kind", ["generic", "near separatrix", "needle", "middle axis"])
def test_error_of_a_closed_form_is_a_bound_near_its_errors(kind: str) -> None:
    ratios = []
    for number in range(150):
        _, _, found, error = closed(f"bound {kind} {number}", kind)
        assert error <= found.error
        if found.growth < 2.0**44:
            assert found.ended == "complete"
            ratios += [error / found.error] if error else []
    assert np.quantile(ratios, 0.2) > 0.01


@pytest.mark.parametrize("number", [2393, 2719, 4503])
def test_error_of_a_closed_form_grows_where_its_double_double_is_not_enough(number: int) -> None:
    scene, time, found, error = closed(f"saturated {number}", "near separatrix")
    assert 300.0 * ROUNDING < error <= found.error
    assert found.ended == "sensitive"
    many: Any = solve_many([scene], time, tolerance=1e-13, estimates=True)
    assert many.ended[0] == "sensitive"
    assert error <= many.error[0]


def test_ending_is_sensitive_where_rounding_exceeds_the_tolerance() -> None:
    # The initial omega of a body with an inertia matrix is rounded.
    scene = Scene("", BESIDE.omega, inertia=np.diag(BESIDE.moments or ()).tolist())
    growth: Any = motion_growth(BESIDE, 60.0)
    limit = ROUNDING * growth / 0.3
    start = np.array(BESIDE.omega)
    for share, word in ((0.99, "sensitive"), (1.01, "complete")):
        for method in ("auto", "closed-form"):
            found = solve(scene, [1.0, 60.0], method, share * limit)
            assert solve(BESIDE, [1.0, 60.0], method, share * limit).ended == "complete"
            solver = prepare(scene, method, share * limit)
            assert solver(start, 60.0).tolist() == found.omega[-1].tolist()
            assert (found.ended, solver.status, found.has_all_rows) == (word, word, True)
            assert (solver.growth, solver.error) == (found.growth, found.error)
            assert solver.digits == found.digits == digits_left(found.error)
            assert found.growth == growth


def test_gauss_collocation_knows_the_growth_of_the_motion() -> None:
    growth: Any = motion_growth(BESIDE, 12.0)
    assert growth > 9e3
    tolerance = 0.9 * ROUNDING * growth / 0.3
    for share, word in ((1.0, "sensitive"), (1.2, "complete")):
        found: Any = solve(BESIDE, [12.0], "gauss-8", share * tolerance)
        assert (found.ended, found.growth) == (word, growth)
        assert ROUNDING * growth <= found.error <= share * tolerance + ROUNDING * growth
        # With the scene's own steps it has no estimate of its own.
        solver = prepare(BESIDE, "gauss-8", share * tolerance)
        solver(BESIDE.omega, 12.0)
        assert (solver.status, solver.error, solver.growth) == (word, None, growth)
    # The growth is from the start and to the time of the call.
    solver(case_scene(3).omega, -3.0)
    assert solver.growth == motion_growth(replace(BESIDE, omega=case_scene(3).omega), -3.0)
    at_rest = solve(AT_REST, [1.0], "gauss-2", 1e-6)
    assert (at_rest.error, at_rest.growth) == (ROUNDING, 1.0)


@pytest.mark.parametrize("method", ["rk4", "dop853"])
def test_methods_that_estimate_nothing_say_so(method: str) -> None:
    found = solve(PUSHED, [1.0], method, 1.0 if method == "rk4" else 1e-6)
    assert (found.error, found.growth, found.digits) == (None, None, None)
    run = run_program(PUSHED, subset("two-term"))
    assert (run.error, run.growth, run.digits) == (None, None, None)


def test_solver_knows_nothing_before_a_call_and_without_a_result() -> None:
    solver = prepare(RUNAWAY, "taylor", 1e-9)
    assert (solver.status, solver.error, solver.growth, solver.digits) == ("complete", *[None] * 3)
    assert np.isnan(solver(RUNAWAY.omega, 2.0)).all()
    assert (solver.status, solver.error, solver.growth, solver.digits) == ("overflow", *[None] * 3)
    free = prepare(BESIDE)
    assert np.isnan(free(BESIDE.omega, 1e300)).all()
    assert (free.status, free.error, free.growth) == ("gave up", None, None)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
def test_quick_tells_its_own_error(tolerance: float) -> None:
    solver: Any = prepare(PUSHED, "quick", tolerance)
    found = solver(PUSHED.omega, 3.0)
    truth = reference(PUSHED, [1.0, 2.0, 3.0]).omega
    error = np.abs(found - truth[-1]).max() / np.abs(truth).max()
    assert error <= solver.error <= 0.35 * tolerance
    assert solver.growth is None
    assert solver(PUSHED.omega, 0.0).tolist() == list(PUSHED.omega)
    assert solver.error == 0.0
    assert solver.digits == pytest.approx(15.95, abs=0.01)


def _grown(status: int, error: float, growth: float) -> Callable[..., Any]:
    """Return a series that ends with a status, and reports an error and a growth."""

    def rows(*given: Any, effort: Any, **_: Any) -> Any:
        effort[2:4] = error, growth
        return np.ones((3, len(given[6]))), len(given[6]), status, 7, 0

    return rows


def test_what_the_series_finds_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(status: int, *estimates: float) -> Trajectory:
        kernel = SimpleNamespace(taylor_rows=_grown(status, *estimates))
        monkeypatch.setattr(taylor, "extension", lambda: kernel)
        return solve(PUSHED, [1.0, 2.0], "taylor", 1e-9)

    sensitive = found(Statuses.SENSITIVE, 1e-6, 3e9)
    assert (sensitive.ended, sensitive.error, sensitive.growth) == ("sensitive", 1e-6, 3e9)
    assert sensitive.digits == pytest.approx(6.0)
    assert len(sensitive.omega) == 2
    complete = found(Statuses.COMPLETE, 1e-10, -1.0)
    assert (complete.ended, complete.error, complete.growth) == ("complete", 1e-10, None)
    overflow = found(Statuses.OVERFLOW, 1e-10, 2.0)
    assert (overflow.ended, overflow.error, overflow.growth) == ("overflow", None, None)
    assert not overflow.has_all_rows

    def packed(*given: Any) -> Any:
        return np.ones(3), Statuses.SENSITIVE, 7, np.array([1e-6, 3e9, 7.0])

    kernel = SimpleNamespace(solve_packed=packed)
    monkeypatch.setattr(solver_module, "extension", lambda: kernel)
    solver = prepare(PUSHED, "taylor")
    assert solver(PUSHED.omega, 2.0).tolist() == [1.0] * 3
    assert (solver.status, solver.error, solver.growth) == ("sensitive", 1e-6, 3e9)
    # Without a closed form, Gauss collocation gets the growth from the series, to three digits.
    kernel = SimpleNamespace(taylor_rows=_grown(Statuses.COMPLETE, 1e-4, 3e9))
    monkeypatch.setattr(room, "extension", lambda: kernel)
    assert motion_growth(PUSHED, 2.0) == 3e9
    assert solve(PUSHED, [0.1], "gauss-4", 1e-6).ended == "sensitive"


def test_both_sides_of_zero_have_the_larger_error_and_growth() -> None:
    beside = Scene("", BESIDE.omega, inertia=np.diag(BESIDE.moments or ()).tolist())
    after, before = (solve(beside, [t], tolerance=1e-12) for t in (40.0, -1.0))
    for times in ([-1.0, 40.0], [40.0, 0.0, -1.0]):
        both = solve(beside, times, tolerance=1e-12)
        assert (both.ended, both.error, both.growth) == ("sensitive", after.error, after.growth)
    assert before.ended == "complete"
    both, before = (solve(beside, [-40.0, *more], tolerance=1e-12) for more in ([1.0], []))
    assert (both.ended, both.error, both.growth) == ("sensitive", before.error, before.growth)
    lost = solve(RUNAWAY, [-0.5, 2.0], "taylor", 1e-9)
    assert (lost.ended, lost.error, lost.growth) == ("overflow", None, None)


def test_digits_are_those_that_the_error_leaves() -> None:
    found = [digits_left(error) for error in (1.0, 7.0, 0.01, 1e-9, 0.0, None)]
    assert found == [0.0, 0.0, pytest.approx(2.0), pytest.approx(9.0), 53 * math.log10(2.0), None]


def test_is_sensitive_by_a_share_of_the_tolerance() -> None:
    assert not is_sensitive(None, 1e-15)
    assert not is_sensitive(0.29e-9 / ROUNDING, 1e-9)
    assert is_sensitive(0.31e-9 / ROUNDING, 1e-9)


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


def test_what_overflows_in_the_units_of_the_scene_has_no_error() -> None:
    time = np.array([1.0])
    found = Trajectory(time, time, np.full((1, 3), 1e300), None, 1, 1, error=1e-9, growth=2.0)
    slower, lost = (unscaled(found, [1.0], factor) for factor in (2.0, 1e-100))
    assert (slower.ended, slower.error, slower.growth) == ("complete", 1e-9, 2.0)
    assert (lost.ended, lost.error, lost.growth) == ("overflow", None, None)
