"""Expressions of time and omega are recorded with NumPy's values, or refused."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, opaque, solve
from pyharness.model.state_torque import recorded
from pyharness.model.tape import float_outputs
from tests.tables import tables

# Without quotients of arguments that are whole, where a rounding error decides.
POINTS = [
    (0.3, 0.7, -0.45), (2.5, 1.5, -0.5), (1e-9, -3e-9, 2e-9), (-0.3, 0.2, 0.1), (0.5, 1.0, 2.0),
    (0.1, -1.5, 3.51), (-2.5, 10.6, 0.25),
]  # fmt: skip
NAMES = {"np": np, "math": math, "M": np.array([[1.0, 0.2, 0.3], [0.1, 2.0, 0.4], [0.5, 0.6, 3.0]])}
RECORDED = """
np.clip(w, None, .5); np.clip(w, .1, None); np.clip(w, min=.1, max=.5); w.clip(max=.5)
np.clip(w, .5, .1); np.clip(w, w[::-1], .5); np.clip(w > .2, 0, .5)
np.interp(w, [0, 1, 2], [1, 5, 3]); np.interp(w, [0, 1, 2], [1, 5, 3], left=9, right=-3)
np.interp(w, [0, 1, 1, 2], [1, 5, 3, 4])
np.round(w, 1); np.around(w); np.round(w * 30, -1); w.round(2); np.fix(w); np.rint(w)
np.sum(w, initial=3); np.max(w, initial=.4); w.min(); np.ptp(w); np.mean(w * w); w.std(ddof=1)
np.var(w); np.average(w * w, weights=[1, 2, 3]); np.cumsum(w * w); np.cumprod(w); np.prod(w)
np.linalg.norm(w); np.linalg.norm(w, 2); np.linalg.norm(np.outer(w, w), axis=0)
np.linalg.norm(np.outer(w, w)); np.linalg.vector_norm(w); np.linalg.matrix_power(M * w, 3)
np.linalg.trace(np.outer(w, w)); np.linalg.multi_dot([w, M, w]); np.linalg.det(M + w[0] * w[0])
np.linalg.solve(M, w); np.linalg.inv(M + np.diag(w * w)); np.linalg.solve(M + w[0] * w[0], w)
np.select([w > .2, w > 0], [w, 2 * w], default=7); np.where(w > .2, w, 2)
np.where([1, 0, 2], w, -w); np.nan_to_num(w); np.polyval([1, 2, 3], w); np.polyval(w, 2)
np.poly1d([1, 2, 3])(w); np.polynomial.Polynomial([1, 2, 3])(w); np.vander(w)
np.hypot(w, 3); np.copysign(w, -0.0); np.copysign(-1, w); np.copysign(w, w[::-1])
np.heaviside(w, .5); np.sign(w); np.fabs(w); np.deg2rad(w); np.angle(w); np.real(w); w.imag
np.arctan2(w, w[::-1]); np.arctan2(0.0, w); np.arctan2(w, -1); np.arctan2(w, 0.0)
w[0] // .7; -w[0] % .7; 2 % (w[0] + 3); np.fmod(w[0], -.7); np.remainder(w[1], -.7)
w ** 0; w ** 2; w ** -1; (w + 3) ** -1.5; 2 ** w; 1 ** w; np.square(w); np.power(w, [1, 2, 3])
np.cbrt(w) ** 2; np.reciprocal(w); pow(w[0], -2); abs(w[0]); sum(w)
math.log(w[0] + 3); math.hypot(w[0], 2); math.fmod(w[0], .7); math.pow(2, w[0]); math.floor(w[0])
math.copysign(w[0], -1); math.degrees(w[0]); math.trunc(w[1]); math.ceil(w[2]); math.prod(w)
(w[0] > .2) * (w[1] > .2); (w > .2) | (w > .5); (w[0] > .2) ^ (w[1] > .2); ~(w[0] > .2)
(w[0] > .2) & True; np.sum(w > .2); sum(w > .2); np.mean(w > .2); (w > .2).any(); np.all(w > .2)
np.logical_xor.reduce(w > .2); np.logical_and(w[0] > .2, w[1] > .2); np.maximum(w > .2, w)
np.maximum.reduce(w); np.subtract.reduce(w); np.add.accumulate(w * w); np.hypot.reduce(w)
np.multiply.outer(w, w); np.add.reduceat(w * w, [0, 2]); np.sqrt(w + 3, dtype=float)
np.sin(w, np.array(w)); np.add(w, 1, np.array(w)); np.add(w[0], 1, out=np.array(w))
np.float32(.1) * w; np.array([.1, .2, .3], dtype=np.float32) * w; np.eye(3, dtype=int) @ w
w @ w; np.vdot(w, w); np.einsum("i,j->ij", w, w); np.tensordot(w, w, 1); np.kron(w, w)
np.cross(w, [1, 2, 3]); np.cross(w[:2], w[1:]); np.cross(w[:2], [3, 4]); np.cross(w, w[:2])
np.cross(w, M); np.cross(w[:2], M[:, :2]); np.linalg.cross([1, 2, 3], w)
np.trapezoid(w * w, dx=.1); np.diff(w, prepend=0); np.convolve(w, [1, 2]); np.roll(w, 1)
np.tile(w, 2); np.repeat(w, 2); np.triu(np.outer(w, w)); np.diag(w); np.full_like(w, w[0])
np.vectorize(lambda x: x * x)(w); np.apply_along_axis(lambda x: 2 * x, 0, w); np.meshgrid(w, w)
"""
REFUSED = tables(__file__)["refused"]
EXPRESSIONS = [each.strip() for each in RECORDED.replace("\n", ";").split(";") if each.strip()]


def flat(values: Any) -> list[Any]:
    if isinstance(values, (tuple, list)):
        return [x for each in values for x in flat(each)]
    return list(np.atleast_1d(values).ravel())


def check(function: Callable[[Any, Any], Any]) -> None:
    """Compare all components of a function with NumPy's at all points."""
    wanted = [np.array(flat(function(0.0, np.array(each))), dtype=float) for each in POINTS]
    parts = [
        recorded(lambda t, w, k=k: [flat(function(t, w))[k] * 1.0, 0.0 * t, 0.0 * t]).tape
        for k in range(len(wanted[0]))
    ]
    for each, values in zip(POINTS, wanted, strict=True):
        for part, value in zip(parts, values, strict=True):
            assert part is not None
            found = float_outputs(part, [0.0, *each, 1.0, 0.0, 0.0, 0.0])[0]
            assert found == pytest.approx(value, rel=1e-13, abs=0.0), each


