"""Closed forms: compared with mpmath and the reference, and checked by their own symmetries.

The bound is on the evaluation: sixteen roundings of the largest angular velocity of the motion, at
any time.
"""

import math
import random
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, prepare, solve
from pyharness.model.errors import TimedError
from pyharness.model.extension import extension
from pyharness.model.scene import Triple
from pyharness.model.trajectory import Array
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import reference
from tests.checks.scenes.free_motions import draw, draw_top
from tests.exact_tops import DIGITS, exact_top

_UNIT = 2.0**-53
_BOUND = 16 * _UNIT


def _at(coefficients: Triple, omega: Triple, time: float) -> Array:
    rows, n_rows, status = extension().torque_free_solution(coefficients, omega, [time])
    assert (n_rows, status) == (1, 0)
    row: Array = rows[:, 0]
    return row


def _error(found: Array, exact: list[mpmath.mpf], omega: Triple) -> float:
    """Return the largest error relative to the largest angular velocity seen."""
    largest = max(*map(abs, exact), *map(abs, omega))
    return float(max(abs(float(x) - y) for x, y in zip(found, exact, strict=True)) / largest)


@pytest.mark.property
@pytest.mark.parametrize(
    "kind", ["plain", "middle axis", "near symmetry", "near separatrix", "wild"]
)
def test_any_top_at_any_time(kind: str) -> None:
    source = random.Random(kind)
    for _ in range(60):
        coefficients, omega, time = draw_top(source, kind)
        exact = exact_top(coefficients, omega, time)
        assert _error(_at(coefficients, omega, time), exact, omega) <= _BOUND, (
            coefficients, omega, time,
        )  # fmt: skip


@pytest.mark.parametrize("kind", ["generic", "near symmetry", "near separatrix", "needle"])
def test_moments_count_to_all_their_digits(kind: str) -> None:
    """A, B, C rounded to doubles cost 1e-11 by 1e6 s; a prepared solver has double-doubles too."""
    source = random.Random(kind)
    for _ in range(10):
        moments, omega, _, _ = draw(source, kind)
        time = source.choice((-1.0, 1.0)) * source.uniform(1e5, 1e6)
        scene = Scene("", omega, moments=moments)
        exact = [mpmath.mpf(str(x)) for x in torque_free(scene, time)]
        rows = solve(scene, [time], "closed-form", 1e-9).omega
        # For a needle, omega1 may be large at other times.
        bound = _BOUND * (10 if kind == "needle" else 1)
        assert _error(rows[0], exact, scene.omega) <= bound, scene
        np.testing.assert_array_equal(prepare(scene, "closed-form")(omega, time), rows[0])


def test_moments_of_any_size_have_their_second_words() -> None:
    moments, omega = (0.7, 1.9, 2.3), (1.1, -0.6, 0.9)
    near = solve(Scene("", omega, moments=moments), [1e6], "closed-form", 1e-9).omega
    for power in (-300, 200):
        far = Scene("", [x * 2.0**power for x in omega], moments=[x * 2.0**900 for x in moments])
        found = solve(far, [1e6 / 2.0**power], "closed-form", 1e-9).omega
        np.testing.assert_array_equal(found / 2.0**power, near)


@pytest.mark.parametrize("size", [1e-120, 1e-35])
def test_small_coefficients_have_their_second_words(size: float) -> None:
    a, low = (0.25, -2.0 / 3.0, 0.5), (1e-17, 3e-17, -2e-17)
    near = extension().torque_free_solution(a, (1.0, 0.3, -0.9), [1e6], coefficients_low=low)[0]
    factor = 2.0 ** round(math.log2(size))
    far = extension().torque_free_solution(
        [x * factor for x in a], (1.0, 0.3, -0.9), [1e6 / factor],
        coefficients_low=[x * factor for x in low],
    )[0]  # fmt: skip
    np.testing.assert_array_equal(far, near)


