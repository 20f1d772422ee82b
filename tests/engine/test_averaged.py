"""The method `averaged`: its error against the true solution, its estimates and its refusals."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, solve
from pyharness.checks.scenes.random_scenes import draw
from pyharness.engine.methods import averaged_step
from pyharness.engine.methods.averaged_coordinates import Coordinates, torque_of
from pyharness.model.errors import InputError, TimedError
from pyharness.model.trajectory import Array, Trajectory
from pyharness.torques import damping, rate_control, recorded
from pyharness.truth.integer_series import integer_series
from tests.checks.scenes.weak_torques import MOTIONS, TORQUES, draw_weak

MOMENTS = (3.0, 2.0, 1.2)
PUSH = TorqueLaw((1e-6, 2e-6, 1e-6))
SCENE = Scene("weak", (0.3, 0.2, 1.1), moments=MOMENTS, torque=PUSH)
# Random scenes of 1000 rotations; about half of them are solved.
_NUMBERS = 120
_REASONS = ("near the separatrix", "resonance", "too much", "principal axis")


def _averaged(scene: Scene, times: list[float], tolerance: float = 1e-9) -> Trajectory:
    return solve(scene, times, "averaged", tolerance)


def _error(found: Trajectory, truth: Array) -> float:
    return float(np.abs(found.omega - truth).max() / np.abs(truth).max())


@pytest.mark.campaign
def test_random_scenes_meet_the_tolerance_or_are_refused_with_a_reason() -> None:
    """The series is accurate over this time, but its own estimate may be too small."""
    reasons: Counter[str] = Counter()
    for number in range(_NUMBERS):
        scene, time = draw_weak("averaged", number, 1e3)
        try:
            found: Any = _averaged(scene, [0.37 * time, time])
        except InputError as refusal:
            (reason,) = (each for each in _REASONS if each in str(refusal))
            reasons[reason] += 1
            continue
        series: Any = solve(scene, [0.37 * time, time], "taylor", 1e-14)
        error = _error(found, series.omega)
        assert error <= 1e-9 + 4e-15 * min(found.growth, series.growth), scene.name
        # The series has its own error.
        assert error <= 40.0 * (found.error + series.error), scene.name
        assert 0.2 < found.growth / series.growth < 5.0 or found.growth < 30.0, scene.name
    assert sum(reasons.values()) < 0.6 * _NUMBERS
    # At least the fast waves are refused, and motions near the separatrix.
    assert reasons["resonance"] >= _NUMBERS // len(TORQUES) // 2
    assert reasons["near the separatrix"] >= _NUMBERS // len(MOTIONS) // 2


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore::pyharness.ImpossibleBodyWarning")
def test_difficult_scenes_are_solved_or_refused() -> None:
    """Some have numbers near the limits of binary64, and many have strong torques."""
    solved = 0
    for number in range(200):
        drawn = draw("averaged", number)
        times = [0.3 * drawn.time, drawn.time]
        try:
            found: Any = _averaged(drawn.scene, times)
        except InputError:
            continue
        solved += 1
        assert np.isfinite(found.error)
        series = solve(drawn.scene, times, "taylor", 1e-14)
        error = _error(found, series.omega)
        assert error <= 1e-9 + 4e-15 * (series.growth or 1.0), drawn.scene.name
    assert 10 < solved < 100


@pytest.mark.campaign
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("law", [
    PUSH,
    TorqueLaw((1e-6, 0.0, 0.0), (1e-9, -2e-9, 1e-9)),
    TorqueLaw(sines=[((1e-6, 0.0, 2e-6), 2e-3)], cosines=[((0.0, 3e-6, 1e-6), 1e-3)]),
])  # fmt: skip
def test_error_against_many_digits_is_below_its_estimate(law: TorqueLaw, sign: float) -> None:
    times = [sign * each for each in (1.0, 123.0, 700.0)]
    scene = replace(SCENE, torque=law)
    found: Any = _averaged(scene, times)
    assert _error(found, integer_series(scene, times).omega) <= found.error < 1e-12
    assert found.ended == "complete"


@pytest.mark.parametrize(("moments", "omega"), [
    ((2.0, 2.0, 1.0), (0.3, 0.4, 1.0)),  # symmetric
    ((1.0, 2.0, 2.0), (-1.0, 0.4, 0.3)),
    (MOMENTS, (0.0, 0.0, 1.0)),  # exactly about the axis of the least moment
    (MOMENTS, (-1.0, 1e-9, 0.0)),  # nearly about the axis of the largest moment
    ((3.0, 2.0, 1.2), (1e-150, 0.0, -2e-3)),
])  # fmt: skip
def test_rotation_about_an_axis_and_symmetric_body(
    moments: tuple[float, float, float], omega: tuple[float, float, float]
) -> None:
    spin = max(map(abs, omega))
    scene = Scene(
        "axis", omega, moments=moments,
        torque=TorqueLaw((1e-6 * spin**2, 2e-6 * spin**2, -1e-6 * spin**2)),
    )  # fmt: skip
    times = [10.0 / spin, 900.0 / spin]
    assert _error(_averaged(scene, times), integer_series(scene, times).omega) < 1e-13


def _slow(t: Any, w: Any) -> Any:
    wave = np.sin(2e-3 * t + 0.1) * np.cos(1e-3 * t) / 3.0
    return (1e-6 * wave - 1e-6 * w[0], 1e-12 * t * t * w[1], 1e-9 * t * w[2] ** 7)


@pytest.mark.parametrize(
    "torque", [damping([1e-5, 2e-5, 1e-5]), rate_control(1e-5, (0.0, 0.0, 1.5)), recorded(_slow)]
)
def test_recorded_torque_is_solved(torque: Any) -> None:
    scene = replace(SCENE, torque=torque)
    times = [10.0, 1e3]
    found = _averaged(scene, times, 1e-11)
    assert _error(found, solve(scene, times, "taylor", 1e-14).omega) < 1e-11


@pytest.mark.campaign
@pytest.mark.parametrize("coefficients", [(0.3, -0.5, 0.2), (-0.3, 0.5, 0.2), (0.3, -0.5, 0.3)])
def test_torque_whose_first_mean_is_zero_is_averaged(coefficients: tuple[float, ...]) -> None:
    """The first sweep changes nothing; it was taken for the last one, and the scene refused."""
    a, b, c = coefficients
    scene = Scene("", SCENE.omega, coefficients=(a, b, c), torque=TorqueLaw((1e-6, 0.0, 0.0)))
    assert _error(_averaged(scene, [1e3]), integer_series(scene, [1e3]).omega) < 1e-12


def test_rows_do_not_depend_on_other_rows_and_are_in_the_order_of_the_times() -> None:
    times = [-2000.0, -3.0, 0.0, 1e-9, 50.0, 3000.0]
    found = _averaged(SCENE, times)
    assert found.omega[2].tolist() == list(SCENE.omega)
    for time, row in zip(times, found.omega, strict=True):
        np.testing.assert_allclose(_averaged(SCENE, [time]).omega[0], row, rtol=0, atol=2e-12)


def test_other_unit_of_time_and_an_inertia_matrix_give_the_same_motion() -> None:
    found = _averaged(SCENE, [5e3]).omega
    for factor in (1e-120, 1e120):
        omega = tuple(factor * each for each in SCENE.omega)
        push = tuple(factor**2 * each for each in PUSH.constant)
        scaled = Scene("", omega, moments=MOMENTS, torque=TorqueLaw(push))
        other = _averaged(scaled, [5e3 / factor]).omega / factor
        np.testing.assert_allclose(other, found, rtol=0, atol=1e-10)
    matrix = tuple(tuple(row) for row in np.diag(MOMENTS).tolist())
    full = Scene("", SCENE.omega, inertia=matrix, torque=PUSH)
    np.testing.assert_allclose(_averaged(full, [5e3]).omega, found, rtol=0, atol=1e-10)


def test_many_macro_steps_agree_with_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two macro-orders and two lengths of the macro-steps agree over 1e5 rotations."""
    times = [2e5, 5.4e5]
    found: Any = _averaged(SCENE, times)
    assert found.error < 1e-10
    monkeypatch.setattr("pyharness.engine.methods.averaged._RELATIVE", 0.2)
    monkeypatch.setattr("pyharness.engine.methods.averaged.NODES", 16)
    other = _averaged(SCENE, times)
    assert other.steps > 4 * found.steps
    assert 0.0 < _error(other, found.omega) <= found.error
    # Recorded from `integer_series` in 5e5 steps: 1e5 rotations, and a tenth and half of them.
    truth = [
        [0.20815482098679514, -0.4444291010934011, 1.0770245459517],
        [-0.31607920200188394, -0.08101459090779672, 1.3270662703084766],
        [-0.19212044277706236, -0.46816196474106747, 1.478736212965576],
    ]
    end = 1e5 * 2 * np.pi / 1.16
    found = _averaged(SCENE, [0.1 * end, 0.5 * end, end])
    assert _error(found, np.array(truth)) <= found.error


