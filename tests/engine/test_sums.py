"""Sums of torque terms, torque laws and functions."""

from typing import Any

import numpy as np
import pytest

from pyharness import StateTorque, TorqueLaw, opaque
from pyharness.torques import damping, in_space, magnetic_dipole, recorded
from tests.engine.test_terms import C0, C1, C2, RATE, S1, S2, D, H, M, V, matrix, states


def test_sums() -> None:
    def brake(t: float, omega: Any) -> Any:
        return -0.1 * omega * t

    law, space = TorqueLaw(V, sines=[(S1, 1.5)]), TorqueLaw(H, frame="space")
    first, second = damping(D), magnetic_dipole(M, V)
    for t, omega, attitude in states(5):
        r = matrix(attitude)
        body = V + S1 * np.sin(1.5 * t)
        both = -D @ omega + np.cross(M, r.T @ V)
        for total, wanted in (
            (first + second, both),
            (sum([first, second]), both),
            (first + law + space, -D @ omega + body + r.T @ H),
            (law + first, -D @ omega + body),
            (space + first, -D @ omega + r.T @ H),
            (sum([law, law], in_space(space)), 2.0 * body + r.T @ H),
            (first + brake, -D @ omega - 0.1 * omega * t),
            (brake + first, -D @ omega - 0.1 * omega * t),
            (law + recorded(brake), body - 0.1 * omega * t),
        ):
            assert isinstance(total, StateTorque)
            assert total.at(t, omega, attitude) == pytest.approx(wanted, rel=1e-12, abs=1e-12)
    assert not (first + law).needs_attitude
    assert (first + space).needs_attitude


def test_sums_of_laws_are_laws() -> None:
    for frame in ("body", "space"):
        first = TorqueLaw(C0, RATE, [(S1, 1.5)], [(C1, 2.0)], frame)
        second = TorqueLaw(V, M, [(S2, 0.7)], [(C2, 0.0)], frame)
        total = sum([first, second])
        assert isinstance(total, TorqueLaw)
        assert total.frame == frame
        for t in (0.0, 0.4, 3.0):
            wanted = np.add(first.at(t), second.at(t))
            assert total.at(t) == pytest.approx(wanted, rel=1e-14)
    # A law that is zero has no axes.
    assert TorqueLaw() + TorqueLaw(V, frame="space") == TorqueLaw(V, frame="space")
    assert TorqueLaw(V, frame="space") + TorqueLaw() == TorqueLaw(V, frame="space")


def test_equal_operations_of_summands_are_recorded_once() -> None:
    one = magnetic_dipole(M, V)
    more = one + in_space(H)
    assert one.tape
    assert more.tape
    # The dipole in a constant field has the nine products of the matrix, and so has the sum.
    assert len(more.tape.operations) == len(one.tape.operations)


def test_sums_with_nothing_and_with_what_is_no_torque() -> None:
    stuck = opaque(lambda t, omega: [0.0, 0.0, 0.0])
    assert stuck + 0 is stuck
    values: list[Any] = [1, 0.0, True, "drag", V, None]
    for other in values:
        for torque in (damping(1.0), TorqueLaw(V)):
            with pytest.raises(TypeError):
                torque + other
            with pytest.raises(TypeError):
                other + torque
