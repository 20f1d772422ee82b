"""Enclosures of torque-free motion: they contain other solutions, and obey the laws of a flow."""

import itertools
import random
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest

from pyharness import Scene, case_scene
from pyharness.model.attitude import product
from pyharness.model.scene import Triple
from pyharness.truth.elliptic import torque_free
from pyharness.truth.free_attitude import free_attitude
from tests.checks.scenes.free_motions import KINDS, draw, draw_top

flint: Any = pytest.importorskip("flint")
enclosure: Any = pytest.importorskip("pyharness.truth.enclosure_free")

Balls = list[Any]
# Errors of the decimal solutions: of omega, relative to its size, and of the attitude.
OMEGA_ERROR, ATTITUDE_ERROR = Fraction(1, 10**45), Fraction(1, 10**30)
ATTITUDE = (0.5, -0.1, 0.7, 0.3)


@pytest.fixture(autouse=True)
def many_bits() -> Iterator[None]:
    """Compute the solutions that are compared with the balls to 1000 bits."""
    with flint.ctx.workprec(1000):
        yield


def enclosed(scene: Scene, end: float, digits: int = 40, attitude: bool = False) -> Balls:
    row: Balls = enclosure.enclose_free(scene, [end], digits, attitude)[0]
    return row


def ball(x: float | Decimal | Fraction) -> Any:
    exact = Fraction(x)
    return flint.arb(flint.fmpq(exact.numerator, exact.denominator))


def away(balls: Balls, values: Sequence[float | Decimal | Fraction]) -> float:
    """Return the largest distance of a value from its ball; 0 if each ball contains its value."""
    pairs = zip(balls, values, strict=True)
    return max(float((abs(x.mid() - ball(y)) - x.rad()).upper().max(0)) for x, y in pairs)


def drawn(kind: str, seed: int) -> tuple[Scene, float]:
    moments, omega, attitude, end = draw(random.Random(f"enclosure {kind} {seed}"), kind, 4.0)
    return Scene("", tuple(omega), moments=tuple(moments), attitude=tuple(attitude)), end


def momentum(scene: Scene, omega: Balls, attitude: Balls) -> Balls:
    """Return the angular momentum about the axes of space (kg m2/s)."""
    body = [ball(i) * w for i, w in zip(scene.moments or (), omega, strict=True)]
    back = [attitude[0], *(-x for x in attitude[1:])]
    return list(product(product(attitude, [ball(0), *body]), back))[1:]


@pytest.mark.sampled
@pytest.mark.parametrize("kind", KINDS)
def test_contains_the_decimal_solutions(kind: str) -> None:
    """Few digits leave radii far above the errors of the decimal solutions."""
    for seed in range(2):
        scene, end = drawn(kind, seed)
        row = enclosed(scene, end, 5, attitude=True)
        size = max(1.0, *map(abs, scene.omega))
        assert away(row[:3], torque_free(scene, end)) <= OMEGA_ERROR * Fraction(size)
        assert away(row[3:], free_attitude(scene, end)) <= ATTITUDE_ERROR
        for coarse, fine in zip(row, enclosed(scene, end, attitude=True), strict=True):
            assert coarse.contains(fine)


@pytest.mark.parametrize(
    "kind", ["plain", "middle axis", "near symmetry", "near separatrix", "wild"]
)
def test_contains_omega_of_a_body_with_coefficients(kind: str) -> None:
    for seed in range(5):
        coefficients, omega, end = draw_top(random.Random(f"enclosure {kind} {seed}"), kind)
        scene = Scene("", omega, coefficients=coefficients)
        size = max(1.0, *map(abs, omega))
        row = enclosed(scene, end, 5)
        assert away(row, torque_free(scene, end)) <= OMEGA_ERROR * Fraction(size)


@pytest.mark.parametrize("kind", KINDS)
def test_conserves_energy_momentum_and_norm(kind: str) -> None:
    scene, end = drawn(kind, 9)
    first, last = enclosure.enclose_free(scene, [0.0, end], 30, True)
    energies = [
        sum((ball(i) * w * w for i, w in zip(scene.moments or (), row[:3], strict=True)), ball(0))
        for row in (first, last)
    ]
    assert energies[0].overlaps(energies[1])
    assert away(first[:3], scene.omega) == 0.0
    sides = [momentum(scene, row[:3], row[3:]) for row in (first, last)]
    assert all(x.overlaps(y) for x, y in zip(*sides, strict=True))
    assert sum((x * x for x in last[3:]), ball(0)).contains(1)


@pytest.mark.parametrize("kind", KINDS)
def test_motion_is_reversed_by_a_reversed_start(kind: str) -> None:
    """The start of the reversed motion is exact, and its elliptic functions start elsewhere."""
    scene, end = drawn(kind, 5)
    first, second, third = (-w for w in scene.omega)
    back = enclosed(replace(scene, omega=(first, second, third)), -end, attitude=True)
    forth = enclosed(scene, end, attitude=True)
    for x, y, sign in zip(back, forth, [-1] * 3 + [1] * 4, strict=True):
        assert x.overlaps(sign * y)


