"""Gauss collocation under torques that depend on the state."""

import math
from contextlib import suppress
from random import Random
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import Scene, case_scene, solve, torques
from pyharness.methods.gauss_state import GaussState, tables
from pyharness.methods.problem import normalized
from pyharness.methods.registry import GAUSS, METHODS
from pyharness.model.attitude import angle_between
from pyharness.model.codes import Statuses
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.scenes.state_scenes import draw, draw_ready
from pyharness.theory.state_conditioning import conditioning_at
from pyharness.truth.reference import reference
from tests.methods.test_fixed_state import as_tape

STAGES = range(1, 9)


@pytest.mark.parametrize("stages", STAGES)
def test_coefficients_satisfy_their_definitions(stages: int) -> None:
    one = tables(stages)
    for node in one.nodes:
        slope = mpmath.diff(lambda x: mpmath.legendre(stages, x), 2 * node - 1)
        assert abs(mpmath.legendre(stages, 2 * node - 1) / slope) < 4e-16
    for power in range(stages):
        values = one.nodes**power
        assert one.weights @ values == pytest.approx(1.0 / (power + 1), rel=1e-15)
        wanted = one.nodes ** (power + 1) / (power + 1)
        assert one.matrix @ values == pytest.approx(wanted, rel=0.0, abs=1e-15)
        wanted = ((1.0 + one.nodes) ** (power + 1) - 1.0) / (power + 1)
        assert one.onward @ values == pytest.approx(wanted, rel=1e-10)


@pytest.mark.parametrize("stages", STAGES)
@pytest.mark.parametrize("case", [3, 5, 7])
def test_steps_are_those_of_the_compiled_kernel(stages: int, case: int) -> None:
    scene, times, step = case_scene(case), [0.1, 0.3], 0.02
    rows, reached, n_rows, status, _ = extension().gauss_solution(
        *normalized(scene), scene.omega, times, stages, step
    )
    own = GaussState(as_tape(scene), stages, times, 1.0)
    found, end, n, ending, _ = own.rows(step)
    assert (n, ending) == (n_rows, status) == (2, Statuses.COMPLETE)
    assert np.abs(found - rows).max() <= 2e-14 * np.abs(rows).max()
    assert end == pytest.approx(reached, rel=1e-13)


def _torque(t: Any, w: Any, q: Any) -> Any:
    speed = np.sqrt(1.0 + w @ w)
    return -0.2 * speed * w + np.array(
        [q[0] * q[1], np.sin(2.0 * t), 3.0 * q[2] / (2.0 + w[0] ** 2)]
    )


# For each number of stages: the numbers of steps of two solutions whose errors are above rounding,
# and the largest difference of the observed order from twice the stages. With the longest steps the
# error does not yet fall at the full order.
STEPS = {
    1: (64, 128, 0.1), 2: (48, 96, 0.1), 3: (32, 64, 0.1), 4: (32, 64, 0.1), 5: (16, 32, 0.2),
    6: (12, 20, 0.6), 7: (8, 12, 1.7), 8: (8, 10, 2.2),
}  # fmt: skip


@pytest.mark.parametrize("stages", STAGES)
@pytest.mark.parametrize("with_attitude", [False, True])
def test_error_falls_with_twice_the_number_of_stages(stages: int, with_attitude: bool) -> None:
    scene = Scene(
        "order", (1.0, 2.0, 1.5), moments=(4.0, 3.0, 2.0),
        torque=_torque if with_attitude else lambda t, w: _torque(t, w, (1.0, t, 0.5, 0.0)),
        attitude=(0.5, 0.5, -0.5, 0.5) if with_attitude else None,
    )  # fmt: skip
    truth = reference(scene, [8.0])
    errors = []
    *counts, off = STEPS[stages]
    for count in counts:
        one = GaussState(scene, stages, [8.0], 1.0)
        rows, _, n, status, _ = one.rows(8.0 / count)
        assert (n, status) == (1, Statuses.COMPLETE)
        error = [float(np.abs(rows[:3, 0] - truth.omega[0]).max())]
        if truth.attitude is not None:
            error.append(float(np.abs(rows[3:, 0] - truth.attitude[0]).max()))
        errors.append(error)
    assert np.min(errors) > 4e-15
    coarse, fine = np.array(errors)
    orders = np.log(coarse / fine) / np.log(counts[1] / counts[0])
    assert np.abs(orders - 2 * stages).max() < off


