"""The truth of torque-free motion, compared with the series, and checked by the laws of a flow."""

import itertools
from decimal import Decimal

import mpmath
import pytest

from pyharness.model.scene import Scene, Triple
from pyharness.truth.elliptic import jacobi, torque_free
from pyharness.truth.reference import reference

_START = (0.4, -1.1, 0.7)
_MOMENTS = (6.0, 5.0, 2.0)


def _away(scene: Scene, time: float) -> float:
    """Return the largest distance from the decimal Taylor series (rad/s)."""
    series = reference(scene, [time], precise=True)
    assert series.remainder is not None
    rows = zip(torque_free(scene, time), series.omega[0], series.remainder[0], strict=True)
    return max(abs(float(x - Decimal(float(w)) - Decimal(float(rest)))) for x, w, rest in rows)


@pytest.mark.parametrize("turn", range(6))
@pytest.mark.parametrize("time", [0.3, -9.0])
def test_agrees_with_the_series(turn: int, time: float) -> None:
    """Take the signs of the start in turn: each order of axes sees four, each time all eight."""
    moments = list(itertools.permutations(_MOMENTS))[turn]
    for signs in list(itertools.product((1.0, -1.0), repeat=3))[(turn + (time < 0.0)) % 4 :: 4]:
        first, second, third = (w * s for w, s in zip(_START, signs, strict=True))
        assert _away(Scene("", (first, second, third), moments=moments), time) < 1e-27


@pytest.mark.parametrize(("moments", "omega"), [
    *((moments, _START) for moments in itertools.permutations((1.0, 1.0, 0.3))),
    ((2.0, 2.0, 2.0), _START),
    ((200.0, 10.0, 20.0), _START),
    *((_MOMENTS, omega) for omega in ((0.1, 1.0, 0.1), (0.1, 1.0, -0.1))),
    *((_MOMENTS, omega) for omega in ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0))),
])  # fmt: skip
def test_agrees_where_the_motion_is_special(moments: Triple, omega: Triple) -> None:
    assert _away(Scene("", omega, moments=moments), 5.0) < 1e-25


def test_digits_hold_over_many_flips() -> None:
    """Energy and momentum are conserved further than 40 digits would allow."""
    scene = Scene("", (1e-15, 1.0, 0.0), moments=(6.0, 5.0, 2.0))
    rows = [[Decimal(w) for w in scene.omega], torque_free(scene, 350.0), torque_free(scene, 700.0)]
    # Omega has 53 bits only, so that a second half would start elsewhere; the invariants are
    # compared.
    for weights in ((6, 5, 2), (36, 25, 4)):
        energies = [sum(q * w * w for q, w in zip(weights, row, strict=True)) for row in rows]
        assert max(energies) - min(energies) < Decimal("1e-60")


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("moments", [(6.0, 5.0, 2.0), (5.0, 6.0, 2.0), (3.0, 0.7, 2.9)])
def test_steady_rotation_is_constant(moments: Triple, axis: int) -> None:
    for size in (1.0, -0.3):
        omega = [0.0, 0.0, 0.0]
        omega[axis] = size
        scene = Scene("", (omega[0], omega[1], omega[2]), moments=moments)
        for rounded in (False, True):
            for time in (200.0, 250.0, -1e6):
                assert torque_free(scene, time, rounded) == [Decimal(w) for w in omega]


@pytest.mark.parametrize(("moments", "omega"), [
    ((6.0, 5.0, 2.0), (1e-3, 1.0, 1e-3)),
    ((34.0, 26.0, 17.0), (-3.0, 1.0, 4.0)),
    ((17.0, 26.0, 34.0), (4.0, -1.0, 3.0)),
])  # fmt: skip
def test_motion_on_the_separatrix_never_flips_again(moments: Triple, omega: Triple) -> None:
    """Omega approaches the middle axis, with a size that the energy determines."""
    scene = Scene("", omega, moments=moments)
    energy = sum(Decimal(i) * Decimal(w) ** 2 for i, w in zip(moments, omega, strict=True))
    for time in (1e3, -1e4, 1e6):
        first, second, third = torque_free(scene, time)
        assert abs(Decimal(moments[1]) * second**2 - energy) < Decimal("1e-25")
        assert max(abs(first), abs(third)) < Decimal("1e-90")


def test_coefficients_as_binary64_holds_them() -> None:
    """The two solutions differ by the effect of one rounding of A, B and C; they are not equal."""
    scene = Scene("", _START, moments=(3.0, 0.7, 2.9))
    exact, held = torque_free(scene, 50.0), torque_free(scene, 50.0, rounded=True)
    assert 1e-18 < max(float(abs(x - y)) for x, y in zip(exact, held, strict=True)) < 1e-13
    powers = Scene("", _START, coefficients=scene.euler_coefficients)
    assert [*map(float, torque_free(powers, 50.0))] == [*map(float, held)]


@pytest.mark.parametrize(
    ("coefficients", "omega"),
    [((0.0, 0.0, 0.0), _START), ((1.0, 1.0, 1.0), (0.0, 2.0, 0.0)), ((0.0, -1.0, 0.0), (0, 1, 3))],
)
def test_steady_rotation_is_constant_for_any_coefficients(
    coefficients: Triple, omega: Triple
) -> None:
    scene = Scene("", omega, coefficients=coefficients)
    assert torque_free(scene, 1e3) == [Decimal(w) for w in omega]


@pytest.mark.parametrize("comodulus", ["0.5", "1e-9", "1e-30", "1", "0"])
def test_jacobi_agrees_with_mpmath(comodulus: str) -> None:
    with mpmath.workdps(60):
        parameter = 1 - mpmath.mpf(comodulus)
        for u in ("0.3", "-4", "31.5"):
            found = jacobi(Decimal(u), Decimal(comodulus))
            for kind, value in zip(("sn", "cn", "dn"), found, strict=True):
                wanted = mpmath.ellipfun(kind, mpmath.mpf(u), m=parameter)
                assert abs(mpmath.mpf(str(value)) - wanted) < mpmath.mpf(10) ** -13, (kind, u)
