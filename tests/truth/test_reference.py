"""The reference against closed forms, against mpmath, and its own estimate against the truth."""

import math

import mpmath
import numpy as np
import pytest

from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, TorqueLaw
from pyharness.model.scene_file import case_scene
from pyharness.truth import reference as room
from pyharness.truth.decimal_functions import sine_cosine
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import reference


def test_case_1_is_linear_and_case_2_is_a_circle() -> None:
    scene = case_scene(1)
    np.testing.assert_array_equal(reference(scene, [1.0, 2.0]).omega, [[3.5] * 3, [6.0] * 3])
    scene = case_scene(2)
    times = scene.times()
    wanted = [[math.sin(5 * t), math.cos(5 * t), 10.0] for t in times]
    np.testing.assert_allclose(reference(scene, times).omega, wanted, rtol=0, atol=1e-15)


@pytest.mark.parametrize("case", [1, 2])
def test_series_agrees_with_the_known_solution(case: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two derivations that share only the arithmetic; the estimate bounds their difference."""
    scene = case_scene(case)
    known = reference(scene, scene.times())
    assert known.source == "known solution"
    monkeypatch.setattr(room, "known_solution", lambda *_: None)
    series = reference(scene, scene.times())
    assert series.source.startswith("Taylor")
    assert np.abs(series.omega - known.omega).max() <= series.error + known.error
    assert series.estimate < 1e-16


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_symmetric_body_about_every_axis(
    axes: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    moments = [0.0, 0.0, 0.0]
    for place, moment in zip(axes, (30.0, 30.0, 70.0), strict=True):
        moments[place] = moment
    scene = Scene("", (0.3, -1.1, 2.2), moments=(moments[0], moments[1], moments[2]))
    known = reference(scene, [0.5, 7.0])
    assert known.source == "known solution"
    monkeypatch.setattr(room, "known_solution", lambda *_: None)
    np.testing.assert_allclose(reference(scene, [0.5, 7.0]).omega, known.omega, rtol=1e-15)


@pytest.mark.parametrize("time", [1e20, 1e39, 1e40, -1e41, 1e100, 1e300])
@pytest.mark.parametrize("third", [10.0, 10.1, -1e30, 1e-200])
def test_a_symmetric_body_after_any_time(time: float, third: float) -> None:
    """The phase has as many digits before the point, and 40 after it are needed."""
    scene = Scene("", (0.3, 1.0, third), moments=(40.0, 40.0, 20.0))
    found = reference(scene, [time])
    with mpmath.workdps(700):
        phase = mpmath.mpf(third) / 2 * mpmath.mpf(time)
        sine, cosine = mpmath.sin(phase), mpmath.cos(phase)
        wanted = [mpmath.mpf(0.3) * cosine + sine, cosine - mpmath.mpf(0.3) * sine]
        off = [abs(x - y) for x, y in zip(_whole(found, 0)[:2], wanted, strict=True)]
        assert max(off) < 1e-31
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
    # The terms of axis 3 cancel but for what rounding left of the rate.
    np.testing.assert_allclose(found.omega[0], wanted, rtol=2e-16)


def test_sphere_under_every_kind_of_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    law = TorqueLaw(
        (1.0, -2.0, 3.0), (0.5, 0.0, -1.0), (((1.0, 2.0, 3.0), 3.0), ((1.0, 0.0, 0.0), 0.0)),
        (((3.0, 2.0, 1.0), 5.0), ((0.0, 1.0, 0.0), 0.0)),
    )  # fmt: skip
    scene = Scene("", (0.3, -1.1, 2.2), moments=(2.0, 2.0, 2.0), torque=law)
    known = reference(scene, [-2.0])
    monkeypatch.setattr(room, "known_solution", lambda *_: None)
    np.testing.assert_allclose(reference(scene, [-2.0]).omega, known.omega, rtol=1e-15)


@pytest.mark.parametrize("case", [3, 4])
def test_torque_free_top_agrees_with_jacobis_elliptic_functions(case: int) -> None:
    """A second, independent way: mpmath's sn, cn, dn in 30 digits, from omega(0) = (0, b, c)."""
    scene = case_scene(case)
    times = [0.37, 1.0, 3.0]
    found = reference(scene, times)
    with mpmath.workdps(30):
        i1, i2, i3 = (mpmath.mpf(i) for i in scene.moments or ())
        _, w2, w3 = (mpmath.mpf(w) for w in scene.omega)
        # omega1 = a sn(rate t), omega2 = w2 cn(rate t), omega3 = w3 dn(rate t): spin near axis 3,
        # the smallest; signs and sizes follow from d(sn) = cn dn and the equations at t = 0.
        cn_rate = (i2 - i3) * (i1 - i3) / (i1 * i2)
        rate = mpmath.sqrt(cn_rate) * w3
        amplitude = (i2 - i3) / i1 * w2 * w3 / rate
        parameter = (i1 - i2) / i3 * amplitude * w2 / (-w3 * rate)
        for t, row in zip(times, found.omega, strict=True):
            wanted = [
                amplitude * mpmath.ellipfun("sn", rate * t, m=parameter),
                w2 * mpmath.ellipfun("cn", rate * t, m=parameter),
                w3 * mpmath.ellipfun("dn", rate * t, m=parameter),
            ]
            for value, exact in zip(row, wanted, strict=True):
                assert abs(mpmath.mpf(float(value)) - exact) <= found.error


def test_case_7_agrees_with_mpmaths_own_taylor_solver() -> None:
    """Torque that varies: another program's integrator in 25 digits."""
    scene = case_scene(7)
    found = reference(scene, [0.1])
    with mpmath.workdps(25):
        i1, i2, i3 = (mpmath.mpf(i) for i in scene.moments or ())

        def rate(t: mpmath.mpf, w: list[mpmath.mpf]) -> list[mpmath.mpf]:
            return [
                ((i2 - i3) * w[1] * w[2] + mpmath.sin(100 * t)) / i1,
                ((i3 - i1) * w[0] * w[2] + mpmath.cos(100 * t)) / i2,
                ((i1 - i2) * w[0] * w[1] + t) / i3,
            ]

        solution = mpmath.odefun(rate, 0, [mpmath.mpf(w) for w in scene.omega], degree=16)
        exact = solution(mpmath.mpf(0.1))
        for value, wanted in zip(found.omega[0], exact, strict=True):
            assert abs(mpmath.mpf(float(value)) - wanted) <= found.error


def test_velocity_keeps_its_own_invariant() -> None:
    """Without forces |V| would be constant; with them d|V|**2/dt = 2 V . F/m at the start is 0."""
    scene = case_scene(4)
    found = reference(scene, [1e-6], velocity=True)
    assert found.velocity is not None
    acceleration = np.array(scene.forces) / np.array(scene.masses)
    np.testing.assert_allclose(found.velocity[0], acceleration * 1e-6, rtol=1e-4)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_solution_that_blows_up_ends_before(direction: float) -> None:
    """The solution is 1 / (1 - t) on every axis."""
    start = (direction, direction, direction)
    scene = Scene("", start, coefficients=(1.0, 1.0, 1.0))
    found = reference(scene, [0.5 * direction, 0.9 * direction, 1.5 * direction])
    np.testing.assert_allclose(found.omega, np.array([[2.0] * 3, [10.0] * 3]) * direction)


@pytest.mark.parametrize("times", [[0.2, 0.1], [-1.0, 1.0], [-1.0, 2.0], [0.5, 0.5]])
def test_times_must_lead_away_from_zero(times: list[float]) -> None:
    with pytest.raises(InputError, match="away from 0"):
        reference(case_scene(3), times)


def test_too_long_a_time_is_refused_at_once() -> None:
    with pytest.raises(InputError, match="Taylor steps"):
        reference(case_scene(3), [1e9])


def test_sine_and_cosine_have_all_their_digits() -> None:
    import decimal
    from decimal import Decimal

    with decimal.localcontext(prec=40), mpmath.workdps(60):
        for angle in ("0", "1e-30", "0.5", "-3.14159265358979", "1e15", "-123456.789", "7e25"):
            sine, cosine = sine_cosine(Decimal(angle))
            assert abs(mpmath.mpf(str(sine)) - mpmath.sin(mpmath.mpf(angle))) < 1e-38
            assert abs(mpmath.mpf(str(cosine)) - mpmath.cos(mpmath.mpf(angle))) < 1e-38


def _whole(found: room.Reference, row: int) -> list[mpmath.mpf]:
    """Return the reference to all the digits that it carries."""
    assert found.remainder is not None
    return [
        mpmath.mpf(float(high)) + mpmath.mpf(float(low))
        for high, low in zip(found.omega[row], found.remainder[row], strict=True)
    ]


def test_precise_series_agrees_with_jacobis_functions_to_25_digits() -> None:
    """Case 4 over 100 s: closed form against series, in different arithmetics."""
    scene = case_scene(4)
    times = [3.0, 100.0]
    found = reference(scene, times, precise=True)
    assert found.estimate < 1e-25
    with mpmath.workdps(45):
        i1, i2, i3 = (mpmath.mpf(i) for i in scene.moments or ())
        _, w2, w3 = (mpmath.mpf(w) for w in scene.omega)
        rate = mpmath.sqrt((i2 - i3) * (i1 - i3) / (i1 * i2)) * w3
        amplitude = (i2 - i3) / i1 * w2 * w3 / rate
        parameter = (i1 - i2) / i3 * amplitude * w2 / (-w3 * rate)
        for row, t in enumerate(times):
            phase = rate * mpmath.mpf(t)
            wanted = [
                amplitude * mpmath.ellipfun("sn", phase, m=parameter),
                w2 * mpmath.ellipfun("cn", phase, m=parameter),
                w3 * mpmath.ellipfun("dn", phase, m=parameter),
            ]
            for value, exact in zip(_whole(found, row), wanted, strict=True):
                assert abs(value - exact) < mpmath.mpf("1e-25")


def test_precise_series_agrees_with_extrapolation_to_25_digits() -> None:
    """Case 7, torque and all: modified midpoint steps, extrapolated by Neville's scheme."""
    scene = case_scene(7)
    found = reference(scene, [0.05], precise=True)
    with mpmath.workdps(45):
        moments = [mpmath.mpf(i) for i in scene.moments or ()]

        def rate(t: mpmath.mpf, w: list[mpmath.mpf]) -> list[mpmath.mpf]:
            i1, i2, i3 = moments
            return [
                ((i2 - i3) * w[1] * w[2] + mpmath.sin(100 * t)) / i1,
                ((i3 - i1) * w[0] * w[2] + mpmath.cos(100 * t)) / i2,
                ((i1 - i2) * w[0] * w[1] + t) / i3,
            ]

        end = mpmath.mpf(0.05)
        rows: list[list[mpmath.mpf]] = []
        counts = [4 * k for k in range(2, 20)]
        for n in counts:
            h = end / n
            before = [mpmath.mpf(w) for w in scene.omega]
            now = [w + h * f for w, f in zip(before, rate(mpmath.mpf(0), before), strict=True)]
            for k in range(1, n):
                slope = rate(k * h, now)
                before, now = (
                    now,
                    [w + 2 * h * f for w, f in zip(before, slope, strict=True)],
                )
            slope = rate(end, now)
            rows.append([(w + v + h * f) / 2 for w, v, f in zip(now, before, slope, strict=True)])
        # The error is a series in h**2: extrapolate each component to h = 0.
        for axis, value in enumerate(_whole(found, 0)):
            column = [row[axis] for row in rows]
            for level in range(1, len(counts)):
                column = [
                    column[i + 1]
                    + (column[i + 1] - column[i])
                    / ((mpmath.mpf(counts[i + level]) / counts[i]) ** 2 - 1)
                    for i in range(len(column) - 1)
                ]
            assert abs(column[0] - value) < mpmath.mpf("1e-25")


@pytest.mark.parametrize("number", [1, 2])
def test_series_for_the_velocity_is_estimated_where_omega_is_known(number: int) -> None:
    found = reference(case_scene(number), [1.0], velocity=True)
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
    scene = Scene(
        "steady", (0.0, 0.0, 2.0), (3.0, 3.0, 3.0), masses=(5.0,) * 3, forces=(7.0, 0.0, 0.0)
    )
    found = reference(scene, [0.4, 1.0], velocity=True).velocity
    assert found is not None
    for time, row in zip((0.4, 1.0), found, strict=True):
        size = 7.0 / 5.0 / 2.0
        wanted = (size * math.sin(2.0 * time), size * (math.cos(2.0 * time) - 1.0), 0.0)
        assert row == pytest.approx(wanted, abs=1e-15)
