"""The reference, compared with closed forms and mpmath, and its estimate with the true error."""

import decimal
import math
from dataclasses import replace
from decimal import Decimal
from itertools import permutations
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, solve
from pyharness.torques import recorded
from pyharness.truth import reference as room
from pyharness.truth.decimal_functions import sine_cosine
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import reference
from tests.exact_attitude import joint


def _whole(found: room.Reference, row: int) -> list[mpmath.mpf]:
    """Return the reference to all its digits."""
    assert found.remainder is not None
    return [
        mpmath.mpf(float(high)) + mpmath.mpf(float(low))
        for high, low in zip(found.omega[row], found.remainder[row], strict=True)
    ]


def test_case_1_is_linear_and_case_2_is_a_circle() -> None:
    assert reference(case_scene(1), [1.0, 2.0]).omega.tolist() == [[3.5] * 3, [6.0] * 3]
    times = case_scene(2).times()
    wanted = [[math.sin(5 * t), math.cos(5 * t), 10.0] for t in times]
    np.testing.assert_allclose(reference(case_scene(2), times).omega, wanted, rtol=0, atol=1e-15)


_LAW = TorqueLaw(
    (1.0, -2.0, 3.0), (0.5, 0.0, -1.0), (((1.0, 2.0, 3.0), 3.0), ((1.0, 0.0, 0.0), 0.0)),
    (((3.0, 2.0, 1.0), 5.0), ((0.0, 1.0, 0.0), 0.0)),
)  # fmt: skip
_START = (0.3, -1.1, 2.2)


