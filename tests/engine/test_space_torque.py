"""Torque about the axes of space: other integrators, and its effect on the angular momentum."""

import itertools
import pickle
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pyharness import InputError, Scene, TorqueLaw, case_scene, prepare, solve
from pyharness.checks.scenes.random_scenes import draw
from pyharness.engine.plan.plan import plan
from pyharness.model.attitude import IDENTITY, angle_between
from pyharness.model.trajectory import Array, turned_to_space

TURNED = (0.5, -0.1, 0.7, 0.5)
BODY = (40.0, 30.0, 20.0)
WAVES = TorqueLaw(
    (1.0, -2.0, 3.0), (0.5, 1.0, -2.0), [((5.0, 2.0, 0.0), 3.0), ((0.0, 4.0, 8.0), -11.0)],
    [((-3.0, 6.0, 2.0), 1.7)], frame="space",
)  # fmt: skip
SCENES = {
    "constant": Scene("", (0, 1, 1), BODY, torque=TorqueLaw((3, 0, 10), frame="space")),
    "ramp": Scene("", (0, 0, 0), BODY, torque=TorqueLaw(rate=(3, -9, 10), frame="space")),
    "waves": Scene("", (0.3, -1, 2), BODY, torque=WAVES, attitude=TURNED),
    "top": Scene("", (0.3, -1, 2), (30, 30, 20), torque=WAVES, attitude=TURNED),
    "sphere": Scene("", (0.3, -1, 2), (30, 30, 30), torque=WAVES, attitude=TURNED),
    "full": Scene(
        "", (0.3, -1, 2), torque=WAVES, inertia=((40, 3, 0), (3, 30, 1), (0, 1, 20)),
        attitude=TURNED,
    ),
}  # fmt: skip
PUSHED = SCENES["constant"]


def matrix(scene: Scene) -> Array:
    return np.array(scene.inertia) if scene.inertia is not None else np.diag(scene.moments or ())


def by_scipy(scene: Scene, times: Sequence[float]) -> tuple[Array, Array]:
    """Return omega and attitude by DOP853 for seven unknowns, with SciPy's own rotations."""
    inertia = matrix(scene)

    def rates(t: float, y: Array) -> Array:
        omega, q = y[:3], y[3:]
        push = Rotation.from_quat(q, scalar_first=True).inv().apply(scene.law.at(t))
        turned = np.linalg.solve(inertia, push - np.cross(omega, inertia @ omega))
        rest = q[0] * omega + np.cross(q[1:], omega)
        return np.concatenate([turned, [-0.5 * q[1:] @ omega], 0.5 * rest])

    start = [*scene.omega, *(scene.attitude or IDENTITY)]
    found = solve_ivp(rates, (0.0, times[-1]), start, "DOP853", times, rtol=3e-14, atol=1e-14).y.T
    return found[:, :3], found[:, 3:]


def momentum(scene: Scene, times: Array) -> Array:
    """Return the angular momentum in space at `times` (s), which the torque alone changes."""
    start = matrix(scene) @ np.array(scene.omega)
    law, t = scene.law, times[:, None]
    attitude = np.array([scene.attitude or IDENTITY])
    found = turned_to_space(attitude, start[None]) + t * law.constant + t * t / 2.0 * law.rate
    for amplitude, frequency in law.sines:
        found = found + 2.0 * np.sin(frequency * t / 2.0) ** 2 / frequency * amplitude
    for amplitude, frequency in law.cosines:
        found = found + np.sin(frequency * t) / frequency * amplitude
    return np.asarray(found)


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("name", "time"), [("waves", -2.0), *zip(SCENES, itertools.cycle((2.0, -2.0)), strict=False)]
)
def test_series_agrees_with_seven_unknowns(name: str, time: float) -> None:
    times = [0.1 * time, 0.5 * time, time]
    found: Any = solve(SCENES[name], times, "taylor", 1e-12, attitude=True)
    omega, attitude = by_scipy(SCENES[name], times)
    assert np.abs(found.omega - omega).max() < 2e-12 * np.abs(omega).max()
    # The signs are compared too, because they are continuous.
    assert np.abs(found.attitude - attitude).max() < 2e-12
    assert np.abs(np.linalg.norm(found.attitude, axis=1) - 1.0).max() < 4e-16


@pytest.mark.parametrize("name", SCENES)
def test_momentum_in_space_is_what_torque_made_of_it(name: str) -> None:
    times = np.linspace(-8.0, 8.0, 33)
    found = solve(SCENES[name], times.tolist(), tolerance=1e-13, attitude=True)
    true = momentum(SCENES[name], times)
    assert np.abs(found.angular_momentum("space") - true).max() < 1e-13 * np.abs(true).max()


