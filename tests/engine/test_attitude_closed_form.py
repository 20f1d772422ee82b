"""Attitude without torque in closed form: compared with exact series, and by invariants.

Invariants are no proof: a wrong rate of rotation keeps all of them except Montgomery's.
"""

import itertools
import math
import random
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import Scene
from pyharness.checks.scenes.extreme import quarter
from pyharness.engine.methods.closed_form import known_solution
from pyharness.model.errors import TimedError
from pyharness.model.extension import extension
from pyharness.model.trajectory import Array
from pyharness.truth.elliptic import torque_free
from pyharness.truth.free_attitude import free_attitude
from tests.attitude_errors import errors, largest_error
from tests.checks.scenes.free_motions import KINDS, Motion, draw
from tests.exact_attitude import exact, joint, times

_BOUND = 2e-15
_OMEGA_BOUND = 2e-14
_BODY = (0.7, 1.9, 2.3)
_START = (1.1, -0.6, 0.9)
_IDENTITY = (1.0, 0.0, 0.0, 0.0)


def closed_form_attitude(
    moments: Any, omega0: Any, attitude0: Any, times: Any
) -> tuple[Array, Array]:
    """Return omega and attitude at times in any order."""
    found: Any = known_solution(Scene("", omega0, moments=moments, attitude=attitude0), times, 1.0)
    return found.omega, found.attitude


def _product(p: Array, q: Array) -> Array:
    return np.array(times([*p.T], [*q.T])).T


def _in_space(q: Array, v: Array) -> Array:
    vectors = np.concatenate([np.zeros((len(v), 1)), v], axis=1)
    return _product(_product(q, vectors), q * [1.0, -1.0, -1.0, -1.0])[:, 1:]


def test_two_references_agree() -> None:
    source = random.Random(4)
    for kind in ("generic", "near symmetry", "near separatrix", "flat", "steady", "symmetric"):
        moments, omega, attitude, _ = draw(source, kind)
        time = source.uniform(-1.0, 1.0)
        one, other = (f(moments, omega, attitude, time) for f in (joint, exact))
        for x, y in zip([*one[0], *one[1]], [*other[0], *other[1]], strict=True):
            assert abs(x - y) < mpmath.mpf(10) ** -40, kind


@pytest.mark.sampled
@pytest.mark.property
@pytest.mark.parametrize("kind", KINDS)
def test_any_body_at_any_time(kind: str) -> None:
    """`python -m tests.attitude_errors` tries more."""
    source = random.Random(kind)
    for _ in range(8):
        motion = draw(source, kind)
        of_attitude, of_omega = errors(motion)
        assert of_attitude <= _BOUND, motion
        assert of_omega <= _OMEGA_BOUND, motion


@pytest.mark.sampled
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_any_order_and_sign_of_axes(order: tuple[int, ...], turned: bool) -> None:
    """Test both regions of the motion, all octants of the start, all quarters of the period."""
    moments = [(0.7, 1.9, 2.3)[axis] for axis in order]
    start = (1.9, -0.6, 0.4) if turned else (0.4, -0.6, 1.9)
    every = itertools.product((1.0, -1.0), repeat=3)
    for signs, time in zip(every, itertools.cycle((0.7, -2.1, 3.3)), strict=False):
        omega = [s * start[axis] for s, axis in zip(signs, order, strict=True)]
        assert max(errors((moments, omega, [0.5, -0.1, 0.3, 0.7], time))) <= 1e-15


@pytest.mark.parametrize("start", [(1.0, 2.0, 0.3), (0.2, 1.9, -1.0), (1e-7, -3.0, 2e-7)])
def test_montgomery_s_angle(start: tuple[float, float, float]) -> None:
    """After a period of omega the body has rotated about L by 2 T t/L less the solid angle of L."""
    moments = np.array(_BODY)
    with mpmath.workdps(30):
        d12, d13, d23 = (abs(_BODY[a] - _BODY[b]) for a, b in ((0, 1), (0, 2), (1, 2)))
        i, w = _BODY, start
        gap = i[0] * w[0] ** 2 * d12 - i[2] * w[2] ** 2 * d23
        if gap > 0:
            d12, d23, i, w = d23, d12, i[::-1], w[::-1]
        e3 = d13 * i[2] * w[2] ** 2 + d12 * i[1] * w[1] ** 2
        rate = mpmath.sqrt(d23 * e3 / (i[0] * i[1] * i[2]))
        comodulus = mpmath.sqrt(d13 * abs(gap) / (d23 * e3))
        period = float(2 * mpmath.pi / (rate * mpmath.agm(1, comodulus)))
    count = 4000
    times = period * np.arange(count + 1) / count
    omega, attitude = closed_form_attitude(_BODY, start, _IDENTITY, times)
    np.testing.assert_allclose(omega[-1], start, rtol=0, atol=1e-13)
    momentum = omega * moments
    size = math.hypot(*momentum[0])
    axis = 2 if gap < 0 else 0
    m, slope = momentum / size, np.cross(momentum, omega) / size
    x, y, z = m[:, (axis + 1) % 3], m[:, (axis + 2) % 3], m[:, axis]
    sign = np.sign(z[0])
    around = sign * (x * slope[:, (axis + 2) % 3] - y * slope[:, (axis + 1) % 3]) / (x * x + y * y)
    # For a periodic function the trapezoidal rule has all digits.
    solid = period * np.mean(((1.0 - sign * z) * around)[:-1])
    wanted = float(np.sum(moments * np.array(start) ** 2)) * period / size - solid
    end = attitude[-1]
    found = 2.0 * math.atan2(float(end[1:] @ m[0]), float(end[0]))
    assert abs(math.remainder(found - wanted, 2.0 * math.pi)) < 1e-12


