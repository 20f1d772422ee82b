"""Tests of the compiled Taylor series for torques that depend on the state."""

import math
import pickle
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest

import pyharness.engine.system.recorded as recorded_module
from pyharness import Scene, TorqueLaw, case_scene, prepare, solve, solve_many, torques
from pyharness.checks.scenes.random_scenes import draw as draw_law
from pyharness.checks.scenes.state_scenes import draw
from pyharness.engine.methods.taylor import taylor
from pyharness.engine.system.recorded import kernel_tape, system_of
from pyharness.model.codes import Operations
from pyharness.model.state_torque import recorded, replayed
from tests.engine.test_prepared_threads import in_threads

MOMENTS = (1.0, 2.0, 2.5)
SPHERE = (2.0, 2.0, 2.0)


def scene_of(torque: Any, omega: Any = (1.0, 2.0, 3.0), **own: Any) -> Scene:
    return Scene("test", omega, **{"moments": MOMENTS, "torque": torque, **own})


def damped(t: Any, omega: Any) -> Any:
    return -0.1 * omega


@pytest.mark.parametrize("number", range(12))
def test_a_law_as_a_tape_has_the_solution_and_the_growth_of_the_law(number: int) -> None:
    scene, time = draw_law("recorded", number).scene, 2.0
    if scene.coefficients is not None or scene.torque.in_space:
        scene = replace(
            scene_of(damped), torque=TorqueLaw((0.1, 0.2, -0.3), sines=[((1, 2, 3), 2.0)])
        )
    law = scene.law
    taped = replace(scene, torque=replayed(lambda t, omega, q: _law_in_symbols(law, t)))
    one: Any = taylor(scene, [time], 1e-13)
    other: Any = taylor(taped, [time], 1e-13)
    scale = max(np.abs(scene.omega).max(), np.abs(one.omega).max())
    assert np.abs(one.omega - other.omega).max() <= (2e-13 + 4e-15 * one.growth) * scale
    # Blocks of steps differ, and so do the earlier times from which perturbations are followed.
    assert 0.5 * one.growth <= other.growth <= 2.0 * one.growth


def _law_in_symbols(law: TorqueLaw, t: Any) -> Any:
    torque = np.array(law.constant) + t * np.array(law.rate)
    for amplitude, frequency in law.sines:
        torque = torque + np.array(amplitude) * np.sin(frequency * t)
    for amplitude, frequency in law.cosines:
        torque = torque + np.array(amplitude) * np.cos(frequency * t)
    return torque


@pytest.mark.filterwarnings("ignore::pyharness.ImpossibleBodyWarning")
@pytest.mark.parametrize("case", range(1, 8))
def test_a_case_written_as_a_function_has_the_bits_of_the_case(case: int) -> None:
    scene = case_scene(case)
    function: Any = lambda t, omega: _law_in_symbols(scene.law, t)  # noqa: E731
    written = replace(scene, torque=function)
    assert written == scene
    assert solve(written, 1.0).omega.tolist() == solve(scene, 1.0).omega.tolist()


@pytest.mark.parametrize("time", [0.0, 3.0, -3.0, 400.0])
def test_damped_sphere(time: float) -> None:
    found = solve(scene_of(damped, moments=SPHERE), time)
    wanted = np.array([1.0, 2.0, 3.0]) * math.exp(-0.05 * time)
    assert found.omega[0] == pytest.approx(wanted, rel=0.0, abs=3.1e-12)


def test_every_function_has_its_series() -> None:
    # Each component is the derivative of a function of time, by which it is checked.
    def torque(t: Any, omega: Any) -> Any:
        x = t + 0.0 * omega[0]
        first = np.cos(x * x) * 2.0 * x + np.exp(-x)
        second = 0.5 / np.sqrt(x + 2.0) - np.sin(0.5 * x + 1.0) * 0.5
        third = 1.0 / (1.0 + x) - 1.0 / (x + 3.0) ** 2 + 3.0 * np.tanh(3.0 * x - 2.0)
        return [first, second, third]

    def integral(t: float) -> list[float]:
        return [
            math.sin(t * t) - math.exp(-t),
            math.sqrt(t + 2.0) + math.cos(0.5 * t + 1.0),
            math.log(1.0 + t) + 1.0 / (t + 3.0) + math.log(math.cosh(3.0 * t - 2.0)),
        ]

    scene = scene_of(torque, omega=(0.3, 0.2, 0.1), moments=(1.0, 1.0, 1.0))
    assert not isinstance(scene.torque, TorqueLaw)
    times = [0.5, 1.0, 2.5]
    found = solve(scene, times, tolerance=1e-13)
    change = np.array([integral(t) for t in times]) - np.array(integral(0.0))
    assert found.omega == pytest.approx(np.array(scene.omega) + change, rel=0.0, abs=5e-13)