def test_momentum_on_random_scenes() -> None:
    ways = []
    for number in range(0, 200, 2):
        drawn = draw("space torque", number)
        scene = drawn.scene
        if scene.moments is None or scene.torque.is_zero:
            continue
        scene = replace(scene, torque=replace(scene.law, frame="space"), attitude=TURNED)
        found = solve(scene, [drawn.time], tolerance=1e-13, attitude=True)
        true = momentum(scene, np.array([drawn.time]))
        # The angle of a wave may be rounded.
        error = np.abs(found.angular_momentum("space") - true).max()
        ways.append(error / max(np.abs(true).max(), np.abs(momentum(scene, np.zeros(1))).max()))
    assert len(ways) > 50
    assert max(ways) < 1e-12


def test_energy_is_the_work_of_the_torque() -> None:
    scene = SCENES["waves"]
    nodes, weights = np.polynomial.legendre.leggauss(40)
    times = 1.0 + nodes
    found: Any = solve(scene, [0.0, *times, 2.0], tolerance=1e-13, attitude=True)
    omega = turned_to_space(found.attitude, found.omega)[1:-1]
    torque = np.array([scene.law.at(t) for t in times])
    energy = found.energy()
    assert energy[-1] - energy[0] == pytest.approx(weights @ (torque * omega).sum(1), rel=1e-12)


@pytest.mark.campaign
def test_tolerance_and_estimate_hold_on_random_scenes() -> None:
    ratios = []
    for number in range(300):
        drawn = draw("attitude", number)
        if drawn.scene.moments is None or drawn.scene.torque.is_zero:
            continue
        scene = replace(drawn.scene, torque=replace(drawn.scene.law, frame="space"))
        times = [0.4 * drawn.time, drawn.time]
        try:
            true: Any = solve(scene, times, "taylor", 1e-15, attitude=True)
        except InputError:
            assert scene.name == "extreme"
            continue
        if not true.has_all_rows:
            assert scene.name == "extreme"
            continue
        largest = max(np.abs(true.omega).max(), *map(abs, scene.omega))
        for tolerance in (1e-3, 1e-6, 1e-9, 1e-12):
            found: Any = solve(scene, times, "auto", tolerance, attitude=True)
            apart = angle_between(found.attitude, true.attitude).max()
            error = max(np.abs(found.omega - true.omega).max() / largest, apart)
            # Two integrations at the finest tolerance still differ by amplified rounding.
            assert error <= tolerance + 10.0 * (true.error or 0.0), (number, tolerance)
            ratios.append(error / ((found.error or 0.0) + (true.error or 0.0)))
    assert len(ratios) > 4 * 180
    # Two integrations may have the same error, here far below the tolerance.
    assert max(ratios) < 10.0
    assert np.quantile(ratios, 0.99) < 1.0
    assert np.median(ratios) < 0.2


def test_tolerance_is_no_finer_than_asked_for() -> None:
    for tolerance in (1e-3, 1e-6, 1e-9, 1e-12):
        found = solve(SCENES["waves"], [10.0], "taylor", tolerance, attitude=True)
        assert found.steps < 120
        # Two integrations suffice, or three.
        assert found.evaluations < 3.5 * found.steps


def test_rows_are_those_of_a_solution_each() -> None:
    scene = SCENES["waves"]
    times = np.linspace(-2.0, 2.0, 401)
    found: Any = solve(scene, times.tolist(), tolerance=1e-13, attitude=True)
    for row in (0, 37, 200, 211, 400):
        one: Any = solve(scene, [times[row]], tolerance=1e-13, attitude=True)
        assert found.omega[row] == pytest.approx(one.omega[0], abs=1e-12)
        assert found.attitude[row] == pytest.approx(one.attitude[0], abs=1e-12)
    assert (np.einsum("ni,ni->n", found.attitude[1:], found.attitude[:-1]) > 0.99).all()
    coarse: Any = solve(scene, times.tolist(), tolerance=1e-3, attitude=True)
    assert np.abs(np.linalg.norm(coarse.attitude, axis=1) - 1.0).max() < 4e-16
    backward = solve(scene, times[::-1].tolist(), tolerance=1e-13, attitude=True)
    assert (backward.omega[::-1] == found.omega).all()


def test_no_torque_in_space_is_none() -> None:
    free = case_scene(4)
    assert free.torque.is_zero
    for law in (TorqueLaw(frame="space"), TorqueLaw(sines=[((0, 0, 0), 5.0)], frame="space")):
        same = replace(free, torque=law)
        assert not law.in_space
        assert (solve(same, [1.0]).omega == solve(free, [1.0]).omega).all()
        assert plan(same).method == "closed-form"
        assert prepare(same)(free.omega, 1.0) == pytest.approx(prepare(free)(free.omega, 1.0))


