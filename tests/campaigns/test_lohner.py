"""Lohner's method against known solutions, against our reference, and with planted faults."""

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import product
from typing import Any

import mpmath
import pytest
from flint import arb, ctx

from pyharness import InputError, Scene, TorqueLaw, case_scene
from pyharness.truth.balls import ball, fraction
from pyharness.truth.reference import reference
from tests.campaigns import lohner
from tests.campaigns.lohner import (
    Euler,
    NotEnclosedError,
    Parallelepiped,
    enclosure,
    identity,
    main,
    wider,
)
from tests.exact_tops import exact_coefficients, exact_top

TOP = Scene("symmetric top", omega=(0.1, 1.0, 10.0), moments=(40.0, 40.0, 20.0))
WAVES = TorqueLaw(
    (1.0, -2.0, 0.3), (0.1, 0.0, -7.0), sines=[((3.0, 0.0, 1.0), 5.0), ((0.0, 1e-3, 0.0), 100.0)],
    cosines=[((0.0, 2.0, -1.0), 0.7)],
)  # fmt: skip


def all_inside(row: Sequence[Any], exact: Sequence[Any]) -> bool:
    """Return whether each ball contains the number of the same axis."""
    with mpmath.workdps(60):
        return all(
            abs(real(x.mid()) - value) <= real(x.rad()) for x, value in zip(row, exact, strict=True)
        )


def real(x: Any) -> Any:
    middle = fraction(x)
    return mpmath.mpf(middle.numerator) / middle.denominator


def largest_radius(row: Sequence[Any]) -> float:
    return max(float(x.rad()) for x in row)


def exact_symmetric_top(time: float) -> list[Any]:
    """Return omega of `TOP`, whose first two components rotate at 5 rad/s, to 60 digits."""
    with mpmath.workdps(60):
        x, y = mpmath.mpf(TOP.omega[0]), mpmath.mpf(TOP.omega[1])
        c, s = mpmath.cos(5 * mpmath.mpf(time)), mpmath.sin(5 * mpmath.mpf(time))
        return [c * x + s * y, c * y - s * x, mpmath.mpf(10)]


def exact_sphere(scene: Scene, time: float) -> list[Any]:
    """Return omega of a sphere under a torque law, to 60 digits: the integral of the torque."""
    assert scene.moments is not None
    with mpmath.workdps(60):
        t, found = mpmath.mpf(time), []
        for axis in range(3):
            impulse = scene.law.constant[axis] * t + scene.law.rate[axis] * t**2 / 2
            for amplitude, w in scene.law.sines:
                impulse += amplitude[axis] * (1 - mpmath.cos(w * t)) / w
            for amplitude, w in scene.law.cosines:
                impulse += amplitude[axis] * mpmath.sin(w * t) / w
            found.append(scene.omega[axis] + impulse / scene.moments[axis])
        return found


def test_symmetric_top_is_enclosed_without_wrapping() -> None:
    times = [0.0, 0.3, 5.0]
    for time, row in zip(times, enclosure(TOP, times, 20), strict=True):
        assert all_inside(row, exact_symmetric_top(time))
        assert largest_radius(row) < 1e-19


@pytest.mark.parametrize("time", [0.6, -0.6])
def test_sphere_under_torque_is_enclosed(time: float) -> None:
    scene = Scene("sphere", omega=(0.1, 0.2, -0.3), moments=(3.0, 3.0, 3.0), torque=WAVES)
    (row,) = enclosure(scene, [time], 20)
    assert all_inside(row, exact_sphere(scene, time))
    assert largest_radius(row) < 1e-19


def test_free_top_is_enclosed_as_by_elliptic_functions() -> None:
    scene = case_scene(3)
    (row,) = enclosure(scene, [1.0], 25)
    assert all_inside(row, exact_top(exact_coefficients((41.0, 39.0, 20.0)), scene.omega, 1.0))
    assert largest_radius(row) < 1e-25


