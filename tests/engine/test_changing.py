"""Tests of the motion of bodies whose moments of inertia are polynomials of time."""

import math
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import (
    ChangingInertia,
    ChangingMoments,
    InputError,
    Scene,
    TorqueLaw,
    Trajectory,
    case_scene,
    opaque,
    prepare,
    solve,
    solve_many,
    torques,
)
from pyharness.engine.plan.registry import METHODS
from pyharness.model.attitude import IDENTITY
from pyharness.model.codes import Statuses
from pyharness.truth.reference import reference
from tests.engine.tolerance_scenes import KINDS, motions
from tests.engine.tolerance_scenes import draw_changing as draw

BOOMS = ChangingMoments([[40.0, 0.5, -0.01], [30.0, -0.3, 0.0, 0.001], [20.0, 0.4]])
SCENE = Scene("booms", (0.3, 1.0, -0.6), moments=BOOMS)
ABLE = [name for name, method in METHODS.items() if method.state_torque]


def matrices_of(scene: Scene) -> list[Any]:
    """Return the coefficients of the inertia of a scene, matrices of shape (3, 3)."""
    if isinstance(scene.changing, ChangingInertia):
        return [np.array(each) for each in scene.changing.matrices]
    assert isinstance(scene.changing, ChangingMoments)
    most = max(map(len, scene.changing.polynomials))
    return [
        np.diag([each[n] if n < len(each) else 0.0 for each in scene.changing.polynomials])
        for n in range(most)
    ]


def by_momentum(scene: Scene) -> Callable[[float, Any], list[float]]:
    """Return the right-hand side of L' = N - omega x L and of the attitude, written by hand.

    The unknowns are the momentum about the body axes, and the quaternion.
    """
    matrices = matrices_of(scene)
    law = scene.torque if isinstance(scene.torque, TorqueLaw) else None

    def slopes(time: float, state: Any) -> list[float]:
        momentum, (a, b, c, d) = np.array(state[:3]), state[3:]
        omega = np.linalg.solve(sum(each * time**n for n, each in enumerate(matrices)), momentum)
        if law is None:
            given: Any = scene.torque
            push = np.array(given.at(time, omega, state[3:]))
        else:
            push = np.array(law.at(time))
            if law.in_space:
                v = -np.array([b, c, d])
                push = push + 2.0 * np.cross(v, np.cross(v, push) + a * push)
        x, y, z = omega
        turn = [
            -0.5 * (b * x + c * y + d * z), 0.5 * (a * x + c * z - d * y),
            0.5 * (a * y + d * x - b * z), 0.5 * (a * z + b * y - c * x),
        ]  # fmt: skip
        return [*(push - np.cross(omega, momentum)), *turn]

    return slopes


def scipy_end(scene: Scene, time: float) -> tuple[Any, Any]:
    """Return omega and attitude at a time by SciPy and the right-hand side written by hand."""
    matrices = matrices_of(scene)
    start = [*(matrices[0] @ scene.omega), *(scene.attitude or IDENTITY)]
    sizes = [1e-14 * max(map(abs, start[:3]))] * 3 + [1e-14] * 4
    found = solve_ivp(
        by_momentum(scene), (0.0, time), start, method="DOP853", rtol=3e-14, atol=sizes
    )
    assert found.success
    end = found.y[:, -1]
    inertia = sum(each * time**n for n, each in enumerate(matrices))
    return np.linalg.solve(inertia, end[:3]), end[3:] / np.linalg.norm(end[3:])


def difference(first: Any, second: Any) -> float:
    """Return the largest difference of two omegas, relative to the largest component."""
    return float(np.abs(np.subtract(first, second)).max() / max(1e-3, np.abs(second).max()))


@pytest.mark.sampled
@pytest.mark.parametrize("name", KINDS["changing inertia"])
def test_true_motion_satisfies_a_right_hand_side_written_by_hand(name: str) -> None:
    motion = motions("changing inertia")[name]
    omega, attitude = scipy_end(motion.scene, motion.times[1])
    assert difference(omega, motion.omega[1]) < 3e-11
    assert np.abs(attitude - motion.attitude[1]).max() < 3e-11


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(4))
def test_reference_agrees_with_mpmath(seed: int) -> None:
    scene, _ = draw(Random(f"mpmath {seed}"), full=seed % 2 == 1)
    scene = replace(scene, attitude=None)
    mpmath.mp.dps = 30
    matrices = [mpmath.matrix(each.tolist()) for each in matrices_of(scene)]

    def omega(time: Any, momentum: Sequence[Any]) -> Any:
        inertia = mpmath.zeros(3)
        for n, each in enumerate(matrices):
            inertia += each * time**n
        return mpmath.lu_solve(inertia, mpmath.matrix(momentum))

    def slopes(time: Any, momentum: Sequence[Any]) -> list[Any]:
        (x, y, z), (a, b, c) = omega(time, momentum), momentum
        return [b * z - c * y, c * x - a * z, a * y - b * x]

    start = list(matrices[0] * mpmath.matrix(scene.omega))
    time = mpmath.mpf(0.5)
    end = mpmath.odefun(slopes, 0, start, tol=mpmath.mpf("1e-22"))(time)
    expected = [float(x) for x in omega(time, end)]
    assert difference(reference(scene, [0.5]).omega[0], expected) < 3e-16