def test_the_truncation_error_is_subtracted() -> None:
    # The estimate is the error before the subtraction, which leaves a small part of it.
    left = []
    for number in range(12):
        scene, time = draw(Random(f"subtracted {number}"), ("wheel", "wave", "swing", "decay"))
        for times in ([time], [0.5317 * time, time]):
            fine = solve(scene, times, tolerance=1e-13, attitude=scene.attitude is not None)
            found: Any = solve(scene, times, tolerance=1e-4, attitude=scene.attitude is not None)
            scale = max(np.abs(scene.omega).max(), np.abs(fine.omega).max())
            left.append(np.abs(found.omega - fine.omega).max() / scale / found.error)
    assert np.median(left) < 0.1


@pytest.mark.parametrize(("torque", "last"), [
    (lambda t, omega: omega * omega, 1.0),  # infinite at 1 s
    (lambda t, omega: [1.0 / (1.5 - t), 0.0 * omega[0], 0.0], 1.5),
    (lambda t, omega: [-np.sqrt(1.2 - t) + 0.0 * omega[1], 0.0, 0.0], 1.2),
    (lambda t, omega: [1.0 / (omega[0] - 1.0), 0.0, 0.0], None),
])  # fmt: skip
def test_singular_torques_end_the_rows(torque: Any, last: float | None) -> None:
    scene = scene_of(torque, omega=(1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0))
    found = solve(scene, [0.5, 1.0 + 1e-6, 2.0])
    assert found.ended == ("singular" if last == 1.2 else "overflow")
    assert found.error is None
    assert found.time.tolist() == [t for t in (0.5, 1.0 + 1e-6) if last is not None and t < last]


@pytest.mark.parametrize("time", [1.3, 1.352, 1.4, 1.8, 2.0, 3.0, 8.0])
def test_a_root_whose_argument_touches_zero_is_passed(time: float) -> None:
    # The root of omega squared is |omega|, but its series continues with the sign of omega.
    def quadratic_drag(t: Any, omega: Any) -> Any:
        return [-omega[0] * np.sqrt(omega[0] ** 2) - 0.5, 0.0, 0.0]

    found = solve(scene_of(quadratic_drag, (1.0, 0.0, 0.0)), [0.5, time])
    root = math.sqrt(2.0)
    zero = root * math.atan(root)
    law = {True: math.tan, False: math.tanh}
    wanted = [law[t < zero]((zero - t) / root) / root for t in (0.5, time)]
    assert found.ended == "complete"
    assert found.omega[:, 0] == pytest.approx(wanted, abs=1e-11)


@pytest.mark.parametrize("rate", [
    lambda x: np.sin(x),
    lambda x: 1.0 - np.cos(x),
    lambda x: np.exp(x) - 1.0,
    lambda x: np.tanh(x),
    lambda x: np.sqrt(1.0 + x) - 1.0,
    lambda x: x / (1.0 + 0.3 * x),
    lambda x: x - 0.4 / (2.0 - x) + 0.2,
    lambda x: x + x * x,
    lambda x: 0.7 * x + 0.1,
])  # fmt: skip
def test_growth_is_the_derivative_by_the_start(rate: Any) -> None:
    # One component alone moves, and perturbations of it grow at all times.
    def torque(t: Any, omega: Any) -> Any:
        return [rate(omega[0]), 0.0, 0.0]

    scene, time = scene_of(torque, (0.5, 0.0, 0.0), moments=(1.0, 1.0, 1.0)), 0.8
    more, less = (replace(scene, omega=(0.5 + shift, 0.0, 0.0)) for shift in (1e-5, -1e-5))
    change = solve(more, time).omega[0, 0] - solve(less, time).omega[0, 0]
    found: Any = solve(scene, time)
    assert found.growth == pytest.approx(change / 2e-5, rel=2e-3)
    assert found.growth > 1.15


def test_growth_counts_every_requested_time() -> None:
    # Perturbations of the first component grow by exp(2) until pi, and are gone at 2 pi.
    scene = scene_of(
        lambda t, omega: [omega[0] * np.sin(t), 0.0, 0.0], (1.0, 0.0, 0.0), moments=(1, 1, 1)
    )
    assert solve(scene, 2.0 * math.pi, tolerance=1e-12).growth == pytest.approx(1.0, abs=0.01)
    both = solve(scene, [math.pi, 2.0 * math.pi], tolerance=1e-12)
    assert both.growth == pytest.approx(math.exp(2.0), rel=0.05)