def test_body_with_coefficients_is_enclosed_until_its_pole(monkeypatch: pytest.MonkeyPatch) -> None:
    # omega_i' = omega_j omega_k has the solution 1 / (1 - t).
    scene = Scene("pole", omega=(1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    (row,) = enclosure(scene, [0.75], 15)
    assert all_inside(row, [mpmath.mpf(4)] * 3)
    assert largest_radius(row) < 1e-13
    monkeypatch.setattr(lohner, "SMALLEST", 0.001)
    with pytest.raises(NotEnclosedError, match=r"too small at 0\.9"):
        enclosure(scene, [1.5], 8)


@pytest.mark.parametrize("case", [3, 5, 6, 7])
def test_enclosures_agree_with_the_precise_reference(case: int) -> None:
    scene = case_scene(case)
    known: Any = reference(scene, [0.25], precise=True)
    (row,) = enclosure(scene, [0.25], 25)
    for x, omega, rest in zip(row, known.omega[0], known.remainder[0], strict=True):
        error = known.estimate + math.ulp(rest)
        with mpmath.workdps(60):
            exact = mpmath.mpf(float(omega)) + mpmath.mpf(float(rest))
            assert abs(real(x) - exact) <= error + real(x.rad())
    assert largest_radius(row) < 1e-24


def test_a_priori_box_that_is_too_small_is_rejected() -> None:
    with ctx.workprec(100):
        euler = Euler(case_scene(5), 20)
        start, h = [arb(0), arb(1), arb(1)], ball(Fraction(1, 100))
        times = (Fraction(0), Fraction(1, 100))
        box = euler.a_priori_box(start, times, h)
        enough = [wider(x) for x in box]
        assert euler.verified_box(start, times, h, enough)
        for axis in range(3):
            small = [*enough]
            small[axis] = (box[axis] - box[axis].rad()).mid().union(box[axis].mid())
            with pytest.raises(NotEnclosedError, match="Picard image"):
                euler.verified_box(start, times, h, small)
        with pytest.raises(NotEnclosedError, match="trials"):
            euler.a_priori_box(start, (Fraction(0), Fraction(10)), arb(10))


def test_a_remainder_that_is_left_out_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    remainder = Euler.remainder

    def left_out(self: Euler, *arguments: Any) -> list[Any]:
        return [0 * x.mid() for x in remainder(self, *arguments)]

    monkeypatch.setattr(Euler, "remainder", left_out)
    (row,) = enclosure(TOP, [0.3], 10)
    assert not all_inside(row, exact_symmetric_top(0.3))


def test_a_set_contains_the_solutions_from_its_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    def inside(times: Sequence[Fraction], scene: Scene) -> list[bool]:
        """Return for each corner whether its solution is in the hull after some steps."""
        euler, now = Euler(scene, 20), Fraction(0)
        width = arb(0, 2.0**-10)
        state = Parallelepiped([arb(x) for x in scene.omega], identity(), [width] * 3)
        for time in times:
            h = ball(time - now)
            remainder = euler.remainder(state.hull(), (now, time), h)
            state, now = state.advance(euler, now, h, remainder), time
        found = []
        for signs in product((-1.0, 1.0), repeat=3):
            corner = [x + sign / 2**10 for x, sign in zip(scene.omega, signs, strict=True)]
            other = Scene("corner", corner, scene.moments, torque=scene.torque)
            (row,) = enclosure(other, [float(times[-1])], 15)
            found.append(all_inside(state.hull(), [real(x) for x in row]))
        return found

    times = [Fraction(n, 64) for n in range(1, 9)]
    assert all(inside(times, case_scene(5)))

    monkeypatch.setattr(Euler, "jacobian", lambda *arguments: identity())
    assert not all(inside(times, case_scene(5)))


def test_torque_about_the_axes_of_space_is_refused() -> None:
    law = TorqueLaw((1.0, 0.0, 0.0), frame="space")
    with pytest.raises(InputError, match="axes of space"):
        enclosure(Scene("x", (1.0, 1.0, 1.0), moments=(1.0, 1.0, 1.0), torque=law), [1.0], 10)


def test_command_prints_intervals(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--case", "2", "--times", "0.5", "1", "--digits", "12"]) == 0
    printed = capsys.readouterr().out
    assert "omega3 in [10.00000000000000, 10.00000000000000] rad/s" in printed
    assert "omega1 in [-0.958924274663" in printed