@pytest.mark.parametrize("fault", ["order", "waves", "mean", "nodes"])
def test_measured_error_shows_a_fault(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A macro-step with too low an order of averaging, or too few nodes, has a large error."""
    coordinates: Any = Coordinates.from_omega(SCENE.euler_coefficients, SCENE.omega)
    start = coordinates.point(SCENE.omega)
    torques = [np.array(push / moment) for push, moment in zip(PUSH.constant, MOMENTS, strict=True)]

    def step(nodes: int = 20) -> float:
        found = averaged_step.MacroStep(
            coordinates, lambda time, omega: list(torques), False, start, 0.0,
            40_000 * np.pi, (nodes, 44),
        )  # fmt: skip
        return float((np.abs(found.error).max(axis=1) / found.scale)[:3].max())

    right = step()
    assert right < 1e-15
    if fault == "nodes":
        assert step(6) > 100.0 * right
        return
    residual = averaged_step.MacroStep._residual
    finest = 20 + averaged_step._MORE_NODES

    def wrong(self: Any, mean: Array, waves: Array, slow: Any, fast: Any) -> tuple[Array, Array]:
        """Return a residual that lacks a part of the equation, except for the measured error."""
        if len(slow.nodes) == finest:
            return residual(self, mean, waves, slow, fast)
        found, more = residual(self, mean, 0.0 * waves if fault == "order" else waves, slow, fast)
        if fault == "waves":
            more = 0.0 * more
        if fault == "mean":
            found = found + 1e-9 * slow.nodes
        return found, more

    monkeypatch.setattr(averaged_step.MacroStep, "_residual", wrong)
    assert step() > 1e3 * right


def test_measured_error_has_the_size_and_sign_of_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of omega changes the time of each revolution too."""
    coordinates: Any = Coordinates.from_omega(SCENE.euler_coefficients, SCENE.omega)
    torques = [np.array(push / moment) for push, moment in zip(PUSH.constant, MOMENTS, strict=True)]

    def step() -> averaged_step.MacroStep:
        return averaged_step.MacroStep(
            coordinates, lambda time, omega: list(torques), False,
            coordinates.point(SCENE.omega), 0.0, 40_000 * np.pi, (20, 44),
        )  # fmt: skip

    residual = averaged_step.MacroStep._residual

    def wrong(self: Any, mean: Array, waves: Array, slow: Any, fast: Any) -> tuple[Array, Array]:
        """Return a residual with an error of p1, p2 and p3, except for the measured error."""
        found, more = residual(self, mean, waves, slow, fast)
        if len(slow.nodes) == 20:
            found[:3] += 1e-9 * slow.nodes
        return found, more

    right = step()
    monkeypatch.setattr(averaged_step.MacroStep, "_residual", wrong)
    found = step()
    error = right.stroboscopic - found.stroboscopic
    np.testing.assert_allclose(found.error[:, -1], error[:, -1], rtol=1e-3)


@pytest.mark.campaign
def test_crossing_of_the_separatrix_is_refused_at_its_time() -> None:
    """The spin about axis 3 ceases after some 3e5 s."""
    scene = replace(SCENE, torque=TorqueLaw((0.0, 0.0, -4e-6)))
    with pytest.raises(TimedError, match="separatrix") as refusal:
        _averaged(scene, [1e6])
    assert 1e5 < refusal.value.time < 3.3e5


def test_rows_near_the_separatrix_are_those_of_taylor() -> None:
    law = TorqueLaw((-7.2334e-7, -5.6474e-7, -2.7866e-7))
    scene = Scene("", (-0.25, 0.205, 0.9463), moments=(1.308, 1.5601, 1.4755), torque=law)
    rows, others = (
        solve(scene, -83_500.0, each, 1e-9, effort=5.0).omega for each in ("averaged", "taylor")
    )
    assert abs(rows - others).max() < 1e-9


def test_dense_output_and_events_use_the_method() -> None:
    found: Any = solve(SCENE, [50.0], "averaged", 1e-9, dense_output=True, events=lambda t, w: w[0])
    assert found.sol is not None
    truth = solve(SCENE, found.t_events[0], "taylor").omega
    assert len(truth) > 5
    assert np.abs(truth[:, 0]).max() < 1e-8


@pytest.mark.parametrize(("torque", "varies"), [
    (PUSH, False),
    (TorqueLaw((1e-6, 0.0, 0.0), (0.0, 1e-9, 0.0)), True),
    (TorqueLaw(sines=[((1e-6, 0.0, 2e-6), 2e-3)]), True),
    (TorqueLaw(cosines=[((1e-6, 0.0, 2e-6), 2e-3)]), True),
])  # fmt: skip
def test_time_is_an_unknown_only_if_the_torque_varies(torque: TorqueLaw, varies: bool) -> None:
    assert torque_of(replace(SCENE, torque=torque))[1] is varies


def test_sizes_of_a_point_have_its_units() -> None:
    coordinates: Any = Coordinates.from_omega(SCENE.euler_coefficients, SCENE.omega)
    slow, fast = (
        coordinates.scale(coordinates.point(tuple(factor * np.array(SCENE.omega))))
        for factor in (1.0, 4.0)
    )
    assert np.array_equal(fast / slow, [4.0, 4.0, 16.0, 0.25])