def test_a_result_is_sensitive_where_rounding_reaches_the_tolerance() -> None:
    scene = scene_of(
        lambda t, omega: [2.0 * omega[0], 0.0, 0.0], (1.0, 0.0, 0.0), moments=(1, 1, 1)
    )
    for tolerance, ended in ((1e-11, "sensitive"), (1e-9, "complete")):
        found = solve(scene, 5.5, tolerance=tolerance)
        assert found.growth == pytest.approx(math.exp(11.0), rel=0.01)
        assert found.ended == ended


def test_torques_that_cancel_have_a_known_error() -> None:
    # Two terms of 1e9 N m cancel except for their rounding errors.
    def torque(t: Any, omega: Any) -> Any:
        large = 1e9 * omega[0] * omega[1]
        return [large * np.cos(t) ** 2 + large * (np.sin(t) ** 2 - 1.0), 0.0, 0.0]

    scene = scene_of(torque)
    still = replace(scene, torque=TorqueLaw())
    found, truth = solve(scene, 2.0, tolerance=1e-6), solve(still, 2.0, tolerance=1e-14)
    error = np.abs(found.omega - truth.omega).max() / 3.0
    assert found.error is not None
    assert 1e-13 < error <= found.error


def test_perturbations_are_followed_where_the_motion_is_steady() -> None:
    # The motion is a polynomial of time, but perturbations rotate some thousand radians.
    scene = scene_of(damped, omega=(0.0, 0.0, 30.0), moments=(2.0, 2.0, 1.0))
    steady = replace(scene, torque=replayed(lambda t, omega, q: 0.0 * omega + [0.0, 0.0, 1e-3]))
    found: Any = taylor(steady, [70.0], 1e-10)
    assert found.growth == pytest.approx(1.0, abs=0.5)
    assert found.error < 1e-10


def test_body_without_products() -> None:
    found = solve(scene_of(damped, moments=SPHERE, omega=(0.0, 0.0, 0.0)), 1.0)
    assert found.omega.tolist() == [[0.0, 0.0, 0.0]]


def test_a_step_ends_at_each_breakpoint() -> None:
    # Pulses move a sphere that is at rest before them, and perturbations of it do not grow.
    pulse = torques.pulses(
        [1.0, 2.0, 5.0], [0.5, 0.25, 2.0**-20], [(2, 0, 0), (0, 4, 0), (0, 0, 2.0**21)]
    )
    scene = scene_of(pulse, omega=(0.0, 0.0, 0.0), moments=SPHERE)
    times = [-1.0, 0.0, 0.5, 1.25, 1.5, 2.1, 4.0, 5.0, 7.0]
    for tolerance in (1e-3, 1e-12):
        found: Any = solve(scene, times, tolerance=tolerance)
        wanted = np.zeros((9, 3))
        wanted[3:, 0] = (0.25, 0.5, 0.5, 0.5, 0.5, 0.5)
        wanted[5:, 1] = (0.2, 0.5, 0.5, 0.5)
        wanted[8, 2] = 1.0
        assert found.omega == pytest.approx(wanted, abs=1e-15)
        assert found.error < 1e-14
        assert found.growth == 1.0


def test_a_table_is_solved_like_the_law_that_it_equals() -> None:
    scene, time = scene_of(torques.table([-9.0, 9.0], [(0.1, -0.9, 0.0), (0.1, 0.9, 1.8)])), 6.0
    law = TorqueLaw((0.1, 0.0, 0.9), (0.0, 0.1, 0.1))
    for end in (time, -time):
        found, wanted = (
            solve(each, end, tolerance=1e-12) for each in (scene, replace(scene, torque=law))
        )
        assert wanted.growth is not None
        assert found.omega == pytest.approx(wanted.omega, abs=1e-12 + 1e-14 * wanted.growth)


def test_prepared_solver_has_the_results_of_solve() -> None:
    scene, time = draw(Random("prepared"), ("damping", "wheel"))
    scene = replace(scene, attitude=None)
    solver = prepare(scene, tolerance=1e-9)
    found = solve(scene, time, tolerance=1e-9)
    out = np.empty(3)
    assert solver(scene.omega, time, out=out) is out
    assert out.tolist() == found.omega[0].tolist()
    assert (solver.status, solver.error, solver.growth) == (found.ended, found.error, found.growth)
    assert solver.steps == found.steps
    copy = pickle.loads(pickle.dumps(solver))
    assert copy(scene.omega, time).tolist() == out.tolist()
    assert copy.plan == solver.plan
    assert solver.trajectory(scene.omega, [time]).omega.tolist() == found.omega.tolist()
    assert np.isnan(solver((math.nan, 0.0, 0.0), 1.0)).all()
    assert (solver.status, solver.error) == ("refused", None)


