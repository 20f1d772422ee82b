"""The reference for a torque that depends on the state, compared with mpmath and closed forms."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import Scene, TorqueLaw
from pyharness.model.state_torque import StateTorque, recorded, replayed
from pyharness.truth.reference import Reference, reference
from pyharness.truth.tape_series import series_products
from tests.refused import refused

_MOMENTS = (1.5, 2.0, 3.0)
_OMEGA = (0.3, -1.1, 2.2)
_ATTITUDE = (0.5, 0.5, -0.5, 0.5)  # of norm 1 exactly
# The same functions record a tape and evaluate it in the arithmetic of mpmath.
_Functions = dict[str, Callable[[Any], Any]]
_SYMBOLS: _Functions = {name: getattr(np, name) for name in ("sqrt", "exp", "tanh", "sin", "cos")}
_MPMATH: _Functions = {name: getattr(mpmath, name) for name in _SYMBOLS}


def _drag(t: Any, w: Any, q: Any, f: _Functions) -> list[Any]:
    """Use products, a sum and a square root."""
    speed = f["sqrt"](w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    return [-0.3 * speed * each + 0.1 * t * t for each in w]


def _field(t: Any, w: Any, q: Any, f: _Functions) -> list[Any]:
    """Use sine, cosine and quotients."""
    angle = 0.7 * t + w[1]
    sine, cosine = f["sin"](angle), f["cos"](angle)
    return [sine / (2.5 + cosine), w[0] * cosine, 1.0 / (3.0 + w[2] * w[2]) - sine * sine]


def _pulse(t: Any, w: Any, q: Any, f: _Functions) -> list[Any]:
    """Use exponentials of exponentials, and a sine whose angle has no cosine beside it."""
    bell = f["exp"](-2.0 * (t - 0.5) * (t - 0.5))
    last = f["sin"](2.0 * w[2]) + 0.25 * f["tanh"](t - w[0])
    return [bell * w[1], f["exp"](0.2 * w[0] - bell), last]


def _pointing(t: Any, w: Any, q: Any, f: _Functions) -> list[Any]:
    """Use the attitude, and every operation."""
    scalar, *vector = q
    length = f["sqrt"](1.5 + vector[0] * vector[1])
    turned = [-2.0 * scalar * each / length for each in vector]
    return [
        turned[0] - 0.2 * w[0],
        turned[1] + f["exp"](-w[1] * w[1]) * f["cos"](t),
        turned[2] + f["sin"](scalar * w[2]),
    ]


_TURNING = (_field, _pointing)  # tested with the attitude, on which only the second depends


def _torque(function: Callable[..., list[Any]]) -> StateTorque:
    return replayed(lambda t, w, q: function(t, w, q, _SYMBOLS))


@cache
def _by_mpmath(function: Callable[..., list[Any]], time: float) -> list[Any]:
    """Return omega, and the attitude of some, at `time` (s) by the Taylor series of mpmath."""
    attitude = function in _TURNING
    i1, i2, i3 = map(mpmath.mpf, _MOMENTS)
    back = -1 if time < 0 else 1  # odefun integrates forward only

    def slopes(s: Any, state: Sequence[Any]) -> list[Any]:
        (x, y, z), q = state[:3], state[3:]
        n1, n2, n3 = function(back * s, (x, y, z), q, _MPMATH)
        found = [
            (n1 + (i2 - i3) * y * z) / i1,
            (n2 + (i3 - i1) * z * x) / i2,
            (n3 + (i1 - i2) * x * y) / i3,
        ]
        if q:
            a, b, c, d = q
            found += [
                (-b * x - c * y - d * z) / 2, (a * x + c * z - d * y) / 2,
                (a * y + d * x - b * z) / 2, (a * z + b * y - c * x) / 2,
            ]  # fmt: skip
        return [back * each for each in found]

    start = [mpmath.mpf(x) for x in (*_OMEGA, *(_ATTITUDE if attitude else ()))]
    found: list[Any] = mpmath.odefun(slopes, 0, start)(abs(time))
    return found


def _omega(found: Reference, row: int) -> list[Any]:
    """Return omega of the reference to all its digits."""
    assert found.remainder is not None
    pairs = zip(found.omega[row].tolist(), found.remainder[row].tolist(), strict=True)
    return [mpmath.mpf(high) + mpmath.mpf(low) for high, low in pairs]


@pytest.mark.campaign
@pytest.mark.parametrize("time", [0.5, -0.25])
@pytest.mark.parametrize(
    ("function", "attitude"),
    [(_drag, False), (_field, False), (_field, True), (_pulse, False), (_pointing, True)],
)
def test_the_series_agrees_with_mpmath(
    function: Callable[..., list[Any]], attitude: bool, time: float
) -> None:
    scene = Scene("", _OMEGA, _MOMENTS, torque=_torque(function))
    if attitude:
        scene = replace(scene, attitude=_ATTITUDE)
    found: Any = reference(scene, [time], precise=True)
    with mpmath.workdps(34):
        wanted = _by_mpmath(function, time)
        assert max(abs(x - y) for x, y in zip(_omega(found, 0), wanted, strict=False)) < 1e-30
    assert found.estimate < 1e-29
    if attitude:
        turned = np.array([float(x) for x in wanted[3:]])
        np.testing.assert_allclose(found.attitude[0], turned, rtol=0, atol=1e-15)
        assert found.angle_estimate < 1e-28


def test_all_operations_are_tested() -> None:
    kinds = set()
    for function in (_drag, _field, _pulse, _pointing):
        tape: Any = _torque(function).tape
        kinds |= {each.kind for each in tape.operations}
    assert kinds == {"linear", "product", "quotient", "sqrt", "exp", "tanh", "sine", "cosine"}


@pytest.mark.campaign
def test_the_less_precise_series_states_its_error() -> None:
    scene = Scene("", _OMEGA, _MOMENTS, torque=_torque(_pointing), attitude=_ATTITUDE)
    times = [1.0, 20.0]
    quick, precise = reference(scene, times), reference(scene, times, precise=True)
    with mpmath.workdps(40):
        for row in range(2):
            pairs = zip(_omega(quick, row), _omega(precise, row), strict=True)
            assert max(abs(x - y) for x, y in pairs) <= 2.0 * quick.estimate
    assert precise.estimate < 1e-22 < quick.estimate < 1e-16


_LAW = TorqueLaw(
    (1.0, -2.0, 3.0), (0.5, 0.0, -1.0), [((1.0, 2.0, 3.0), 3.0)], [((3.0, 2.0, 1.0), 0.7)]
)


@pytest.mark.campaign
@pytest.mark.parametrize("times", [[0.5, 4.0], [-0.5, -4.0]])
@pytest.mark.parametrize("attitude", [None, _ATTITUDE])
def test_a_torque_law_on_a_tape_has_the_digits_of_the_law(
    attitude: tuple[float, ...] | None, times: list[float]
) -> None:
    def function(t: Any, w: Any, q: Any) -> Any:
        found = np.array(_LAW.constant) + np.array(_LAW.rate) * t + 0.0 * w
        for amplitude, frequency in _LAW.sines:
            found = found + np.array(amplitude) * np.sin(frequency * t)
        for amplitude, frequency in _LAW.cosines:
            found = found + np.array(amplitude) * np.cos(frequency * t)
        return found

    law, tape = (
        reference(
            Scene("", _OMEGA, _MOMENTS, torque=torque, attitude=attitude), times, precise=True
        )
        for torque in (_LAW, replayed(function))
    )
    with mpmath.workdps(40):
        for row in range(2):
            pairs = zip(_omega(law, row), _omega(tape, row), strict=True)
            assert max(abs(x - y) for x, y in pairs) < 1e-30
    if attitude is not None:
        assert law.attitude is not None
        np.testing.assert_array_equal(tape.attitude, law.attitude)


def test_velocity_is_computed_as_for_a_law() -> None:
    law, tape = (
        reference(Scene("", _OMEGA, _MOMENTS, torque=torque), [2.0], velocity=True)
        for torque in (TorqueLaw((1.0, 0.0, 0.0)), replayed(lambda t, w, q: [1.0, 0.0, 0.0 * t]))
    )
    assert law.velocity is not None
    np.testing.assert_array_equal(tape.velocity, law.velocity)


@pytest.mark.parametrize("time", [3.0, -3.0, 200.0])
def test_a_damped_sphere_has_a_closed_form(time: float) -> None:
    scene = Scene("", _OMEGA, (2.0, 2.0, 2.0), torque=replayed(lambda t, w, q: -0.5 * w))
    found = reference(scene, [time])
    with mpmath.workdps(40):
        factor = mpmath.exp(mpmath.mpf(-time) / 4)
        for x, start in zip(_omega(found, 0), _OMEGA, strict=True):
            assert abs(x - start * factor) <= 1e-18 * factor


def _one(component: Any) -> list[Any]:
    return [component, 0.0 * component, 0.0 * component]


@pytest.mark.campaign
@pytest.mark.parametrize(("function", "rows"), [
    (lambda t, w, q: _one(1.0 / (t - 2.0)), 2),  # a pole between the times
    (lambda t, w, q: _one(1.0 / t), 0),  # a pole at the beginning
    (lambda t, w, q: _one(w[1] / (w[0] - 0.3)), 0),
    (lambda t, w, q: _one(np.sqrt(1.5 - t)), 2),  # a branch point
    (lambda t, w, q: _one(np.sqrt(-1.0 - t)), 0),
    (lambda t, w, q: _one(np.sqrt(t)), 0),
    (lambda t, w, q: _one(w[0] * w[0] * 3.0), 1),  # omega becomes infinite at about 1.7 s
    (lambda t, w, q: _one(np.exp(1e300 * w[0] * w[0])), 0),
    (lambda t, w, q: _one(np.sin(np.exp(2000.0 + t))), 0),
    # The Taylor series of abs(t - 1.5) continues as t - 1.5.
    (lambda t, w, q: _one(np.sqrt((t - 1.5) * (t - 1.5))), 2),
])  # fmt: skip
def test_the_rows_end_at_a_singularity(function: Callable[..., Any], rows: int) -> None:
    found = reference(Scene("", _OMEGA, _MOMENTS, torque=replayed(function)), [0.5, 1.0, 3.0])
    assert found.time.tolist() == [0.5, 1.0, 3.0][:rows]
    assert found.omega.shape == (rows, 3)
    assert np.isfinite(found.omega).all()


def test_time_0_needs_no_step() -> None:
    for rate in (lambda t, w: w**3 * np.sin(t) ** 4, lambda t, w: np.clip(w, -0.2, 0.2)):
        found = reference(Scene("", _OMEGA, _MOMENTS, torque=recorded(rate)), [0.0])
        assert found.omega.tolist() == [list(_OMEGA)]


def test_a_root_that_is_zero_throughout_has_a_series() -> None:
    """Quadratic drag on a body at rest is not singular: the body remains at rest."""

    def drag(t: Any, w: Any, q: Any) -> Any:
        return -np.sqrt(w @ w) * w

    scene = Scene("", (0.0, 0.0, 0.0), _MOMENTS, torque=replayed(drag), attitude=_ATTITUDE)
    found = reference(scene, [1.0, 9.0])
    np.testing.assert_array_equal(found.omega, np.zeros((2, 3)))
    np.testing.assert_array_equal(found.attitude, [_ATTITUDE, _ATTITUDE])


def test_the_work_limit_falls_with_the_operations() -> None:
    def function(t: Any, w: Any, q: Any) -> list[Any]:
        total = w[0]
        for n in range(20):
            total = total + np.sin((n + 1.0) * w[0]) * 1e-3
        return _one(total)

    torque: Any = replayed(function)
    assert series_products(torque.tape) == 40
    scene = Scene("", _OMEGA, _MOMENTS, torque=torque)
    refused("2222", reference, scene, [1e9], effort=1.0)
    refused("11111", reference, scene, [1e9])


def test_sine_and_cosine_of_an_angle_are_one_operation() -> None:
    tape: Any = replayed(lambda t, w, q: [np.sin(w[0]), np.cos(w[0]), w[0] * w[1]]).tape
    assert series_products(tape) == 3