@pytest.mark.parametrize("seed", range(20))
def test_momentum_in_space_is_constant_without_torque(seed: int) -> None:
    scene, time = draw(Random(f"momentum {seed}"), full=seed % 2 == 1)
    times = time * np.linspace(0.0, 1.0, 9)
    found = solve(scene, times, attitude=True, tolerance=1e-14)
    assert found.moments is scene.changing
    momentum = found.angular_momentum("space")
    assert np.abs(momentum - momentum[0]).max() <= 1e-12 * np.linalg.norm(momentum[0])


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("method", ABLE)
def test_spin_about_one_axis_is_momentum_over_moment(axis: int, method: str) -> None:
    first, second, third = 2.0 * np.eye(3)[axis]
    times = [-4.0, 0.0, 3.0, 15.0]
    found = solve(replace(SCENE, omega=(first, second, third)), times, method)
    moments = np.array([BOOMS.at(time)[axis] for time in times])
    expected = np.zeros((4, 3))
    expected[:, axis] = 2.0 * BOOMS.at(0.0)[axis] / moments
    # Methods whose step is that of the scene have errors of their order.
    stepped = METHODS[method].is_fixed_step or method.startswith("gauss")
    limit = 4e-15 if method in ("auto", "taylor", "reference") else 1e-4 if stepped else 1e-8
    assert found.omega == pytest.approx(expected, rel=limit, abs=0.0)


def test_energy_and_momentum_are_those_of_the_moments_at_each_time() -> None:
    found = solve(SCENE, [5.0, 0.0, -3.0])
    moments = np.array([BOOMS.at(time) for time in (5.0, 0.0, -3.0)])
    assert found.angular_momentum() == pytest.approx(moments * found.omega, rel=1e-15)
    energy = 0.5 * (moments * found.omega**2).sum(axis=1)
    assert found.energy() == pytest.approx(energy, rel=1e-15)
    length = np.linalg.norm(found.angular_momentum(), axis=1)
    assert length == pytest.approx(length[1], rel=1e-12)


def test_work_of_the_torque_is_the_change_of_energy_and_the_work_against_the_change() -> None:
    """The energy T satisfies T' = omega N - omega I' omega/2, and its integral is checked."""
    scene = replace(SCENE, torque=torques.damping(0.5) + TorqueLaw((1.0, -2.0, 0.5)))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    times = np.array([0.0, *(2.0 * (nodes + 1.0)), 4.0])
    found = solve(scene, times)
    pushes = np.array([scene.torque.at(0.0, w, IDENTITY) for w in found.omega])  # type: ignore[call-arg]
    rates = np.array([np.diag(BOOMS.matrix_rate(time)) for time in times])
    power = (found.omega * pushes - 0.5 * rates * found.omega**2).sum(axis=1)
    energy = found.energy()
    assert 2.0 * weights @ power[1:-1] == pytest.approx(energy[-1] - energy[0], rel=1e-12)


@pytest.mark.parametrize("method", sorted(set(METHODS) - {"quick"}))
@pytest.mark.parametrize("attitude", [False, True])
def test_constant_polynomials_give_the_bits_of_constant_moments(
    method: str, attitude: bool
) -> None:
    if attitude and not METHODS[method].attitude:
        return
    polynomials = ChangingMoments([[40.0, 0.0], [30.0], [20.0, 0.0, 0.0]])
    both: Any = [
        solve(Scene("same", (0.3, 1.0, -0.6), moments=each), [1.0], method, attitude=attitude)
        for each in (polynomials, (40.0, 30.0, 20.0))
    ]
    assert both[0].omega.tobytes() == both[1].omega.tobytes()
    assert both[0].moments == both[1].moments == (40.0, 30.0, 20.0)
    if attitude:
        assert both[0].attitude.tobytes() == both[1].attitude.tobytes()


def test_gravity_gradient_of_a_matrix_takes_its_value_at_each_time() -> None:
    scene, _ = draw(Random("gradient"), full=True)
    assert isinstance(scene.changing, ChangingInertia)
    torque = torques.gravity_gradient(scene.changing, 0.7)
    state = (0.1, 0.2, 0.3), (0.5, 0.1, 0.7, 0.5)
    for time in (0.0, 0.4):
        expected = torques.gravity_gradient(scene.changing.at(time), 0.7).at(time, *state)
        assert torque.at(time, *state) == pytest.approx(expected, rel=1e-13)