@pytest.mark.parametrize("power", [-990, -600, 500, 900])
def test_powers_of_two_scale_to_the_last_bit(power: int) -> None:
    a, w = (0.25, -2.0 / 3.0, 0.5), (0.1, 1.0, 10.0)
    factor = 2.0**power
    found = _at(a, (w[0] * factor, w[1] * factor, w[2] * factor), 3.0 / factor)
    np.testing.assert_array_equal(found, _at(a, w, 3.0) * factor)


@pytest.mark.parametrize(("coefficients", "wanted"), [
    ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)),
    ((0.5, 0.0, 0.0), (31.0, 2.0, 3.0)),
    ((0.0, 0.5, 0.0), (1.0, 17.0, 3.0)),
    ((0.0, 0.0, -0.5), (1.0, 2.0, -7.0)),
])  # fmt: skip
def test_a_single_coefficient_is_linear(coefficients: Triple, wanted: Triple) -> None:
    np.testing.assert_array_equal(_at(coefficients, (1.0, 2.0, 3.0), 10.0), wanted)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("signs", [(1.0, -1.0), (-1.0, 1.0)])
def test_symmetric_body_about_every_axis(axis: int, signs: tuple[float, float]) -> None:
    """Test unequal coefficients too, which no body has: the orbit is an ellipse."""
    a, w = [0.0, 0.0, 0.0], (0.7, -1.3, 2.1)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    a[j], a[k] = 0.75 * signs[0], 0.3 * signs[1]
    with mpmath.workdps(DIGITS):
        rate = mpmath.sqrt(-mpmath.mpf(a[j]) * mpmath.mpf(a[k]))
        angle = rate * mpmath.mpf(w[axis]) * 40
        exact = [mpmath.mpf(x) for x in w]
        sine, cosine = mpmath.sin(angle), mpmath.cos(angle)
        exact[j] = w[j] * cosine + mpmath.mpf(a[j]) / rate * w[k] * sine
        exact[k] = w[k] * cosine + mpmath.mpf(a[k]) / rate * w[j] * sine
    assert _error(_at((a[0], a[1], a[2]), w, 40.0), exact, w) <= _BOUND


@pytest.mark.parametrize(("coefficients", "omega", "time", "status"), [
    ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 0.5, 3),
    ((-1.0, -0.1, -1.0), (1.0, 1.0, 1.0), 0.5, 3),
    ((0.0, 1.0, 1.0), (1.0, 1.0, 1.0), 0.5, 3),
    ((1.0, -1.0, 0.5), (1e-200, 1.0, 0.0), 0.5, 3),
    ((1.0, -1.0, 0.5), (1e-130, 1.0, 0.0), 0.5, 3),
    ((1.0, -1.0, 0.5), (1.0, 1.0, 2.0), 1e17, 4),
    ((1.0, -1.0, 0.5), (1e150, 1e150, 2e150), 1.0, 4),
    ((1.0, -1.0, 0.5), (1e300, 1e300, 2e300), 1e300, 4),
    ((1.0, 0.0, 0.0), (1.0, 1e200, 1e200), 1.0, 2),
    ((1.0, -1e-6, 1e-4), (1.0, 1e308, 1e307), 1e-302, 2),
])  # fmt: skip
def test_what_can_not_be_done_is_said(
    coefficients: Triple, omega: Triple, time: float, status: int
) -> None:
    _, n_rows, ended = extension().torque_free_solution(coefficients, omega, [0.0, time])
    assert (n_rows, ended) == (0 if status == 3 else 1, status)
    end, ended = _packed_end(coefficients, omega, time)
    assert ended == status
    assert np.isnan(end).all()


def _packed_end(coefficients: Triple, omega: Triple, time: float) -> tuple[Array, int]:
    """Return omega and status at one time by the kernel of a solver, without `prepare`."""
    packed = np.zeros(20)
    packed[0] = 1.0
    packed[5:8] = coefficients
    found, status, *_ = extension().solve_packed(packed, np.array(omega), time)
    return found, status


