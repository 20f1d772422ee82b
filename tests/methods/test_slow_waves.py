"""Small waves, starts at rest and waves of any speed: the tolerance is of what omega gets to be."""

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, prepare, solve
from pyharness.methods.registry import METHODS, SCIPY_METHODS
from pyharness.methods.solve import finest
from pyharness.model.scene import Triple
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import reference

BODY = (40.0, 30.0, 20.0)
REST = (0.0, 0.0, 0.0)


def _driven(omega: Triple = REST, **law: object) -> Scene:
    return Scene("driven", omega, BODY, torque=TorqueLaw(**law))  # type: ignore[arg-type]


def _errs(found: np.ndarray, scene: Scene, time: float) -> float:
    path = integer_series(scene, [time])
    return float(np.abs(found - path.omega[-1]).max() / np.abs(path.way).max())


@pytest.mark.parametrize("frequency", [1e-108, 1e-12, 1e-8, 1e-7, 1e-5, 1e-3, 0.1])
@pytest.mark.parametrize("t_end", [1.0, -2.5])
def test_slow_sine_from_rest(frequency: float, t_end: float) -> None:
    """1 - cos(f t) has no digit where f t is small; a prepared `auto` answered 0."""
    amplitude = max(20.0, 1e-9 / frequency)
    scene = _driven(sines=(((0.0, 0.0, amplitude), frequency),))
    for tolerance in (1e-6, 1e-8):
        solver = prepare(scene, "auto", tolerance)
        assert _errs(solver(np.zeros(3), t_end), scene, t_end) <= tolerance
        assert solver.status == "complete"


def test_slow_waves_beside_faster_ones() -> None:
    """Steps that follow the fast wave carry the slow ones along by rotations of a tiny angle."""
    for slow in (1e-9, 1e-6, 1e-4):
        waves = (((40.0, -30.0, 20.0), slow), ((0.2 * slow, slow, -slow), 30.0))
        scene = _driven(sines=waves, cosines=(((0.0, slow, 0.0), slow),))
        found = prepare(scene, "quick", 1e-7)(np.zeros(3), 2.0)
        assert _errs(found, scene, 2.0) <= 1e-7


def test_fast_waves_keep_their_phase() -> None:
    """A wave that is averaged may turn 1e12 times: the product f t is kept in two words."""
    for frequency, time, tolerance in ((1e9, 7.3, 1e-9), (1e12, 0.7, 1e-9), (1e20, 0.7, 1e-9)):
        scene = _driven((0.0, 0.0, 1.0), cosines=(((0.0, 0.0, 2.0 * frequency), frequency),))
        found = prepare(scene, "auto", tolerance)(np.array(scene.omega), time)
        exact = reference(Scene("", scene.omega, (20.0,) * 3, torque=scene.torque), [time]).omega[0]
        assert np.abs(found - exact).max() <= tolerance


def test_collocation_keeps_the_phase_of_a_wave_over_many_turns() -> None:
    scene = _driven(cosines=(((0.0, 0.0, 20.0), 1.0),))
    found = solve(scene, [20000.3], "gauss-8", 1e-12).omega[0, 2]
    exact = reference(Scene("", REST, (20.0,) * 3, torque=scene.torque), [20000.3]).omega[0, 2]
    assert abs(found - exact) < 1e-13


def test_series_takes_a_slow_sine_for_what_it_comes_to() -> None:
    """It began with a step for the amplitude, 1e-20 s, and gave up."""
    scene = _driven(sines=(((0.0, 0.0, 20e40), 1e-40),))
    assert solve(scene, [3.0], "taylor", 1e-12).omega[0, 2] == pytest.approx(4.5, rel=1e-12)


@pytest.mark.parametrize("method", [*SCIPY_METHODS, "reference", "taylor", "gauss-4"])
@pytest.mark.parametrize("size", [1.0, 1e-9, 1e-40])
def test_start_at_rest_is_held_to_what_omega_becomes(method: str, size: float) -> None:
    """`solve_ivp` took 1 rad/s for the scale of a body at rest, the reference likewise."""
    scene = _driven(constant=(2.0 * size, -3.0 * size, 1.0 * size), rate=(0.0, size, 0.0))
    tolerance = 1e-6
    found = solve(scene, [1.0, 2.0], method, tolerance)
    assert _errs(found.omega[-1], scene, 2.0) <= tolerance


@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_scipy_shares_the_tolerance_over_the_motion_that_a_wave_drives(method: str) -> None:
    """All of the motion comes from the wave: the start says nothing of how far it goes."""
    scene = _driven((1e-6, 1e-6, 0.0), cosines=(((90.0, 80.0, -30.0), 0.2),))
    tolerance = 1e-7
    assert _errs(solve(scene, [6.0], method, tolerance).omega[-1], scene, 6.0) <= tolerance


@pytest.mark.parametrize("method", ["rk45", "dop853"])
def test_no_step_passes_over_a_fast_wave(method: str) -> None:
    """Steps in time with a wave see a constant torque, and no error."""
    scene = _driven((0.0, 0.0, 3.0), sines=(((0.1, -0.2, 0.1), 1000.0),))
    assert _errs(solve(scene, [1.5], method, 1e-6).omega[-1], scene, 1.5) <= 1e-6


