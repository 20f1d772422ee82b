"""Derivatives of tapes, compared with those of mpmath."""

from random import Random
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness.checks.scenes.state_scenes import READY, STEADY, TURNING, draw, ready
from pyharness.engine.system.recorded import system_of
from pyharness.model.dual import with_derivatives
from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.state_torque import StateTorque, recorded, replayed, torque_of
from pyharness.model.tape import ATTITUDE, FLOATS, OMEGA, TIME, Functions, Table, evaluate
from pyharness.torques import table

SLOTS = (TIME, *OMEGA, *ATTITUDE)


def _piece(table: Table, time: Any) -> Any:
    piece = max(k for k, start in enumerate(table.breaks) if k == 0 or start <= time)
    s = time - table.breaks[piece]
    return sum(mpmath.mpf(c) * s**power for power, c in enumerate(table.pieces[piece]))


ELEMENTARY = {kind: getattr(mpmath, kind) for kind in WITH_DERIVATIVE}
MPMATH: Functions[Any] = Functions(
    mpmath.mpf, mpmath.sqrt, mpmath.exp, mpmath.tanh, mpmath.sin, mpmath.cos, _piece, ELEMENTARY,
    lambda x: mpmath.mpf(x > 0), mpmath.floor, lambda condition, x, y: x if condition else y,
)  # fmt: skip


def check(torque: StateTorque, source: Random) -> None:
    """Compare all derivatives of a torque with differences of many digits."""
    tape: Any = torque.tape
    at = [source.uniform(0.1, 1.0) for _ in SLOTS]
    found = evaluate(with_derivatives(tape, SLOTS), at, FLOATS)
    assert found[:3] == pytest.approx(evaluate(tape, at, FLOATS), rel=1e-14, abs=1e-14)
    slopes = np.array(found[3:]).reshape(3, len(SLOTS))
    with mpmath.workdps(60):
        step = mpmath.mpf(10) ** -20
        for slot in SLOTS:
            sides = []
            for sign in (1, -1):
                moved = [mpmath.mpf(x) for x in at]
                moved[slot] += sign * step
                sides.append(evaluate(tape, moved, MPMATH))
            for axis in range(3):
                wanted = float((sides[0][axis] - sides[1][axis]) / (2 * step))
                assert slopes[axis, slot] == pytest.approx(wanted, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("name", STEADY + TURNING)
@pytest.mark.parametrize("seed", range(3))
def test_derivatives_of_recorded_functions(name: str, seed: int) -> None:
    source = Random(f"derivative {name} {seed}")
    scene, _ = draw(source, (name,))
    assert isinstance(scene.torque, StateTorque)
    check(scene.torque, source)


@pytest.mark.sampled
@pytest.mark.parametrize("name", READY)
@pytest.mark.parametrize("seed", range(3))
def test_derivatives_of_ready_terms(name: str, seed: int) -> None:
    source = Random(f"derivative {name} {seed}")
    check(ready(source, name, [4.0, 3.0, 2.0], 1.5), source)


def test_every_operation_and_constant_outputs() -> None:
    def torque(t: Any, w: Any, q: Any) -> Any:
        angle = 0.3 * t + w[0] * w[1]
        first = np.sin(angle) / (2.0 + np.cos(angle)) + np.exp(-w[2] * q[0])
        return [first, np.sqrt(1.0 + q[1] ** 2 * t), 2.5]

    check(replayed(torque), Random("operations"))


@pytest.mark.parametrize("seed", range(4))
def test_logarithms_arcs_and_switches(seed: int) -> None:
    def torque(t: Any, w: Any, q: Any) -> Any:
        chosen = np.where(w[0] > 0.5, w[1] * w[2], np.log(w[1]))
        return [
            chosen, np.arctan(w[0] * t) + np.arcsin(0.9 * q[0]),
            np.clip(w[0] * q[1], 0.1, 0.4) + np.floor(3.0 * t) * w[2],
        ]  # fmt: skip

    check(recorded(torque), Random(f"switches {seed}"))


def test_derivatives_of_a_spline() -> None:
    values = np.random.default_rng(1).normal(size=(5, 3))
    check(table([-0.2, 0.1, 0.5, 0.8, 1.1], values, "cubic"), Random("spline"))


def test_derivatives_of_the_equations_of_motion() -> None:
    scene, _ = draw(Random("system"), ("gradient", "drag"))
    tape = system_of(scene, True)
    slots = (*OMEGA, *ATTITUDE)
    at = [0.3, 0.5, -0.2, 0.9, 0.5, -0.5, 0.5, 0.5]
    slopes = np.array(evaluate(with_derivatives(tape, slots), at, FLOATS)[7:]).reshape(7, 7)
    for column, slot in enumerate(slots):
        moved = [[*at], [*at]]
        for sign, each in zip((1.0, -1.0), moved, strict=True):
            each[slot] += sign * 1e-5
        above, below = (np.array(evaluate(tape, each, FLOATS)) for each in moved)
        assert slopes[:, column] == pytest.approx((above - below) / 2e-5, rel=1e-6, abs=1e-6)


def test_a_replayed_torque_takes_shifted_arguments() -> None:
    torque = recorded(lambda t, w: [2.0 * w[0] + 3.0 * w[1] + 1.0, w[0] * w[1], t - w[2]])
    tape, shift, rest = torque.tape, np.array([0.5, -0.25, 2.0]), (1.0, 0.0, 0.0, 0.0)
    assert tape is not None
    moved = replayed(lambda t, w, q: torque_of(tape, t + 3.0, w + shift, q))
    shifted = (0.1 + shift).tolist()
    assert moved.at(0.4, [0.1] * 3, rest) == pytest.approx(torque.at(3.4, shifted, rest))