@pytest.mark.parametrize(
    "start", [(1.0, 2.0, 0.3), (0.2, 1.9, -1.0), (1e-7, -3.0, 2e-7), (0.0, 0.0, 3.0)]
)
def test_nothing_jumps_and_what_stays_stays(start: tuple[float, float, float]) -> None:
    times = np.linspace(-60.0, 60.0, 40001)
    omega, attitude = closed_form_attitude(_BODY, start, (0.1, 0.2, -0.7, 0.3), times)
    np.testing.assert_allclose(np.linalg.norm(attitude, axis=1), 1.0, rtol=0, atol=1e-15)
    # q' = q omega/2, so that a change of sign or a kink would be seen.
    step = np.linalg.norm(np.diff(attitude, axis=0), axis=1)
    speed = np.linalg.norm(omega, axis=1)
    np.testing.assert_allclose(step, (speed[1:] + speed[:-1]) * 0.003 / 4.0, rtol=1e-4)
    vectors = np.concatenate([np.zeros((len(omega), 1)), omega], axis=1)
    slope = _product(attitude, vectors)[1:-1] / 2.0
    np.testing.assert_allclose((attitude[2:] - attitude[:-2]) / 0.006, slope, rtol=0, atol=3e-4)
    momentum = _in_space(attitude, omega * np.array(_BODY))
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=3e-14)


def test_the_start_is_given_back() -> None:
    omega, attitude = closed_form_attitude(_BODY, _START, (0.0, 0.0, 3.0, -4.0), [0.0, -0.0])
    np.testing.assert_array_equal(omega, [_START] * 2)
    np.testing.assert_array_equal(attitude, [(0.0, 0.0, 0.6, -0.8)] * 2)


SPECIAL: dict[str, Motion] = {
    "middle axis, exactly": ([0.7, 1.9, 2.3], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0, 0.0], 1e5),
    "about the axis of a symmetric body": ([1.9, 1.9, 2.3], [0.0, 0.0, -2.0], [1.0, 2, 3, 4], 9.0),
    "across that axis": ([1.9, 1.9, 2.3], [1.0, -2.0, 0.0], [1.0, 2.0, 3.0, 4.0], -9.0),
    "across it, tall": ([1.9, 1.1, 1.9], [1.0, 0.0, -2.0], [1.0, 2.0, 3.0, 4.0], -9.0),
    "at rest": ([0.7, 1.9, 2.3], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -2.0], 5.0),
    "at the separatrix": ([1.0, 2.0, 3.0], [1.5, 0.4, math.nextafter(math.sqrt(0.75), 1)],
                          [1.0, 0.0, 1.0, 0.0], 7.0),
    "separatrix": ([1.0, 2.0, 4.0], [2.0, 0.5, -math.sqrt(0.5)], [1.0, 0.0, 1.0, 0.0], -3.0),
    "separatrix, exactly": ([1.0, 3.0, 4.0], [2.0, 0.5, -math.sqrt(2.0)], [1, 0.0, 1.0, 0.0], 3.0),
    "separatrix, whole": ([1.0, 5.0, 9.0], [-3.0, 0.5, 1.0], [1.0, 0.0, 1.0, 0.0], 2.0),
    "separatrix, back": ([9.0, 5.0, 1.0], [-1.0, -0.5, -3.0], [1.0, 0.0, 1.0, 0.0], -15.0),
}  # fmt: skip


@pytest.mark.parametrize("case", SPECIAL)
def test_special_motions(case: str) -> None:
    of_attitude, of_omega = errors(SPECIAL[case])
    assert of_attitude <= 1e-15
    assert of_omega <= 1e-15