@pytest.mark.parametrize("time", [-2.0, 1e-3, 50.0])
def test_sphere_under_every_kind_of_torque(time: float) -> None:
    law = TorqueLaw(
        (1.0, -2.0, 3.0), (0.5, 0.0, -1.0), (((1.0, 2.0, 3.0), 3.0), ((1.0, 0.0, 0.0), 0.0)),
        (((3.0, 2.0, 1.0), 1e6), ((0.0, 1.0, 0.0), 0.0)),
    )  # fmt: skip
    scene = Scene("", (0.3, -1.1, 2.2), moments=(2.0, 2.0, 2.0), torque=law)
    found = solve(scene, [time], "closed-form", 1e-9)
    # The terms of the sum may cancel. The last is half a rate of 1 over the moment 2, times t**2.
    terms = 2.2 + 1.5 * abs(time) + 0.25 * time * time
    np.testing.assert_allclose(
        found.omega, reference(scene, [time]).omega, rtol=0, atol=4 * _UNIT * terms
    )


def test_sphere_overflows_with_a_status() -> None:
    law = TorqueLaw(constant=(1e300, 0.0, 0.0))
    scene = Scene("", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=law)
    found = solve(scene, [1.0, 1e10], "closed-form", 1e-9)
    assert (found.ended, len(found.omega)) == ("overflow", 1)


def test_end_alone_and_rows_give_the_same_bits_in_any_thread() -> None:
    source = random.Random(2)
    tops = [draw_top(source, kind) for kind in ("plain", "middle axis") * 100]
    rows = [_at(*top).tobytes() for top in tops]
    with ThreadPoolExecutor(8) as pool:
        found = pool.map(lambda top: _packed_end(*top), [*tops, *tops])
        assert [(end.tobytes(), status) for end, status in found] == [(row, 0) for row in rows * 2]


@pytest.mark.parametrize("radians", [1e9, 1e11, 1e12, 1e13, 1e14, 4e14])
def test_error_does_not_depend_on_the_phase(radians: float) -> None:
    """Up to 1e15 rad, where the phase itself has no digit left: frequencies are double-doubles."""
    source = random.Random(str(radians))
    for _ in range(8):
        a = (source.uniform(0.1, 1.0), -source.uniform(0.1, 1.0), source.uniform(0.1, 1.0))
        w = (source.uniform(0.5, 2.0), source.uniform(-2.0, 2.0), source.uniform(0.5, 2.0))
        time = source.choice((-1.0, 1.0)) * radians
        exact = exact_top(a, w, time)
        assert _error(_at(a, w, time), exact, w) <= _BOUND, (a, w, time)
    # Later times are refused, and no earlier ones.
    scene = Scene("", w, coefficients=a)
    with pytest.raises(TimedError, match=r"at t = 1e\+16 s the phase"):
        solve(scene, [radians, 1e16, 1e17], "closed-form", 1e-9)


@pytest.mark.parametrize("time", [1e-3, 0.5, -2.0, 30.0, 300.0, -1000.0])
def test_small_components_beside_the_separatrix_keep_their_digits(time: float) -> None:
    """For A = C and omega1 = omega3, omega2 is r tanh; the others are r sech over the root of 2."""
    omega = (1.0, 0.3, 1.0)
    found = _at((0.25, -0.5, 0.25), omega, time)
    with mpmath.workdps(DIGITS):
        # omega2' = -omega1 omega3 / 2 and omega1' = omega2 omega1 / 4.
        size = mpmath.sqrt(mpmath.mpf(1) / 2 + mpmath.mpf(0.3) ** 2 / 4)
        phase = mpmath.atanh(mpmath.mpf(0.3) / 2 / size) - size / 2 * mpmath.mpf(time)
        small, large = size * mpmath.sqrt(2) / mpmath.cosh(phase), 2 * size * mpmath.tanh(phase)
        assert abs(float((found[0] - small) / small)) <= 4 * _UNIT
    assert _error(found, [small, large, small], omega) <= _BOUND