@pytest.mark.parametrize("number", range(16))
def test_error_is_below_the_tolerance_and_known(number: int) -> None:
    source = Random(f"gauss {number}")
    flow = None
    while flow is None:  # some scenes diverge
        scene, time = (draw, draw_ready)[number % 2](source)
        time = np.copysign(min(abs(time), 8.0 / np.abs(scene.omega).max()), time)
        method, times = f"gauss-{number % 7 + 2}", [0.4 * time, time]
        with suppress(InputError):
            flow = conditioning_at(scene, times)
    tolerance = max(METHODS[method].finest, 10.0 ** source.uniform(-11.0, -3.0))
    attitude = scene.attitude is not None
    found, truth = (
        solve(scene, times, method, tolerance, attitude=attitude),
        reference(scene, times),
    )
    assert found.ended == "complete"
    limit = tolerance + 4e-15 * flow.amplification
    error = float(np.abs(found.omega - truth.omega).max()) / flow.largest
    if found.attitude is not None and truth.attitude is not None:
        error = max(error, float(angle_between(found.attitude, truth.attitude).max()))
    assert error <= limit
    assert found.error is not None
    assert error <= 10.0 * found.error + 4e-15 * flow.amplification
    assert found.growth is not None


@pytest.mark.parametrize("method", GAUSS)
def test_known_decay_on_both_sides_of_0(method: str) -> None:
    scene = Scene("", (1.0, 2.0, 3.0), moments=(2, 2, 2), torque=torques.damping(0.2))
    found = solve(scene, [-1.0, 0.0, 2.0], method, 1e-7)
    wanted = np.outer(np.exp([0.1, 0.0, -0.2]), [1.0, 2.0, 3.0])
    assert np.abs(found.omega - wanted).max() <= 4e-7


def test_wheel_conserves_energy_and_momentum_in_the_long_run() -> None:
    """Gauss collocation conserves quadratic invariants up to rounding, which does not add up."""
    moments, momentum = np.array([4.0, 3.0, 2.0]), np.array([0.0, 1.0, 0.5])

    def torque(t: Any, w: Any) -> Any:
        return np.cross(momentum, w)

    scene = Scene("wheel", (0.3, 1.0, 0.5), moments=tuple(moments), torque=torque)
    rows, _, n, _, _ = GaussState(scene, 4, [50.0, 100.0, 200.0], 100.0).rows(0.2)
    assert n == 3
    start = np.array(scene.omega)
    for omega in rows.T:
        energy = moments @ (omega * omega) / (moments @ (start * start)) - 1.0
        size = np.linalg.norm(moments * omega + momentum)
        assert abs(energy) < 1e-14
        assert abs(size / np.linalg.norm(moments * start + momentum) - 1.0) < 1e-14


def test_steps_end_where_a_table_changes() -> None:
    """A held table jumps; the error nevertheless falls at the full order."""
    values = [[1.0, 0.0, 0.5], [-2.0, 1.0, 0.0], [0.5, 0.5, -1.0]]
    torque = torques.table([0.0, 0.61, 1.37], values, "held") + torques.damping(0.2)
    scene = Scene("held", (0.3, 1.0, 0.5), moments=(4.0, 3.0, 2.0), torque=torque)
    for times in ([2.0], [0.3, 0.61, 1.9], [-1.0]):
        truth = reference(scene, times)
        errors = []
        for parts in (1, 2):
            one = GaussState(scene, 2, times, 1.0)
            one.counts(0.25)
            rows, _, n, status, _ = one.rows(0.25 / parts)
            assert (n, status) == (len(times), Statuses.COMPLETE)
            errors.append(np.abs(rows.T - truth.omega).max())
        assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)
        found = solve(scene, times, "gauss-4", 1e-12)
        assert np.abs(found.omega - truth.omega).max() < 3e-12


@pytest.mark.parametrize("method", ["gauss-2", "gauss-4", "gauss-8"])
@pytest.mark.parametrize("width", [0.02, 0.05, 0.2])
def test_two_solutions_do_not_agree_by_missing_a_pulse(method: str, width: float) -> None:
    def pulse(t: Any, w: Any) -> Any:
        return [0.0 * t, 0.0 * t, np.exp(-(((t - 3.3) / width) ** 2)) / width]

    scene = Scene("ball", (0.3, -0.2, 1.0), moments=(1.0, 1.0, 1.0), torque=pulse)
    found = solve(scene, [10.0], method, tolerance=1e-6)
    error = abs(found.omega[0, 2] - (1.0 + math.sqrt(math.pi)))
    assert found.error is not None
    assert error <= 10.0 * found.error + 1e-13
    assert error <= 3e-6