@pytest.mark.parametrize(("scene", "times"), [
    *((case_scene(case), case_scene(case).times()) for case in (1, 2)),
    *((Scene("", _START, moments), [0.5, 7.0]) for moments in permutations((30.0, 30.0, 70.0))),
    (Scene("", _START, (2.0, 2.0, 2.0), torque=_LAW), [-2.0]),
])  # fmt: skip
def test_series_agrees_with_the_known_solution(
    scene: Scene, times: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The two derivations share only the arithmetic; the estimate bounds their difference."""
    known = reference(scene, times)
    assert known.source == "known solution"
    monkeypatch.setattr(room, "known_solution", lambda *_: None)
    series = reference(scene, times)
    assert series.source.startswith("Taylor")
    assert np.abs(series.omega - known.omega).max() <= series.error + known.error
    np.testing.assert_allclose(series.omega, known.omega, rtol=1e-15, atol=1e-15)
    assert series.estimate < 1e-16


@pytest.mark.parametrize("time", [1e20, 1e39, 1e40, -1e41, 1e100, 1e300])
@pytest.mark.parametrize("third", [10.0, 10.1, -1e30, 1e-200])
def test_a_symmetric_body_after_any_time(time: float, third: float) -> None:
    """The phase has as many digits before the point, and needs 40 after it."""
    found = reference(Scene("", (0.3, 1.0, third), moments=(40.0, 40.0, 20.0)), [time])
    with mpmath.workdps(700):
        phase = mpmath.mpf(third) / 2 * mpmath.mpf(time)
        sine, cosine = mpmath.sin(phase), mpmath.cos(phase)
        wanted = [mpmath.mpf(0.3) * cosine + sine, cosine - mpmath.mpf(0.3) * sine]
        assert max(abs(x - y) for x, y in zip(_whole(found, 0)[:2], wanted, strict=True)) < 1e-31
    assert np.abs(found.omega[0, :2] - [float(x) for x in wanted]).max() <= found.error


@pytest.mark.parametrize(
    ("frequency", "time"), [(0.1, 1e41), (1e-20, 1e62), (3e10, -1e300), (1e-300, 1e100)]
)
def test_a_sphere_after_any_time(frequency: float, time: float) -> None:
    waves = (((1.0, 0.0, 0.0), frequency),), (((0.0, 1.0, 0.0), frequency),)
    law = TorqueLaw((0.0, 0.0, 2.0), (0.0, 0.0, -4.0 / time), *waves)
    scene = Scene("", (0.3, -1.1, 2.2), moments=(2.0, 2.0, 2.0), torque=law)
    found = reference(scene, [time])
    with mpmath.workdps(700):
        t, f, slope = mpmath.mpf(time), mpmath.mpf(frequency), mpmath.mpf(law.rate[2])
        pushes = [(1 - mpmath.cos(f * t)) / f, mpmath.sin(f * t) / f, 2 * t + slope * t * t / 2]
        wanted = [float(w + push / 2) for w, push in zip(scene.omega, pushes, strict=True)]
    # The terms of axis 3 cancel, except for the rounding error of the rate.
    np.testing.assert_allclose(found.omega[0], wanted, rtol=2e-16)


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("case", "times", "precise"), [(3, [0.37, 1.0, 3.0], False), (4, [3.0, 20.0], True)]
)
def test_torque_free_top_agrees_with_jacobis_elliptic_functions(
    case: int, times: list[float], precise: bool
) -> None:
    """Compare with an independent solution: mpmath's sn, cn, dn, from omega(0) = (0, b, c)."""
    scene = case_scene(case)
    found = reference(scene, times, precise=precise)
    with mpmath.workdps(45):
        i1, i2, i3 = (mpmath.mpf(i) for i in scene.moments or ())
        _, w2, w3 = (mpmath.mpf(w) for w in scene.omega)
        # omega1 = a sn(rate t), omega2 = w2 cn(rate t), omega3 = w3 dn(rate t): spin near axis 3,
        # the smallest; signs and sizes follow from d(sn) = cn dn and the equations at t = 0.
        rate = mpmath.sqrt((i2 - i3) * (i1 - i3) / (i1 * i2)) * w3
        amplitude = (i2 - i3) / i1 * w2 * w3 / rate
        parameter = (i1 - i2) / i3 * amplitude * w2 / (-w3 * rate)
        for row, t in enumerate(times):
            phase = rate * mpmath.mpf(t)
            parts = zip((amplitude, w2, w3), ("sn", "cn", "dn"), _whole(found, row), strict=True)
            for size, function, value in parts:
                wanted = size * mpmath.ellipfun(function, phase, m=parameter)
                assert abs(value - wanted) < (1e-25 if precise else found.estimate + 1e-30)


@pytest.mark.campaign
def test_case_7_agrees_with_mpmaths_own_integrator_to_25_digits() -> None:
    scene = case_scene(7)
    found = reference(scene, [0.05], precise=True)
    with mpmath.workdps(32):
        i1, i2, i3 = (mpmath.mpf(i) for i in scene.moments or ())

        def rate(t: mpmath.mpf, w: list[mpmath.mpf]) -> list[mpmath.mpf]:
            return [
                ((i2 - i3) * w[1] * w[2] + mpmath.sin(100 * t)) / i1,
                ((i3 - i1) * w[0] * w[2] + mpmath.cos(100 * t)) / i2,
                ((i1 - i2) * w[0] * w[1] + t) / i3,
            ]

        solution = mpmath.odefun(rate, 0, [mpmath.mpf(w) for w in scene.omega])
        for value, wanted in zip(_whole(found, 0), solution(mpmath.mpf(0.05)), strict=True):
            assert abs(value - wanted) < 1e-25


def test_sine_and_cosine_have_all_their_digits() -> None:
    with decimal.localcontext(prec=40), mpmath.workdps(60):
        for angle in ("0", "1e-30", "0.5", "-3.14159265358979", "1e15", "-123456.789", "7e25"):
            pairs = zip(sine_cosine(Decimal(angle)), (mpmath.sin, mpmath.cos), strict=True)
            for found, function in pairs:
                assert abs(mpmath.mpf(str(found)) - function(mpmath.mpf(angle))) < 1e-38


@pytest.mark.parametrize("number", [1, 2])
def test_series_for_the_velocity_is_estimated_where_omega_is_known(number: int) -> None:
    # With this mass no acceleration is a short decimal; in Case 1 nothing would be rounded.
    found = reference(replace(case_scene(number), masses=(110.0,) * 3), [1.0], velocity=True)
    assert found.source == "known solution"
    assert 0.0 < found.estimate < 1e-18


def test_every_second_term_may_be_zero() -> None:
    """From rest a constant torque makes omega odd in time."""
    law = TorqueLaw((1.0, 2.0, 3.0))
    scene = Scene("odd", (0.0, 0.0, 0.0), moments=(3.0, 2.0, 1.0), torque=law)
    wanted = integer_series(scene, [3.0]).omega
    np.testing.assert_allclose(reference(scene, [3.0]).omega, wanted, rtol=1e-15)


def test_velocity_of_a_steady_spin_goes_round_as_it_must() -> None:
    """V' = F/m - omega x V with F along the first axis: a circle, behind the force."""
    scene = Scene("", (0.0, 0.0, 2.0), (3.0,) * 3, masses=(5.0,) * 3, forces=(7.0, 0.0, 0.0))
    found: Any = reference(scene, [0.4, 1.0], velocity=True).velocity
    for time, row in zip((0.4, 1.0), found, strict=True):
        size = 7.0 / 5.0 / 2.0
        wanted = (size * math.sin(2.0 * time), size * (math.cos(2.0 * time) - 1.0), 0.0)
        assert row == pytest.approx(wanted, abs=1e-15)


@pytest.mark.sampled
@pytest.mark.parametrize(("case", "time"), [(2, 7.0), (3, -4.0), (4, 7.0)])
def test_attitude_is_that_of_verified_steps(case: int, time: float) -> None:
    scene: Any = replace(case_scene(case), attitude=(0.5, -0.1, 0.7, 0.5))
    found: Any = reference(scene, [0.5 * time, time])
    _, wanted = joint(scene.moments, scene.omega, scene.attitude, time)
    assert found.attitude[1] == pytest.approx([float(x) for x in wanted], abs=2e-16)
    assert 0.0 < found.angle_estimate < 1e-18
    # Omega does not change, and has the same source.
    bare = reference(case_scene(case), [0.5 * time, time])
    assert (found.omega == bare.omega).all()
    assert found.source == bare.source


def test_attitude_of_a_body_that_is_pushed_about_one_axis() -> None:
    """From rest omega3 = t**2 / 4 + t / 2; the angle is its integral, the body is upside down."""
    law = TorqueLaw((0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    scene = Scene("", (0.0, 0.0, 0.0), moments=(3.0, 2.0, 2.0), torque=law)
    found: Any = reference(replace(scene, attitude=(0.0, 0.0, 0.0, 1.0)), [1.0, 2.0]).attitude
    for time, row in zip((1.0, 2.0), found, strict=True):
        half = 0.5 * (time**3 / 12.0 + time**2 / 4.0)
        assert row == pytest.approx([-math.sin(half), 0.0, 0.0, math.cos(half)], abs=2e-16)


def test_known_solution_ends_where_binary64_does() -> None:
    law = TorqueLaw((0.0, 9.0, 0.0), (0.0, 0.0, 9.0))
    scene = Scene("", (7.0, 1.0, 0.0), coefficients=(0.0, 0.0, 0.0), torque=law)
    found = reference(scene, [1.0, 1e150, 1e160, 1e300])
    assert found.time.tolist() == [1.0, 1e150]
    assert np.isfinite(found.omega).all()
    assert solve(scene, [1.0, 1e160], "reference").ended == "overflow"


def test_a_torque_that_rounding_makes_0_does_not_shorten_steps_for_ever() -> None:
    """Regression test: the steps of a body at rest were halved without an end."""
    torque = recorded(lambda t, w: [0.0, 0.0, 1.0 + np.tanh((t - 10.0) / 0.2)])
    switched = Scene("", (0.0, 0.0, 0.0), moments=(2.0, 2.0, 1.0), torque=torque)
    assert reference(switched, [20.0]).omega[-1] == pytest.approx([0.0, 0.0, 20.0], abs=1e-14)
