"""Small waves, starts at rest, waves of any speed: the scale is the largest omega reached."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, prepare, solve
from pyharness.engine.plan.registry import METHODS, SCIPY_METHODS
from pyharness.engine.solve import finest
from pyharness.model.scene import Triple
from pyharness.truth.integer_series import Path, integer_series
from pyharness.truth.reference import reference
from tests.refused import refused

BODY = (40.0, 30.0, 20.0)
REST = (0.0, 0.0, 0.0)


def _driven(omega: Triple = REST, **law: Any) -> Scene:
    return Scene("driven", omega, BODY, torque=TorqueLaw(**law))


@cache
def _path(scene: Scene, time: float) -> Path:
    return integer_series(scene, [time])


def _errs(found: np.ndarray, scene: Scene, time: float) -> float:
    path = _path(scene, time)
    return float(np.abs(found - path.omega[-1]).max() / np.abs(path.way).max())


@pytest.mark.parametrize("frequency", [1e-108, 1e-12, 1e-8, 1e-7, 1e-5, 1e-3, 0.1])
@pytest.mark.parametrize("t_end", [1.0, -2.5])
def test_slow_sine_from_rest(frequency: float, t_end: float) -> None:
    """1 - cos(f t) has no digit where f t is small; a prepared `auto` once returned 0."""
    scene = _driven(sines=(((0.0, 0.0, max(20.0, 1e-9 / frequency)), frequency),))
    for tolerance in (1e-6, 1e-8):
        solver = prepare(scene, "auto", tolerance)
        assert _errs(solver(np.zeros(3), t_end), scene, t_end) <= tolerance
        assert solver.status == "complete"


def test_slow_waves_beside_faster_ones() -> None:
    """Steps that follow the fast wave advance the slow ones by rotations of a tiny angle."""
    for slow in (1e-9, 1e-6, 1e-4):
        waves = (((40.0, -30.0, 20.0), slow), ((0.2 * slow, slow, -slow), 30.0))
        scene = _driven(sines=waves, cosines=(((0.0, slow, 0.0), slow),))
        assert _errs(prepare(scene, "quick", 1e-7)(np.zeros(3), 2.0), scene, 2.0) <= 1e-7


def test_fast_waves_keep_their_phase() -> None:
    """An averaged wave may turn 1e12 times: the product f t is kept as a double-double."""
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
    """Regression test: a first step of 1e-20 s, for the amplitude, exceeded the work limit."""
    scene = _driven(sines=(((0.0, 0.0, 20e40), 1e-40),))
    assert solve(scene, [3.0], "taylor", 1e-12).omega[0, 2] == pytest.approx(4.5, rel=1e-12)


_FAR, _PUSH = 1e162, 1e-252
_FAINT = ((120 * _PUSH, -60 * _PUSH, 80 * _PUSH), 2.0 / _FAR / (_PUSH * _FAR * _FAR))
# A scene, the time, a tolerance, and methods; the names describe former faults of some of them.
HELD: dict[str, tuple[Scene, float, float, str]] = {
    **{
        f"the scale of a start at rest, {size:g}": (
            _driven(constant=(2.0 * size, -3.0 * size, size), rate=(0.0, size, 0.0)), 2.0, 1e-6,
            "dop853 rk45 lsoda radau reference taylor gauss-4",
        )
        for size in (1.0, 1e-9, 1e-40)
    },
    "motion that a wave drives, of which the start says nothing": (
        _driven((1e-6, 1e-6, 0.0), cosines=(((90.0, 80.0, -30.0), 0.2),)), 6.0, 1e-7,
        "dop853 rk45 lsoda radau",
    ),
    "steps in time with a wave, which see a constant torque": (
        _driven((0.0, 0.0, 3.0), sines=(((0.1, -0.2, 0.1), 1000.0),)), 1.5, 1e-6, "rk45 dop853",
    ),
    "products of omega that underflow unless the unit is right": (
        _driven(sines=(_FAINT,)), _FAR, 1e-9, "auto gauss-6 dop853",
    ),
}  # fmt: skip


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "method"),
    [(name, method) for name, held in HELD.items() for method in held[3].split()],
)
def test_tolerance_is_of_what_omega_gets_to_be(name: str, method: str) -> None:
    scene, time, tolerance, _ = HELD[name]
    assert _errs(solve(scene, [time], method, tolerance).omega[0], scene, time) <= tolerance


@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_scipy_refuses_what_it_can_not_meet(method: str) -> None:
    """Near the middle axis a local error of 2e-14 is amplified beyond the tolerance."""
    scene = Scene("middle", (1e-6, 3.0, 1e-6), BODY)
    claimed, least = METHODS[method].finest, finest(method, scene, 8.0)
    assert least > 20.0 * claimed
    refused("tolerance", solve, scene, [8.0], method, claimed)
    assert _errs(solve(scene, [8.0], method, 2.0 * least).omega[-1], scene, 8.0) <= 2.0 * least


@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_spin_that_turns_too_often_is_no_overflow(method: str) -> None:
    """Nothing grows without bound, but the phase has no digit left."""
    steady, spun_up = Scene("", (0.0, 0.0, 1.0), BODY), _driven(constant=(0.0, 0.0, 1.0))
    for scene, time in ((steady, 1e15), (spun_up, 1e8)):
        refused("", solve, scene, [time], method, 1e-6)


def test_rows_on_the_way_keep_the_tolerance_too() -> None:
    """Intermediate rows are read off a polynomial, which is less accurate than the step's end."""
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
    found = prepare(_driven(cosines=(((0.0, 0.0, 20.0), 1e-10),)), method, 1e-6)(np.zeros(3), 3.0)
    np.testing.assert_allclose(found, (0.0, 0.0, 3.0), rtol=1e-6)