@pytest.mark.parametrize("signs", list(itertools.product((1.0, -1.0), repeat=3)))
@pytest.mark.parametrize("moments", [(6.0, 5.0, 2.0), (2.0, 6.0, 5.0), (2.0, 5.0, 6.0)])
def test_two_times_compose(moments: Triple, signs: Triple) -> None:
    """The second part starts at omega and attitude rounded to binary64, 1e-16 away."""
    for start in ((0.3, 1.0, 0.5), (0.5, 1.0, 0.3), (0.1, 1.0, 0.1)):
        omega = start[0] * signs[0], start[1] * signs[1], start[2] * signs[2]
        scene = Scene("", omega, moments=moments, attitude=ATTITUDE)
        middle: Any = [float(x.mid()) for x in enclosed(scene, 1.75, attitude=True)]
        later = Scene("", middle[:3], moments=moments, attitude=middle[3:])
        whole, rest = enclosed(scene, 5.0, attitude=True), enclosed(later, 3.25, attitude=True)
        assert max(float(abs(x - y).upper()) for x, y in zip(whole, rest, strict=True)) < 1e-13


@pytest.mark.parametrize(
    "omega", [(1e-3, 1.0, 1e-3), (-1e-3, 1.0, 1e-3), (1e-3, -1.0, 1e-3), (-1e-3, -1.0, -1e-3)]
)
def test_separatrix(omega: Triple) -> None:
    scene = Scene("", omega, moments=(6.0, 5.0, 2.0), attitude=ATTITUDE)
    for end in (-9.0, 0.0, 12.5):
        row = enclosed(scene, end, 5, attitude=True)
        assert away(row[:3], torque_free(scene, end)) <= OMEGA_ERROR
        assert away(row[3:], free_attitude(scene, end)) <= ATTITUDE_ERROR
    first, second, third = enclosed(scene, 1e6)
    assert (second * second).contains(ball(1 + Fraction(8, 5) * Fraction(omega[0]) ** 2))
    assert max(abs(first).upper(), abs(third).upper()) < flint.arb(10) ** -1000


@pytest.mark.campaign
@pytest.mark.parametrize(("omega", "end"), [
    ((1e-3, 1.0, 1e-3), 250.0), ((1e-3, -1.0, 1e-3), 300.0), ((1e-150, 1.0, -1e-150), -1e3),
    ((-1e-3, 1.0, 1e-3), 1e4), ((1e-15, 1.0, 0.0), 250.0), ((1e-30, 1.0, 0.0), -1e4),
    ((0.0, 1.0, 1e-60), 1e3),
])  # fmt: skip
def test_attitude_on_and_near_the_separatrix(omega: Triple, end: float) -> None:
    """The motion amplifies errors of omega by exp(0.63 t), or up to each flip."""
    scene = Scene("", omega, moments=(6.0, 5.0, 2.0), attitude=ATTITUDE)
    row = enclosed(scene, end, attitude=True)
    assert away(row[3:], free_attitude(scene, end)) <= ATTITUDE_ERROR


@pytest.mark.parametrize("end", [102.0, -347.0, 1e3, -1e4])
def test_separatrix_with_coefficients_that_are_not_decimals(end: float) -> None:
    """Coefficients rounded to decimals would leave the separatrix, and cause flips."""
    scene = Scene("", (-3.0, 1.0, 4.0), moments=(34.0, 26.0, 17.0))
    assert away(enclosed(scene, end, 60), torque_free(scene, end)) < 1e-60


@pytest.mark.sampled
@pytest.mark.parametrize("small", [1e-15, 1e-150, 5e-324])
def test_near_the_separatrix(small: float) -> None:
    """With 1 - m of 1e-30 and less, the working precision has more bits."""
    scene = Scene("", (small, 1.0, 0.0), moments=(6.0, 5.0, 2.0), attitude=ATTITUDE)
    for end in (0.0, 350.0, -1e6):
        row = enclosed(scene, end, attitude=True)
        assert all(x.rad() <= flint.arb(10) ** -40 for x in row)
        assert away(row[:3], torque_free(scene, end)) < 1e-40


def test_steady_rotation_and_rest_are_exact() -> None:
    for omega in ((0.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 3.0)):
        scene = Scene("", omega, moments=(6.0, 5.0, 2.0), attitude=ATTITUDE)
        row = enclosed(scene, 1e6, attitude=True)
        assert [float(x.mid()) for x in row[:3]] == list(omega)
        assert all(x.is_exact() for x in row[:3])
        assert away(row[3:], free_attitude(scene, 1e6)) <= ATTITUDE_ERROR


@pytest.mark.parametrize("number", [3, 4])
def test_cases_after_10000_s_take_less_than_a_second(number: int) -> None:
    scene = replace(case_scene(number), attitude=ATTITUDE)
    begin = time.perf_counter()
    row = enclosed(scene, 1e4, 21, attitude=True)
    assert time.perf_counter() - begin < 1.0
    assert all(x.rad() <= flint.arb(10) ** -20 for x in row)


def test_precision_of_the_caller_is_restored() -> None:
    with flint.ctx.workprec(77):
        enclosed(case_scene(4), 1.0, 100)
        assert flint.ctx.prec == 77
