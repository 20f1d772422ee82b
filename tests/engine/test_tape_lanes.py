"""Many bodies under one torque that depends on the state, which a kernel solves side by side."""

from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Ensemble, Scene, TorqueLaw, prepare, solve, solve_many, torques
from pyharness.checks.scenes.state_scenes import draw
from pyharness.engine.prepared.many_tape import Bodies, Equations, solve_tape
from pyharness.model.arrays import unit_quaternions
from pyharness.model.attitude import angle_between
from pyharness.model.codes import Statuses

MOMENTS = (1.0, 2.0, 2.5)


def lanes(
    scene: Scene, starts: Any, times: Any, turns: Any = None, tolerance: float = 1e-10
) -> tuple[Ensemble, list[int]]:
    """Return the results of the kernel alone, and the numbers of the bodies that it leaves."""
    n = len(starts)
    at_rest = replace(scene, omega=(0.0, 0.0, 0.0))
    solver: Any
    if turns is None:
        solver = prepare(at_rest, "taylor", tolerance)
    else:
        solver = prepare(at_rest, "taylor", tolerance, attitude=True)
    found = Ensemble(
        np.full((n, 3), np.nan), np.full(n, 99, np.int8),
        None if turns is None else np.full((n, 4), np.nan),
    )  # fmt: skip
    bodies = Bodies(starts, np.atleast_2d(np.asarray(times, float)), turns)
    rows = found.with_times(np.zeros(1))
    solve_tape(Equations(solver.packed, np.empty(0)), bodies, rows, slice(0, n), np.zeros(1, "i"))
    left = np.flatnonzero(found.status != Statuses.COMPLETE).tolist()
    found.omega[left] = np.nan
    return found, left


def test_most_bodies_of_a_batch_are_solved_side_by_side() -> None:
    starts = np.random.default_rng(1).normal(size=(200, 3))
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (200, 1))
    damped = Scene("", (1.0, 0.0, 0.0), moments=MOMENTS, torque=torques.damping(0.1))
    assert len(lanes(damped, starts, 5.0)[1]) <= 2
    orbit = torques.gravity_gradient(MOMENTS, 0.5)
    turning = Scene("", (1.0, 0.0, 0.0), moments=MOMENTS, torque=orbit, attitude=(1, 0, 0, 0))
    assert len(lanes(turning, starts, 5.0, turns)[1]) <= 10
    assert len(lanes(turning, starts, 5.0, turns, 0.1)[1]) <= 10


SPACE_LAWS = {
    "constant": TorqueLaw((0.4, -0.3, 0.2), frame="space"),
    "ramp": TorqueLaw((0.4, 0.0, 0.2), rate=(0.1, 0.2, -0.1), frame="space"),
    "waves": TorqueLaw(
        (0.1, 0.0, 0.0), sines=[((0.3, 0.2, 0.1), 2.0)], cosines=[((0.2, 0.3, 0.0), 40.0)],
        frame="space",
    ),
}  # fmt: skip


@pytest.mark.parametrize("moments", [MOMENTS, (2.0, 2.0, 2.0)])
@pytest.mark.parametrize("law", SPACE_LAWS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-7, 1e-12])
def test_a_torque_about_the_axes_of_space_is_solved_side_by_side(
    law: str, moments: Any, tolerance: float
) -> None:
    source = np.random.default_rng(6)
    n = 40
    starts, turns = source.normal(size=(n, 3)), unit_quaternions(source.normal(size=(n, 4)))
    times = source.uniform(-5.0, 5.0, n)
    scene = Scene("", (1.0, 0.0, 0.0), moments=moments, torque=SPACE_LAWS[law])
    alone, left = lanes(scene, starts, times, turns, tolerance)
    assert len(left) <= n // 4
    found: Any = solve_many(
        scene, times, omega=starts, attitude=turns, tolerance=tolerance, estimates=True
    )
    done = sorted(set(range(n)) - set(left))
    assert found.omega[done].tobytes() == alone.omega[done].tobytes()
    solver = prepare(scene, tolerance=tolerance, attitude=True)
    many = solver.many(starts, times, turns)
    assert found.omega.tobytes() == many[0].tobytes()
    assert found.attitude.tobytes() == many[1].tobytes()
    for i in range(n):
        own = replace(scene, omega=tuple(starts[i]), attitude=tuple(turns[i]))
        true: Any = solve(own, times[i], "taylor", 1e-14, attitude=True)
        scale = max(np.abs(starts[i]).max(), np.abs(true.omega[-1]).max())
        allowed = tolerance + 4e-15 * found.growth[i] if i in done else 2.0 * tolerance
        error = np.abs(found.omega[i] - true.omega[-1]).max() / scale
        assert max(error, angle_between(found.attitude[i], true.attitude[-1])) <= allowed
        if i in left:  # the single-body kernel solved it
            assert np.array_equal(solver(starts[i], times[i], turns[i])[0], found.omega[i])
    single = solve_many(scene, times[3], omega=starts[3], attitude=turns[3], tolerance=tolerance)
    assert single.omega[0].tobytes() == found.omega[3].tobytes()