def test_many_bodies_do_not_depend_on_each_other() -> None:
    scene, time = draw(Random("many"), ("drag", "wave"))
    scene = replace(scene, attitude=None)
    starts = np.random.default_rng(3).normal(size=(600, 3))
    one, two = (solve_many(scene, time, omega=starts, threads=n) for n in (1, 2))
    backward = solve_many(scene, time, omega=starts[::-1])
    assert one.omega.tobytes() == two.omega.tobytes() == backward.omega[::-1].tobytes()
    solver = prepare(scene)
    assert solver(starts[7], time) == pytest.approx(one.omega[7], abs=1e-11)
    many, status = solver.many(starts[:9], time)
    assert many.tolist() == one.omega[:9].tolist()
    assert status.tolist() == one.status[:9].tolist()
    bodies = solve_many(scene, time, moments=[MOMENTS, (2.0, 3.0, 4.0)])
    alone = solve(replace(scene, moments=(2.0, 3.0, 4.0)), time)
    assert bodies.omega[1] == pytest.approx(alone.omega[0], abs=1e-11)


def test_sine_and_cosine_of_one_angle_are_one_operation() -> None:
    scene = scene_of(lambda t, omega: [np.sin(omega[0]), np.cos(omega[0]), np.cos(3.0 * t)])
    numbers = kernel_tape(system_of(scene))
    count = int(numbers[2])
    operations = numbers[8 : 8 + 2 * count].view(np.int32).reshape(count, 4)
    waves = operations[operations[:, 0] == Operations.SINE_COSINE]
    # The frequency of an angle proportional to time is known, so that its phase is not rounded.
    assert sorted(bool(each) for each in waves[:, 2]) == [False, True]


def test_phase_of_a_fast_wave_is_not_rounded() -> None:
    # After 3e5 radians a rounded phase would have an error of 3e-11.
    frequency = 1e5 + 0.1

    def torque(t: Any, omega: Any) -> Any:
        return [1e4 * np.sin(frequency * t) + 0.0 * omega[0], omega[1] * 0.01, 0.0]

    scene = scene_of(torque, omega=(0.0, 1.0, 0.0), moments=(1.0, 1.0, 1.0))
    found = solve(scene, 3.0, tolerance=1e-9)
    wanted = 1e4 / frequency * (2.0 * math.sin(0.5 * frequency * 3.0) ** 2)
    assert found.omega[0, 0] == pytest.approx(wanted, abs=1e-9)


def test_a_loop_over_starts_records_the_equations_once(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene("", (0.1, 1.0, 0.3), (3.0, 2.0, 1.0), torque=lambda t, w: -0.1 * w)
    first = solve(scene, 5.0)
    calls: list[object] = []
    monkeypatch.setattr(recorded_module, "torque_of", lambda *given: calls.append(given))
    assert (solve(scene, 5.0).omega == first.omega).all()
    solve(replace(scene, omega=(1.0, 0.2, 0.1)), 5.0)
    assert not calls
    with pytest.raises(TypeError):
        solve(replace(scene, moments=(3.0, 2.0, 1.5)), 5.0)
    assert len(calls) == 1


def test_a_pickled_tape_has_no_hash_of_another_process() -> None:
    tape: Any = recorded(lambda t, w: -0.1 * w).tape
    hash(tape)
    again = pickle.loads(pickle.dumps(tape))
    assert "_hash" not in vars(again)
    assert (again, hash(again)) == (tape, hash(tape))


def test_solutions_in_threads_share_no_memory() -> None:
    scenes = [
        scene_of(lambda t, w, q: -0.5 * q[0] * q[1:] - 0.01 * w, attitude=(1, 0.2, 0, 0)),
        scene_of(lambda t, w: [0.1 * np.sin(t), -0.1 * w[1], 0.05 * w[0] * w[1]]),
    ]
    wanted = [solve(each, 60.0) for each in scenes]

    def work(begin: int) -> int:
        found = [(solve(scenes[k % 2], 60.0), wanted[k % 2]) for k in range(begin, begin + 40)]
        return sum((a.error, a.growth) != (b.error, b.growth) for a, b in found)

    assert in_threads(4, work) == [0] * 4