@pytest.mark.parametrize("power", [-900, -300, 400, 900])
@pytest.mark.parametrize("moments_power", [0, -900, 900])
def test_powers_of_two_scale_to_the_last_bit(power: int, moments_power: int) -> None:
    times = np.array([-3.0, 0.1, 70.0])
    omega, attitude = closed_form_attitude(_BODY, _START, _IDENTITY, times)
    factor = 2.0**power
    found, turned = closed_form_attitude(
        np.array(_BODY) * 2.0**moments_power, np.array(_START) * factor,
        np.array(_IDENTITY) * 2.0**power, times / factor,
    )  # fmt: skip
    np.testing.assert_array_equal(found, omega * factor)
    np.testing.assert_array_equal(turned, attitude)


@pytest.mark.parametrize("size", [1e-9, 1e-20, 1e-50, 1e-100, 1e-118])
def test_faint_disturbances_grow_as_they_should(size: float) -> None:
    for motion in (
        ([1.0, 2.0, 3.0], [size, 1.0, 0.3 * size], [1.0, 0.0, 0.0, 0.0], 2.0),
        ([1.0, 2.0, 3.0], [0.3 * size, 0.2 * size, 1.0], [1.0, 0.0, 0.0, 0.0], 2e5),
    ):
        assert max(errors(motion)) <= 1e-15


@pytest.mark.parametrize("radians", [1e9, 1e12, 1e14])
def test_phase_of_any_length(radians: float) -> None:
    source = random.Random(str(radians))
    for _ in range(8):
        moments, omega, attitude, _ = draw(source, "generic")
        time = radians / max(map(abs, omega)) / 10.0
        # The angle of the attitude is some multiple of this.
        assert errors((moments, omega, attitude, time))[0] <= 2e-15 + 1e-29 * radians


def test_where_no_digit_is_left() -> None:
    entry = extension().torque_free_attitude_solution
    assert entry(_BODY, _START, _IDENTITY, [1.0, 1e17])[2:] == (1, 4)
    assert entry((1.0, 1.0, 1.0), _START, _IDENTITY, [1.0, 1e17])[2:] == (1, 4)
    with pytest.raises(TimedError, match=r"at t = 1e\+17 s the phase"):
        closed_form_attitude(_BODY, _START, _IDENTITY, [1.0, 1e17])


@pytest.mark.parametrize(("moments", "omega", "attitude", "status"), [
    ((1.0, 2.0, 0.0), _START, _IDENTITY, 3),
    ((1.0, 2.0, math.inf), _START, _IDENTITY, 3),
    ((1.0, 2.0, 1e-40), _START, _IDENTITY, 3),
    (_BODY, (1.0, math.inf, 1.0), _IDENTITY, 3),
    (_BODY, _START, (0.0, 0.0, 0.0, 0.0), 3),
    (_BODY, _START, (0.0, -math.inf, 0.0, 1.0), 3),
    (_BODY, (1e-130, 1.0, 0.0), _IDENTITY, 3),
    (_BODY, (0.0, 1.0, 1e-170), _IDENTITY, 3),
    ((1e-20, 1.0, 2.0), (1e303, 1e308, 1.7e308), _IDENTITY, 2),
])  # fmt: skip
def test_what_can_not_be_done_is_said(
    moments: tuple[float, ...], omega: tuple[float, ...], attitude: tuple[float, ...], status: int
) -> None:
    entry = extension().torque_free_attitude_solution
    assert entry(moments, omega, attitude, [1e-305 if status == 2 else 1.0])[2:] == (0, status)


def test_errors_are_found() -> None:
    """Test the measure itself, by a quaternion with a wrong third-last digit."""
    _, wanted = exact(list(_BODY), list(_START), [1.0, 0.0, 0.0, 0.0], 1.0)
    found = np.array([float(x) for x in wanted])
    assert largest_error(found, wanted) < 1.2e-16
    found[2] += 1e-13
    assert largest_error(found, wanted) > 9e-14


@pytest.mark.parametrize(("power", "flips"), [(1, 1.0), (4, 9.0), (15, 1.0)])
def test_flips_beside_the_separatrix_are_where_they_are(power: int, flips: float) -> None:
    """A flip starts 35 of its radians away: a phase in double precision would miss it by 1e-14."""
    omega = (10.0**-power, 1.0, 0.0)
    scene = Scene("", omega, moments=(6.0, 5.0, 2.0), attitude=(0.5, -0.1, 0.7, 0.5))
    time = flips * quarter(10.0**-power)
    found: Any = known_solution(scene, [time], 1.0)
    wanted = [float(x) for x in free_attitude(scene, time)]
    assert found.attitude[0] == pytest.approx(wanted, abs=8e-16)
    wanted = [float(x) for x in torque_free(scene, time)]
    assert found.omega[0] == pytest.approx(wanted, abs=8e-16)