def test_a_law_with_thousands_of_waves_is_solved_side_by_side() -> None:
    waves = [((0.01, 0.0, 0.01), 1.0 + 0.01 * k) for k in range(2100)]
    scene = Scene(
        "", (1.0, 0.3, 0.0), moments=MOMENTS, torque=TorqueLaw(sines=waves, frame="space")
    )
    starts, turns = np.eye(3)[:2], np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    assert lanes(scene, starts, 0.5, turns)[1] == []
    found = solve_many(scene, 0.5, omega=starts, attitude=turns)
    solver = prepare(scene, attitude=True)
    for i in range(2):
        assert found.omega[i] == pytest.approx(solver(starts[i], 0.5, turns[i])[0], abs=1e-9)


@pytest.mark.campaign
def test_results_do_not_depend_on_the_other_bodies(level: int) -> None:
    scene, time = draw(Random("others"), ("field", "decay", "quotient"))
    source = np.random.default_rng(2)
    starts, turns = source.normal(size=(37, 3)), source.normal(size=(37, 4))

    def solved(rows: Any, threads: int = 1) -> Ensemble:
        return solve_many(
            scene, time, omega=starts[rows], attitude=turns[rows], method="taylor",
            threads=threads,
        )  # fmt: skip

    found, back, alone = solved(slice(37)), solved(slice(None, None, -1)), solved(slice(5, 6))
    threads = solved(np.tile(np.arange(37), 20), 2)
    assert found.attitude is not None
    assert alone.attitude is not None
    assert back.attitude is not None
    assert found.omega.tobytes() == back.omega[::-1].tobytes()
    assert found.attitude.tobytes() == back.attitude[::-1].tobytes()
    assert found.omega[5].tobytes() == alone.omega[0].tobytes()
    assert found.attitude[5].tobytes() == alone.attitude[0].tobytes()
    assert threads.omega.tobytes() == np.tile(found.omega, (20, 1)).tobytes()


def test_every_entrance_has_the_same_results() -> None:
    scene, time = draw(Random("entrances"), ("drag", "spring"))
    source = np.random.default_rng(3)
    starts, turns = source.normal(size=(30, 3)), source.normal(size=(30, 4))
    found: Any = solve_many(
        scene, time, omega=starts, attitude=turns, tolerance=1e-9, method="taylor"
    )
    solver = prepare(scene, "taylor", 1e-9, attitude=True)
    omega, attitude, status = solver.many(starts, time, turns)
    assert omega.tobytes() == found.omega.tobytes()
    assert attitude.tobytes() == found.attitude.tobytes()
    assert status.tobytes() == found.status.tobytes()
    spin = Scene("", (1.0, 0.0, 0.0), moments=MOMENTS, torque=torques.damping(0.1))
    many, _ = prepare(spin, "taylor", 1e-9).many(starts, time)
    assert many.tobytes() == lanes(spin, starts, time, tolerance=1e-9)[0].omega.tobytes()


def test_bodies_that_can_not_be_solved_are_left() -> None:
    spin = Scene("", (1.0, 0.0, 0.0), moments=MOMENTS, torque=torques.damping(0.1))
    starts = np.array([
        [1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0], [1e80, 1.0, 1.0],
        [1e-80, 0.0, 0.0], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 1.0, 1.0],
    ])  # fmt: skip
    times = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, np.nan, 1e9, 2.0])
    found, left = lanes(spin, starts, times)
    assert left == list(range(1, 9))
    assert np.isnan(found.omega[1:9]).all()
    singular = Scene(
        "", (1.0, 1.0, 1.0), moments=MOMENTS, torque=lambda t, w: [1 / (w[0] - 1), 0, 0]
    )
    near = np.array([[2.0, 1.0, 1.0], [1.0, 1.0, 1.0], [2.0, 1.0, 1.0]])
    assert lanes(singular, near, 0.1)[1] == [1]
    rising = Scene("", (1.0, 1.0, 1.0), moments=MOMENTS, torque=lambda t, w: [w[0] ** 2, 0.0, 0.0])
    assert 0 in lanes(rising, starts[[9, 9]], 3.0)[1]
    turns = np.array([[1.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 0.0], [0.5, 0.5, 0.5, 0.5]])
    assert lanes(spin, starts[[0, 9, 0]], 1.0, turns)[1] == [1]


def test_a_product_whose_first_terms_do_not_show_it() -> None:
    starts = np.linspace(0.01, 0.3, 16)[:, None] * [1.0, 0.0, 0.0]

    def rising(doublings: int) -> tuple[Ensemble, list[int]]:
        def torque(t: Any, w: Any) -> Any:
            power = w[0]
            for _ in range(doublings):
                power = power * power
            return (1.0, 0.0, power)

        return lanes(Scene("", (1.0, 0.0, 0.0), moments=(1, 1, 1), torque=torque), starts, 1.0)

    for doublings in (2, 3):
        found, left = rising(doublings)
        n = 2**doublings + 1
        exact = ((starts[:, 0] + 1.0) ** n - starts[:, 0] ** n) / n
        assert not left
        assert found.omega[:, 2] == pytest.approx(exact, rel=1e-13)
    # The order of the lanes would not suffice.
    assert rising(4)[1] == list(range(16))


def test_unstable_motions_are_left() -> None:
    # Errors grow as exp(2 t), until the last digits are lost.
    unstable = Scene(
        "", (1.0, 0.0, 0.0), moments=MOMENTS, torque=lambda t, w: [0.0, 4.0 * w[1], 0.0]
    )
    starts = np.array([[1.0, 1e-6, 0.3]] * 8)
    assert lanes(unstable, starts, 0.5)[1] == []
    assert lanes(unstable, starts, 6.0)[1] == list(range(8))
