"""The attitude by the joint series and from rows of omega, against independent integrators."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pyharness
from pyharness import (
    InputError,
    Scene,
    Stepper,
    TorqueLaw,
    case_scene,
    prepare,
    run_program,
    solve,
    subset,
)
from pyharness.engine.plan.plan import plan
from pyharness.engine.steps.from_rows import attitude_from_rows
from pyharness.model.attitude import angle_between

TURNED = (0.5, -0.1, 0.7, 0.5)
# A spin hardly changes omega, but the body rotates all the same.
SPIN = Scene("", (0.0, 0.0, 10.0), moments=(40.0, 30.0, 20.0), torque=TorqueLaw((0.0, 0.0, 1e-3)))
SCENES = {
    **{f"case {n}": replace(case_scene(n), attitude=TURNED) for n in range(1, 8)},
    "spin": SPIN,
    "coefficients": Scene("", (0.3, -1.0, 2.0), coefficients=(0.3, -0.7, 0.5)),
    "sphere of coefficients": Scene("", (0.3, -1.0, 2.0), coefficients=(0.0, 0.0, 0.0)),
    "rest": Scene("", (0.0, 0.0, 0.0), moments=(4.0, 3.0, 2.0), torque=TorqueLaw((1.0, 0.0, 2.0))),
}


def test_momentum_and_energy_without_torque_stay() -> None:
    found = solve(
        case_scene(4), np.linspace(0.1, 20.0, 50).tolist(), "taylor", 1e-13, attitude=True
    )
    momentum = found.angular_momentum("space")
    assert np.abs(momentum - momentum[0]).max() < 2e-13 * np.abs(momentum).max()
    assert found.energy() == pytest.approx(np.full(50, found.energy()[0]), rel=1e-13)
    body = found.angular_momentum()
    assert found.rotation().apply(body) == pytest.approx(momentum, rel=1e-13, abs=1e-12)


def test_signs_are_continuous() -> None:
    found: Any = solve(case_scene(5), np.linspace(0.0, 3.0, 400).tolist(), "auto", attitude=True)
    assert (np.einsum("ni,ni->n", found.attitude[1:], found.attitude[:-1]) > 0.9).all()


def test_estimate_tells_the_error() -> None:
    ratios = []
    for number in range(2, 8):
        scene = replace(case_scene(number), attitude=TURNED)
        fine: Any = solve(scene, [3.0], "taylor", 1e-14, attitude=True).attitude
        for tolerance in (1e-3, 1e-5, 1e-8):
            found: Any = solve(scene, [3.0], "taylor", tolerance, attitude=True)
            ratios.append(angle_between(found.attitude, fine)[0] / (found.error or 0.0))
    # The estimated error has been subtracted from the result.
    assert 1e-3 < min(ratios) <= max(ratios) < 2.5
    assert sorted(ratios)[len(ratios) // 2] < 0.22
    assert sorted(ratios)[-2] < 1.0


def test_attitude_is_computed_by_default_if_the_scene_has_one() -> None:
    scene = replace(case_scene(5), attitude=TURNED)
    bare = solve(case_scene(5), [1.0], "taylor")
    assert bare.attitude is None
    found = solve(scene, [1.0], "taylor", attitude=False)
    assert found.attitude is None
    assert found.omega.tolist() == bare.omega.tolist()
    assert solve(scene, [1.0], "gauss-4").attitude is None
    other = Scene("", (1.0, 2.0, 3.0), coefficients=(0.5, -0.5, 0.2), attitude=TURNED)
    assert solve(other, 1.0, "closed-form").attitude is None
    asked: Any = solve(scene, [1.0], attitude=True)
    default: Any = solve(scene, [1.0])
    stepper: Any = Stepper(scene)
    assert np.array_equal(default.attitude, asked.attitude)
    assert stepper.attitude.tolist() == list(scene.attitude or ())
    turn: Any = lambda t, w, q: -q[1:]  # noqa: E731
    assert solve(replace(case_scene(5), torque=turn), 1.0).attitude is not None
    assert "attitude" in plan(case_scene(5)).skipped
    assert "attitude" not in plan(scene).skipped


def test_step_from_row_to_row_has_order_four() -> None:
    scene = replace(case_scene(5), attitude=TURNED)
    errors = []
    for count in (20, 40, 80):
        fine: Any = solve(scene, [n / count for n in range(1, count + 1)], "taylor", attitude=True)
        rows = attitude_from_rows(scene, fine.time, fine.omega)
        errors.append(angle_between(rows, fine.attitude).max())
    assert errors[0] < 1e-4
    assert [errors[0] / errors[1], errors[1] / errors[2]] == pytest.approx([16.0, 16.0], rel=0.1)


def test_rows_of_a_program_have_an_attitude() -> None:
    scene = replace(case_scene(3), attitude=TURNED)
    rows = run_program(scene, subset("two-term", "corrected"))
    found = attitude_from_rows(scene, rows.time, rows.omega)
    fine: Any = solve(scene, rows.time.tolist(), attitude=True).attitude
    # The error comes from the program's omega alone.
    error = np.abs(rows.omega - solve(scene, rows.time.tolist()).omega).max()
    assert 1e-6 < angle_between(found, fine).max() < 2.0 * error * rows.time[-1]


@pytest.mark.filterwarnings("error")
def test_rows_that_run_away_turn_beyond_every_number() -> None:
    scene = replace(case_scene(7), steps=2000)
    rows = run_program(scene, subset("two-term", "original"))
    assert not np.abs(rows.omega).max() < 1e100
    found = attitude_from_rows(scene, rows.time, rows.omega)
    lost = np.isnan(found).any(axis=1)
    assert lost.any()
    assert np.argmax(lost) > 700
    assert np.isnan(found[np.argmax(lost) :]).all()


@pytest.mark.parametrize("name", SCENES)
def test_prepared_solver_gives_what_solve_gives(name: str) -> None:
    scene = SCENES[name]
    solver = prepare(scene, tolerance=1e-10, attitude=True)
    assert (solver.status, solver.digits, solver.steps) == ("complete", None, 0)
    for time in (0.7, -1.5):
        omega, attitude = solver(scene.omega, time)
        found: Any = solve(scene, [time], tolerance=1e-10, attitude=True)
        assert omega.tolist() == found.omega[0].tolist()
        assert attitude.tolist() == found.attitude[0].tolist()
        ends = found.ended, found.error, found.growth
        assert (solver.status, solver.error, solver.growth) == ends
    assert np.isnan(np.hstack(solver((float("nan"), 2.0, 3.0), 1.0))).all()
    assert solver.status in ("overflow", "refused")
    assert name != "case 4" or solver.status == "overflow"


def test_prepared_solver_takes_every_kind_of_argument() -> None:
    solver: Any = prepare(replace(case_scene(4), attitude=TURNED), attitude=True)
    start = np.array([1.0, 2.0, 3.0])
    usual = [each.tolist() for each in solver(start, 1.0)]
    for arguments, named in (
        (([1, 2, 3], 1, TURNED), {}),
        ((start, 1.0), {"attitude": np.array(TURNED)}),
        ((range(1, 4), np.float32(1.0), None), {}),
        ((start, 1.0, [1.0, -0.2, 1.4, 1.0]), {}),
        ((), {"t_end": 1.0, "omega": start, "attitude": iter(TURNED)}),
    ):
        found = solver(*arguments, **named)
        assert [each.shape for each in found] == [(3,), (4,)]
        assert np.abs(np.concatenate(found) - np.concatenate(usual)).max() < 1e-14
    for attitude0 in ((1.0, 0.0, 0.0), "1000"):
        with pytest.raises(InputError, match="attitude"):
            solver(start, 1.0, attitude0)
    for more, named in (((TURNED, 1.0), {}), ((), {"out": start})):
        with pytest.raises(TypeError, match="solver"):
            solver(start, 1.0, *more, **named)


def test_prepared_copies_and_threads_are_as_without_attitude() -> None:
    scene = replace(case_scene(5), attitude=TURNED)
    solver = prepare(scene, "taylor", 1e-9, attitude=True)
    wanted = np.concatenate(solver(scene.omega, 3.0)).tolist()
    other = pickle.loads(pickle.dumps(solver))
    assert (other.plan, other.status, other.steps) == (solver.plan, "complete", 0)
    assert np.concatenate(other(scene.omega, 3.0)).tolist() == wanted
    with ThreadPoolExecutor(1) as pool:
        pool.submit(solver, (1.0, float("inf"), 0.0), 3.0).result()
        assert pool.submit(lambda: solver.status).result() == "overflow"
    assert (solver.status, solver.steps) == ("complete", other.steps)


def test_rows_come_in_the_order_of_their_times() -> None:
    scene = replace(case_scene(5), attitude=TURNED)
    forth: Any = solve(scene, [-1.0, 0.0, 0.5, 1.0], "taylor", attitude=True)
    back: Any = solve(scene, [1.0, 0.5, 0.0, -1.0], "taylor", attitude=True)
    assert back.attitude[::-1].tolist() == forth.attitude.tolist()
    assert forth.attitude[1] == pytest.approx(np.array(TURNED), abs=1e-16)
    only: Any = solve(scene, [0.0], "taylor", attitude=True).attitude
    assert only[0] == pytest.approx(np.array(TURNED), abs=1e-16)


def test_growth_has_the_way_in_it() -> None:
    """An error of omega rotates the body further during the whole integration."""
    bare: Any = solve(case_scene(4), [50.0], "taylor", 1e-9)
    found = solve(case_scene(4), [50.0], "taylor", 1e-9, attitude=True)
    largest = float(np.abs(solve(case_scene(4), np.linspace(0.0, 5.0, 200).tolist()).omega).max())
    assert found.growth == pytest.approx(bare.growth * (1.0 + 0.5 * largest * 50.0), rel=0.05)


@pytest.mark.parametrize("factor", [2.0**-560, 2.0**-505, 2.0**505])
def test_prepared_series_and_batches_rescale_omega_and_torque(factor: float) -> None:
    """Products of such omegas underflow or overflow; the motion is the same in another time."""
    # The square of the smallest factor is 0.
    push = (0.1, 0.2, -0.1) if factor * factor > 0.0 else (0.0, 0.0, 0.0)

    def states(scale: float) -> list[Any]:
        law = TorqueLaw(constant=tuple(scale * scale * x for x in push))
        omega, q = np.array([0.3, 1.1, -0.7]) * scale, (0.8, 0.0, 0.6, 0.0)
        body = Scene("", omega, moments=(3.0, 2.0, 1.2), torque=law, attitude=q)
        end = 2.5 / scale
        alone, turned = prepare(body, "taylor", 1e-12, attitude=True)(tuple(omega), end, q)
        many: Any = pyharness.solve_many(body, end, attitude=[q], method="taylor", tolerance=1e-12)
        return [np.array(alone) / scale, turned, many.omega[0] / scale, many.attitude[0]]

    for found, wanted in zip(states(factor), states(1.0), strict=True):
        assert found == pytest.approx(wanted, abs=1e-13)