@pytest.mark.parametrize("factor", [2.0**-500, 2.0**-400, 2.0**400, 2.0**500])
def test_motion_far_from_one_is_the_same(factor: float) -> None:
    push = factor * factor * np.array(PUSHED.law.constant)
    omega = factor * np.array(PUSHED.omega)
    scene = Scene("", omega, BODY, torque=TorqueLaw(push, frame="space"))
    wanted, found = solve(PUSHED, [2.0], attitude=True), solve(scene, [2.0 / factor], attitude=True)
    assert (found.omega / factor == wanted.omega).all()
    assert found.attitude == pytest.approx(wanted.attitude, abs=1e-15)


def test_prepared_solver_refuses_motion_far_from_one() -> None:
    solver = prepare(PUSHED, attitude=True)
    omega, attitude = solver((0.0, 2.0**505, 2.0**505), 2.0**-505)
    assert solver.status == "refused"
    assert np.isnan([*omega, *attitude]).all()


def test_what_rounding_has_become_is_told() -> None:
    found: Any = solve(PUSHED, [300.0], tolerance=1e-12, attitude=True)
    assert found.ended == "sensitive"
    assert found.error > 1e-12
    # Perturbed by 1e-7 of omega, the motion ends 2.4e5 times as far away.
    assert 4e5 < found.growth < 8e5
    fine: Any = solve(PUSHED, [2.0], attitude=True)
    assert fine.ended == "complete"
    assert 1.0 <= fine.growth < 100.0


def test_rounding_counts_as_much_as_later_motion_amplifies_it() -> None:
    # Most rounding errors are made at the end, when the body is fast; the first are amplified most.
    scene = replace(PUSHED, omega=(0.3, -1.0, 2.0))
    found: Any = solve(scene, [200.0], tolerance=1e-9, attitude=True)
    true: Any = solve(scene, [200.0], tolerance=1e-13, attitude=True)
    assert found.growth > 1e4
    assert found.ended == "complete"
    error = np.abs(found.omega - true.omega).max() / np.abs(true.omega).max()
    assert error <= 3.0 * found.error <= 1e-9
    assert true.growth / 2.5 < found.growth < 2.5 * true.growth


# The number of steps per second is constant: the first integration shows the work of the second.
CALM = replace(
    PUSHED, omega=(0.0, 1.0, 10.0), torque=replace(PUSHED.law, constant=(0.0, 0.0, 1e-9))
)


@pytest.mark.parametrize(("scene", "time", "effort"), [(PUSHED, 300.0, 1e-3), (CALM, 1000.0, 1e-4)])
def test_giving_up_says_what_would_do(scene: Scene, time: float, effort: float) -> None:
    with pytest.raises(InputError, match="t = 300 s"):
        solve(PUSHED, [1.0, 300.0], attitude=True, effort=1e-4)
    with pytest.raises(InputError, match=r"--effort") as refused:
        solve(scene, [time], attitude=True, effort=effort)
    advised = float(str(refused.value).split("--effort ")[1].split(" ")[0])
    # With time grow the speed of the first scene, and its number of steps per second.
    assert 0.003 < advised < 0.1 or scene is CALM
    assert solve(scene, [time], attitude=True, effort=advised).has_all_rows


def test_prepared_solver_agrees_with_solve() -> None:
    scene = SCENES["waves"]
    solver = prepare(scene, attitude=True)
    for each in (solver, pickle.loads(pickle.dumps(solver))):
        omega, attitude = each((0.1, 0.2, 3.0), -2.0, (1.0, 0.0, 1.0, 0.0))
        start = replace(scene, omega=(0.1, 0.2, 3.0), attitude=(1.0, 0.0, 1.0, 0.0))
        found: Any = solve(start, [-2.0], attitude=True)
        assert (omega == found.omega[0]).all()
        assert (attitude == found.attitude[0]).all()
        assert (each.status, each.error, each.growth) == ("complete", found.error, found.growth)
        assert each.steps == found.steps
    omega, attitude = solver((0.1, 0.2, 3.0), 1e9)
    assert solver.status == "gave up"
    assert np.isnan([*omega, *attitude]).all()


def test_plan_says_that_the_attitude_is_needed_and_why() -> None:
    chosen = plan(PUSHED, tolerance=1e-3)
    assert (chosen.method, chosen.closed_form, chosen.fallback) == ("taylor", None, None)
    told = {each.part: (each.kept, each.why) for each in chosen.decisions}
    assert told["attitude"] == (True, "the torque is fixed in space")
    assert told["integration"] == (True, "its torque is fixed in space")
    assert plan(SCENES["sphere"]).method == "taylor"


@pytest.mark.parametrize("time", [40.0, 120.0])
def test_the_scale_is_the_largest_omega_on_the_way(time: float) -> None:
    """Relative to an initial omega of almost nothing, a coarse tolerance takes more steps."""
    law = TorqueLaw((0.3, -0.2, 0.1), frame="space")
    scene = Scene("", (1e-9, 0.0, 0.0), moments=(3.0, 2.0, 4.0), torque=law)
    coarse, fine = (solve(scene, [time], attitude=True, tolerance=e) for e in (1e-3, 1e-9))
    assert coarse.steps <= fine.steps