@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_scipy_refuses_what_it_can_not_meet(method: str) -> None:
    """Beside the middle axis a step of 2e-14 is multiplied by more than a tolerance allows."""
    scene = Scene("middle", (1e-6, 3.0, 1e-6), BODY)
    least = finest(method, scene, 8.0)
    assert least > 20.0 * METHODS[method].finest
    with pytest.raises(
        InputError, match=r"can't meet it .* grow .* times; allowed for this motion"
    ):
        solve(scene, [8.0], method, METHODS[method].finest)
    assert _errs(solve(scene, [8.0], method, 2.0 * least).omega[-1], scene, 8.0) <= 2.0 * least


def test_quick_claims_no_more_than_its_many_steps_allow() -> None:
    with pytest.raises(InputError, match="tolerance is 1e-13; allowed for quick: 1e-12 to 1"):
        prepare(_driven(constant=(1.0, 2.0, 3.0)), "quick", 1e-13)


@pytest.mark.parametrize("method", ["auto", "gauss-6", "dop853"])
def test_rest_far_below_the_root_of_the_smallest_number(method: str) -> None:
    """A slow sine of a large amplitude: products of omega underflow unless the unit is right."""
    w = 1e-162
    time, push = 1.0 / w, 1e-90 * w
    sine = ((120.0 * push, -60.0 * push, 80.0 * push), 2.0 * w / (push * time * time))
    scene = _driven(sines=(sine,))
    assert _errs(solve(scene, [time], method, 1e-9).omega[0], scene, time) <= 1e-9


@pytest.mark.parametrize("method", [*SCIPY_METHODS, "taylor", "gauss-2", "auto", "reference"])
def test_rest_that_nothing_moves_stays(method: str) -> None:
    run = solve(Scene("rest", REST, BODY), [1.0, 2.0], method, 1e-6)
    assert (run.ended, run.omega.tolist()) == ("complete", [[0.0, 0.0, 0.0]] * 2)


@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_spin_that_turns_too_often_is_no_overflow(method: str) -> None:
    """A steady spin grows nowhere: it is its phase that has no digit left."""
    with pytest.raises(InputError, match=r"gave up at t = .*radians the phase"):
        solve(Scene("steady", (0.0, 0.0, 1.0), BODY), [1e15], method, 1e-6)


@pytest.mark.parametrize("method", ["taylor", "gauss-4", "dop853", "auto"])
@pytest.mark.parametrize("frequency", [1e50, 1e200])
def test_wave_without_amplitude_is_none(method: str, frequency: float) -> None:
    still = Scene("still", (0.0, 1.0, 1.0), BODY, torque=TorqueLaw(constant=(1.0, 0.0, 0.0)))
    waves = TorqueLaw((1.0, 0.0, 0.0), sines=((REST, frequency),), cosines=((REST, frequency),))
    found = solve(Scene("still", still.omega, BODY, torque=waves), [1.0], method, 1e-9)
    assert _errs(found.omega[0], still, 1.0) <= 1e-9


@pytest.mark.parametrize("method", ["dop853", "lsoda"])
def test_long_spin_up_from_a_faint_start_is_no_overflow(method: str) -> None:
    scene = Scene("spin", (0.0, 0.0, 1e-9), BODY, torque=TorqueLaw((0.0, 0.0, 1.0)))
    with pytest.raises(InputError, match="gave up"):
        solve(scene, [1e8], method, 1e-6)


def test_rows_on_the_way_keep_the_tolerance_too() -> None:
    """They are read off a polynomial in a step, which errs more than the step's end."""
    generator = np.random.default_rng(7)
    for _ in range(6):
        law = TorqueLaw(tuple(generator.normal(size=3) * 60.0))
        scene = Scene("rows", tuple(generator.normal(size=3) * 3.0), BODY, torque=law)
        times = np.linspace(0.0, 1.1, 31)[1:].tolist()
        path = integer_series(scene, times)
        for method in ("dop853", "rk45"):
            found = solve(scene, times, method, 5e-4).omega
            assert np.abs(found - path.omega).max() <= 5e-4 * np.abs(path.way).max()


@pytest.mark.parametrize("method", ["auto", "quick", "taylor"])
def test_slow_cosine_is_a_constant_torque(method: str) -> None:
    scene = _driven(cosines=(((0.0, 0.0, 20.0), 1e-10),))
    found = prepare(scene, method, 1e-6)(np.zeros(3), 3.0)
    np.testing.assert_allclose(found, (0.0, 0.0, 3.0), rtol=1e-6)


@pytest.mark.parametrize("frequency", [1e-7, 1e-6])
def test_quick_takes_a_slow_sine_itself(frequency: float) -> None:
    scene = _driven(sines=(((5.0, 7.0, 20.0), frequency),))
    solver = prepare(scene, "quick", 1e-6)
    assert _errs(solver(np.zeros(3), 1.0), scene, 1.0) < 1e-6
    assert solver.status == "complete"