def test_opaque_torque_is_solved_by_a_method_of_scipy() -> None:
    def brake(t: float, omega: Any) -> list[float]:
        return [-8.0 * math.tanh(omega[0]), 0.0, math.sin(t)]

    def smooth(t: Any, omega: Any) -> list[Any]:
        return [-8.0 * np.tanh(omega[0]), 0.0, np.sin(t)]

    times = [1.0, 4.0]
    found = solve(replace(SCENE, torque=opaque(brake)), times, "dop853", 1e-9)
    assert (
        difference(found.omega, solve(replace(SCENE, torque=torques.recorded(smooth)), times).omega)
        < 1e-9
    )


TORQUES: dict[str, Any] = {
    "none": TorqueLaw(),
    "law": TorqueLaw((1.0, 0.0, 2.0), sines=[((0.0, 3.0, 0.0), 2.0)]),
    "damping": torques.damping(2.0),
}


@pytest.mark.parametrize("kind", TORQUES)
def test_every_entry_point_has_the_result_of_solve(kind: str) -> None:
    scene = replace(SCENE, torque=TORQUES[kind])
    end = solve(scene, 7.0, tolerance=1e-11).omega[-1]
    solver = prepare(scene, tolerance=1e-11)
    assert solver(scene.omega, 7.0).tobytes() == end.tobytes()
    assert solver.status == "complete"
    assert pickle.loads(pickle.dumps(solver))(scene.omega, 7.0).tobytes() == end.tobytes()
    omega, status = solver.many(np.array([scene.omega] * 3), [7.0, 1e9, 7.0], threads=2)
    # Many bodies are integrated by another kernel.
    assert omega[0].tobytes() == omega[2].tobytes()
    assert omega[0] == pytest.approx(end, rel=1e-11)
    assert np.isnan(omega[1]).all()
    assert status[0] == status[2] == 0 != status[1]
    many = solve_many([case_scene(5), scene], [1.0, 7.0])
    assert many.omega[1] == pytest.approx(end, rel=1e-11)
    many = solve_many(scene, [7.0, 7.0], omega=[scene.omega, (1.0, 1.0, 1.0)])
    assert many.omega[0] == pytest.approx(end, rel=1e-11)
    omega, attitude = prepare(scene, attitude=True)(scene.omega, 7.0)
    found: Any = solve(scene, 7.0, attitude=True)
    assert omega.tobytes() == found.omega[-1].tobytes()
    assert attitude.tobytes() == found.attitude[-1].tobytes()


def test_arrays_of_bodies_and_torques_replace_those_of_the_scene() -> None:
    moments = np.array([[3.0, 2.0, 1.5], [4.0, 3.0, 2.0]])
    found = solve_many(SCENE, 2.0, moments=moments)
    expected = solve_many(Scene("constant", SCENE.omega, moments=(1, 1, 1)), 2.0, moments=moments)
    assert found.omega.tobytes() == expected.omega.tobytes()
    constant = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 0.0]])
    found = solve_many(SCENE, 2.0, torque_constant=constant)
    for row, torque in zip(found.omega, constant, strict=True):
        end = solve(replace(SCENE, torque=TorqueLaw(torque)), 2.0).omega[-1]
        assert row == pytest.approx(end, rel=1e-12)


SHRINKING = Scene(
    "shrinking", (1.0, 2.0, 3.0), moments=ChangingMoments([[9.0], [8.0, -0.4], [7.0]])
)


def test_times_before_a_zero_are_solved() -> None:
    found: Trajectory = solve(SHRINKING, [-50.0, 19.0], tolerance=1e-12)
    assert found.ended == "complete"
    length = np.linalg.norm(found.angular_momentum(), axis=1)
    start = np.linalg.norm(np.array([9.0, 8.0, 7.0]) * SHRINKING.omega)
    assert length == pytest.approx(start, rel=1e-11)
    states = solve_many(SHRINKING, [19.0, 21.0], tolerance=1e-12)
    alone = solve(SHRINKING, 19.0, tolerance=1e-12).omega[-1]
    assert states.omega[0] == pytest.approx(alone, rel=1e-11)
    assert np.isnan(states.omega[1]).all()
    assert states.ended.tolist() == ["complete", "refused"]
    starts = np.array([SHRINKING.omega] * 2)
    for attitude in (False, True):
        solver: Any = prepare(SHRINKING, attitude=attitude)
        *_, status = solver.many(starts, [10.0, 21.0])
        assert status.tolist() == [Statuses.COMPLETE, Statuses.REFUSED]
        with pytest.raises(InputError, match="reaches 0 at t = 20 s"):
            solver(SHRINKING.omega, 21.0)