@pytest.mark.parametrize("disturbance", [1e-20, 1e-50, 1e-100, 1e-119])
@pytest.mark.parametrize("time", [0.5, -7.0])
def test_faint_disturbances_grow_as_they_should(disturbance: float, time: float) -> None:
    """The components grow as D cosh and d sinh; the neglected terms are of third order."""
    a, c = 1.0, 0.5
    rate = math.sqrt(a * c)
    found = _at((a, -1.0, c), (disturbance, 1.0, 0.0), time)
    grown = math.cosh(rate * time), math.sqrt(c / a) * math.sinh(rate * time)
    wanted = (disturbance * grown[0], 1.0, disturbance * grown[1])
    np.testing.assert_allclose(found, wanted, rtol=2e-15, atol=0.0)


@pytest.mark.campaign
def test_component_that_hardly_moves_is_rounded_once() -> None:
    """For a nearly round body only the decrease of omega3 is computed, not 1 less a little."""
    source = random.Random(9)
    for _ in range(200):
        difference = 10 ** source.uniform(-12, -1)
        a = (0.5, -0.5 * (1.0 + difference), 0.5 * difference)
        w = (source.uniform(0.1, 1.0), source.uniform(0.1, 1.0), source.uniform(1.0, 3.0))
        time = 10 ** source.uniform(-1, 3)
        exact = exact_top(a, w, time)[2]
        assert abs(float((_at(a, w, time)[2] - exact) / exact)) <= 1.5 * _UNIT


def test_what_the_sum_of_a_sphere_can_not_hold_is_added_at_the_end() -> None:
    """Sixteen increments, each a twentieth of a unit in the last place, make two thirds of one."""
    pushes = tuple(((0.0, 1e-17, 0.0), 0.0) for _ in range(16))
    scene = Scene("", (0.0, 1.0, 0.0), moments=(1.0,) * 3, torque=TorqueLaw(cosines=pushes))
    assert solve(scene, [1.0], "closed-form", 1e-9).omega[0, 1] == 1.0 + 2.0**-52


def test_amplification_before_the_last_time_counts_near_the_separatrix() -> None:
    moments = (1.908871055132049, 1.6944745539067607, 0.5085885178521218)
    omega = (0.0012638412446339218, -0.40645864143219074, -3.387026803568728e-05)
    scene = Scene("near the separatrix", omega, moments=moments)
    alone: Any = solve(scene, [9000.0], "closed-form", 1e-9)
    both: Any = solve(scene, [9000.0, 18365.77], "closed-form", 1e-9)
    assert both.growth >= alone.growth > 1e7
    # The closed form does not amplify its own rounding errors.
    assert alone.ended == both.ended == "complete"
    assert both.error == alone.error < 3e-15


@pytest.mark.filterwarnings("ignore::pyharness.ImpossibleBodyWarning")
@pytest.mark.parametrize(("moments", "omega", "time"), [
    ((8.3e20, 7.3e210, 1.0), (0.2, 0.0, -5.4e-12), 3e-11),
    ((3.2e-125, 1.45e23, 3.1e124), (-0.8, 0.056, 0.0), 1.1e-7),
    ((1.6e119, 6.4e-120, 2.8e119), (-1.1e-78, 2.2, -1.2e-67), 7.5e-23),
])  # fmt: skip
def test_coefficients_that_underflow_are_refused(
    moments: Triple, omega: Triple, time: float
) -> None:
    scene = Scene("", omega, moments=moments)
    with pytest.raises(InputError):
        solve(scene, [time], "closed-form")
    # A steady rotation has no rates that could be lost.
    steady = Scene("", (0.5, 0.0, 0.0), moments=moments)
    assert solve(steady, [time], "closed-form").omega.tolist() == [[0.5, 0.0, 0.0]]