@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors")
@pytest.mark.parametrize("text", EXPRESSIONS)
def test_expression_has_the_value_of_numpy(text: str) -> None:
    check(eval(f"lambda t, w: {text}", NAMES))


@pytest.mark.parametrize("text", REFUSED)
def test_expression_that_numpy_computes_otherwise_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=REFUSED[text]):
        recorded(eval(f"lambda t, w: [np.sum({text}), 0.0, w[0]]", NAMES))


def of_list(t: Any, w: Any) -> Any:
    found = np.array([w[0], 2.0 * w[1], w[2]])
    found *= w
    found += found
    return found


def of_objects(t: Any, w: Any) -> Any:
    found = np.array([w[0], t, w[2]], dtype=object)
    found -= 0.1 * w
    return np.subtract(found, w[::-1], out=found)


def of_view(t: Any, w: Any) -> Any:
    found = np.array([w[0], w[1], w[2]])
    np.add(found, w * w, out=found[::-1])
    found[1:] *= 3.0
    return found


def of_number(t: Any, w: Any) -> Any:
    found = np.empty((), dtype=object)
    np.multiply(w[0], 2.0, out=found)
    found -= w[1]
    return found


def of_zeros(t: Any, w: Any) -> Any:
    found, other = np.zeros(3), np.ones(3)
    np.matmul(2.0 * np.eye(3), w, out=found)
    np.subtract(other, w, out=other)
    found -= other
    return found


def of_copy(t: Any, w: Any) -> Any:
    found = np.array([w[0], w[1], w[2]])
    copy = found.copy()
    copy **= 2
    return found + copy


def of_function(t: Any, w: Any) -> Any:
    found = np.empty(3)
    found[:] = w
    np.multiply(found, found, found)
    return found


@pytest.mark.parametrize(
    "function", [of_list, of_objects, of_view, of_number, of_zeros, of_copy, of_function]
)
def test_changes_in_place_are_recorded(function: Callable[[Any, Any], Any]) -> None:
    check(function)


def test_motion_is_that_under_the_opaque_torque() -> None:
    def torque(t: Any, w: Any) -> Any:
        found = np.array([w[0], w[1], w[2]])
        found *= np.abs(w)
        return -found

    both = [
        solve(Scene("", (0.5, -0.2, 0.9), moments=(1, 2, 3), torque=each), 5.0, tolerance=1e-12)
        for each in (torque, opaque(torque))
    ]
    assert both[0].omega[0] == pytest.approx(both[1].omega[0], rel=1e-11)


def test_a_sum_of_conditions_counts_them() -> None:
    """As documented in docs/how-to/torques.md."""
    found = recorded(lambda t, w: (w > 0.2) + (w > 0.5)).at(0.0, POINTS[4], (1.0, 0.0, 0.0, 0.0))
    assert found == (1.0, 2.0, 2.0)
