"""Results in a batch: their bits depend on the body alone, their status is a single solver's."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Ensemble, Scene, TorqueLaw, case_scene, prepare, solve, solve_many
from pyharness.model.codes import Statuses
from pyharness.model.extension import extension
from pyharness.model.trajectory import Array
from tests.many_alone import BASE, METHODS, differing, differing_starts, mixed, same_bits

TOP = Scene("top", (0.3, -0.4, 1.2), moments=(3.0, 2.0, 1.0))
SINE = (((1.0, 0.5, -0.2), 3.0),)
ROUNDING = 2.0**-53


@pytest.mark.parametrize("method", METHODS)
def test_no_bit_depends_on_other_bodies(method: str, level: int) -> None:
    """`python -m tests.many_alone` tries more."""
    settings = {"method": method, "tolerance": 10.0 ** -min(9, METHODS[method]), "effort": 1e-4}
    for by_moments in (True, False):
        drawn = mixed(80, 5, by_moments)
        assert differing(drawn, 1, alone=10, **settings) == {}


@pytest.mark.parametrize("tolerance", [1e-14, 1e-6])
def test_no_bit_depends_on_other_bodies_with_attitudes_or_many_waves(tolerance: float) -> None:
    drawn = mixed(200, 8)
    drawn["attitude0"] = np.random.default_rng(1).standard_normal((200, 4))
    assert differing(drawn, 2, alone=20, tolerance=tolerance, effort=1e-4) == {}
    drawn = mixed(200, 9, waves=9)  # some bodies have more than 16 waves, which lanes do not take
    assert differing(drawn, 3, alone=20, tolerance=tolerance, effort=1e-4) == {}


@pytest.mark.parametrize(
    "law", [TorqueLaw(), TorqueLaw((1.0, 0.5, -0.2)), TorqueLaw(sines=SINE)], ids=str
)
@pytest.mark.parametrize("tolerance", [1e-12, 1e-3])
def test_no_bit_of_a_prepared_solver_depends_on_other_starts(
    law: TorqueLaw, tolerance: float
) -> None:
    rng = np.random.default_rng(4)
    starts, times = rng.standard_normal((300, 3)), rng.uniform(-9.0, 9.0, 300)
    starts[::7] = [0.0, 1.0, 0.0]
    starts[3] = np.nan
    for scene in (TOP, replace(TOP, moments=(2.0, 2.0, 1.0)), replace(TOP, moments=(2.0,) * 3)):
        settings = {"tolerance": tolerance}
        assert differing_starts(replace(scene, torque=law), starts, times, 6, **settings) == 0


def test_a_torque_elsewhere_takes_no_body_off_the_closed_form() -> None:
    starts = np.random.default_rng(2).standard_normal((500, 3))
    torque = np.zeros((500, 3))
    free = solve_many(TOP, 1e4, omega0=starts)
    torque[250] = [1.0, 0.0, 0.0]
    found = solve_many(TOP, 1e4, omega0=starts, torque_constant=torque, effort=1e-3)
    others = np.arange(500) != 250
    assert same_bits(free, Ensemble(found.omega[others], found.status[others]), others).all()
    assert found.status[250] == Statuses.GAVE_UP


def test_waves_without_amplitude_are_none() -> None:
    starts = np.random.default_rng(2).standard_normal((40, 3))
    torque = np.tile([1.0, 0.5, 0.0], (40, 1))
    waves = np.zeros((40, 20, 4))
    waves[:, :, 3] = 1e9
    bare = solve_many(TOP, 2.0, omega0=starts, torque_constant=torque)
    idle = solve_many(TOP, 2.0, omega0=starts, torque_constant=torque, sines=waves, cosines=waves)
    assert same_bits(bare, idle).all()
    waves[3, 4, 3] = np.nan
    spoilt = solve_many(TOP, 2.0, omega0=starts, torque_constant=torque, sines=waves)
    assert np.flatnonzero(~same_bits(bare, spoilt)).tolist() == [3]
    assert spoilt.status[3] == Statuses.REFUSED


def test_a_torque_that_is_no_number_refuses_its_body() -> None:
    torque = np.zeros((4, 3))
    torque[2, 1] = np.nan
    found = solve_many(TOP, 1.0, omega0=np.ones((4, 3)), torque_constant=torque)
    assert found.ended.tolist() == ["complete", "complete", "refused", "complete"]
    assert np.isnan(found.omega[2]).all()


def unstable(n: int, seed: int, with_torque: bool) -> dict[str, Any]:
    """Draw bodies near steady rotations: about the middle axis, or about any axis with a torque."""
    rng = np.random.default_rng([seed, with_torque])
    moments = 10.0 ** rng.uniform(-0.5, 0.5, (n, 3))
    omega = rng.standard_normal((n, 3))
    if not with_torque:
        omega = np.eye(3)[np.argsort(moments, axis=1)[:, 1]] * rng.choice([-1.0, 1.0], (n, 1))
    omega /= np.abs(omega).max(axis=1, keepdims=True)
    torque = np.cross(omega, moments * omega) if with_torque else np.zeros((n, 3))
    beside = 10.0 ** rng.uniform(-14.0, -1.0, (n, 1)) * rng.standard_normal((n, 3))
    times = 10.0 ** rng.uniform(-0.3, 2.0, n) * rng.choice([-1.0, 1.0], n)
    return {
        "moments": moments, "omega0": omega + beside, "torque_constant": torque, "t_end": times,
    }  # fmt: skip


@pytest.mark.parametrize("tolerance", [1e-15, 1e-14, 1e-12, 1e-8, 1e-3])
@pytest.mark.parametrize("with_torque", [False, True])
def test_statuses_are_those_of_a_single_solver(with_torque: bool, tolerance: float) -> None:
    drawn = unstable(150, 3, with_torque)
    found = solve_many(BASE, tolerance=tolerance, effort=1e-2, **drawn)
    statuses = []
    for row in range(150):
        law = TorqueLaw(drawn["torque_constant"][row])
        scene = Scene("", drawn["omega0"][row], moments=drawn["moments"][row], torque=law)
        solver = prepare(scene, "taylor" if with_torque else "auto", tolerance, effort=1e-2)
        solver(drawn["omega0"][row], drawn["t_end"][row])
        statuses.append(solver.status)
    assert found.ended.tolist() == statuses
    assert "sensitive" in statuses or tolerance == 1e-3
    attitudes = np.tile([1.0, 0.0, 0.0, 0.0], (150, 1))
    if not with_torque:
        turned = solve_many(BASE, tolerance=tolerance, attitude0=attitudes, **drawn)
        assert turned.ended.tolist() == statuses


def test_collocation_says_sensitive_where_a_single_solver_does() -> None:
    starts = np.array([[1e-9, 1.0, 0.0], [0.3, -0.4, 1.2]])
    for law in (TorqueLaw(), TorqueLaw((1e-3, 0.0, 0.0))):
        scene = replace(TOP, torque=law, step_size=0.05)
        found = solve_many(scene, 25.0, omega0=starts, method="gauss-4", tolerance=1e-12)
        solver = prepare(scene, "gauss-4", 1e-12)
        for row, start in enumerate(starts):
            solver(start, 25.0)
            assert found.ended[row] == solver.status
        if law.is_zero:
            assert found.ended[0] == "sensitive"


@pytest.mark.parametrize("tolerance", [1e-14, 1e-12, 1e-6])
def test_what_amplifies_errors_is_left_to_the_single_kernel(tolerance: float, level: int) -> None:
    """Above the limits of the lanes, a result has the bits of the single kernel."""
    drawn = unstable(300, 5, with_torque=True)
    found = solve_many(BASE, method="taylor", tolerance=tolerance, effort=1e-2, **drawn)
    left = 0
    for row in range(300):
        law = TorqueLaw(drawn["torque_constant"][row])
        scene = Scene("", drawn["omega0"][row], moments=drawn["moments"][row], torque=law)
        solver = prepare(scene, "taylor", tolerance, effort=1e-2)
        alone = solver(drawn["omega0"][row], drawn["t_end"][row])
        # Lanes measure the growth from time 0 on, a single solver also from later times.
        if (solver.growth or 0.0) > 3.0 * min(1000.0, 0.1 * tolerance / ROUNDING):
            left += 1
            assert np.array_equal(found.omega[row], alone, equal_nan=True)
    assert left > 10


def test_estimates_of_lanes_are_trusted_less_where_errors_grow(level: int) -> None:
    """Test one of 200 000 random bodies, whose error by lanes alone would be near the tolerance."""
    drawn = unstable(5000, 108, with_torque=True)
    body = {name: values[946:947] for name, values in drawn.items()}
    truth = solve_many(BASE, method="taylor", tolerance=1e-13, **body).omega
    found = solve_many(BASE, method="taylor", tolerance=1e-3, **body)
    assert found.ended[0] == "complete"
    assert np.abs(found.omega - truth).max() < 1e-4 * np.abs(truth).max()


def test_the_bound_of_the_growth_is_above_the_growth() -> None:
    """A body below the bound is not measured: `solve_many` reports sensitive by the same limit."""
    rng = np.random.default_rng(7)
    for _ in range(400):
        moments = 10.0 ** rng.uniform(-1.0, 1.0, 3)
        start = rng.standard_normal(3) * 10.0 ** rng.uniform(-3.0, 0.0, 3)
        scene = Scene("", start, moments=moments)
        t_end = 10.0 ** rng.uniform(-1.0, 4.0) / np.abs(start).max()
        growth = extension().torque_free_growth(scene.euler_coefficients, start, t_end)
        for tolerance in (1e-14, 1e-12, 1e-10):
            limit = 0.3 * tolerance / ROUNDING
            found = solve_many(scene, t_end, tolerance=tolerance, omega0=start)
            if growth > 0.0 and found.has_result[0]:
                assert (found.ended[0] == "sensitive") == (growth > limit)


MATRIX = np.array([[40.0, 3.0, 1.0], [3.0, 30.0, -2.0], [1.0, -2.0, 20.0]])
LAWS = (TorqueLaw(), TorqueLaw((3.0, -2.0, 1.0), (0.1, 0.2, 0.3), (((1.0, 2.0, 0.5), 2.0),)))


@pytest.mark.parametrize("law", LAWS, ids=("free", "torque"))
def test_solve_many_takes_full_inertia_matrices(law: TorqueLaw) -> None:
    rng = np.random.default_rng(3)
    starts, attitudes = rng.standard_normal((6, 3)), rng.standard_normal((6, 4))
    matrices = [MATRIX + np.diag(rng.uniform(0.0, 9.0, 3)) for _ in range(6)]
    full = [
        Scene("", start, inertia=matrix.tolist(), attitude=attitude, torque=law)
        for start, matrix, attitude in zip(starts, matrices, attitudes, strict=True)
    ]
    plain = [replace(TOP, attitude=attitude, torque=law) for attitude in attitudes]
    mixed_scenes = [each for pair in zip(full, plain, strict=True) for each in pair]
    found = solve_many(mixed_scenes, 2.0)
    assert found.attitude is not None
    for row, scene in enumerate(mixed_scenes):
        truth = solve(scene, [2.0], attitude=True)
        assert truth.attitude is not None
        assert np.allclose(found.omega[row], truth.omega[-1], rtol=0, atol=1e-10)
        assert np.allclose(found.attitude[row], truth.attitude[-1], rtol=0, atol=1e-10)
        alone = solve_many([scene], 2.0)
        assert same_bits(found, alone, [row]).all()
    waves = [[*amplitude, frequency] for amplitude, frequency in law.sines]
    arrays = solve_many(
        BASE, 2.0, omega0=starts, inertia=np.array(matrices), attitude0=attitudes,
        torque_constant=law.constant, torque_rate=law.rate, sines=waves or None,
    )  # fmt: skip
    assert arrays.attitude is not None
    assert np.allclose(arrays.omega, found.omega[::2], rtol=0, atol=1e-13)
    assert np.allclose(arrays.attitude, found.attitude[::2], rtol=0, atol=1e-13)
    shared = solve_many(full[0], 2.0, omega0=starts, out=solve_many(full[0], 2.0, omega0=starts))
    for row, start in enumerate(starts):
        truth = solve(replace(full[0], omega=start), [2.0])
        assert np.allclose(shared.omega[row], truth.omega[-1], rtol=0, atol=1e-10)


def test_solve_many_takes_torques_in_space_with_attitudes() -> None:
    rng = np.random.default_rng(3)
    starts, attitudes = rng.standard_normal((5, 3)), rng.standard_normal((5, 4))
    torques = rng.standard_normal((5, 3))
    scene = replace(TOP, torque=TorqueLaw((1.0, 0.5, 2.0), frame="space"))
    found = solve_many(scene, 1.5, omega0=starts, attitude0=attitudes, torque_constant=torques)
    scenes = [
        replace(scene, omega=starts[row], attitude=attitudes[row], torque=law)
        for row, law in enumerate(TorqueLaw(torque, frame="space") for torque in torques)
    ]
    scenes[2] = replace(scenes[2], torque=TorqueLaw(torques[2]))
    listed = solve_many(scenes, 1.5, threads=2)
    assert found.attitude is not None
    assert listed.attitude is not None
    for row, each in enumerate(scenes):
        truth = solve(each, [1.5], attitude=True)
        assert truth.attitude is not None
        assert np.allclose(listed.omega[row], truth.omega[-1], rtol=0, atol=1e-11)
        assert np.allclose(listed.attitude[row], truth.attitude[-1], rtol=0, atol=1e-11)
        assert same_bits(listed, solve_many([each], 1.5), [row]).all()
        if row != 2:  # the torque of row 2 turns with the body
            assert np.array_equal(found.omega[row], listed.omega[row])
    starts[1] = np.nan
    spoilt = solve_many(scene, 1.5, omega0=starts, attitude0=attitudes, torque_constant=torques)
    assert np.flatnonzero(~spoilt.has_result).tolist() == [1]


@pytest.mark.campaign
def test_a_prepared_solver_of_many_starts_has_its_work_limit() -> None:
    scene = case_scene(5)
    starts = np.tile(scene.omega, (2, 1))
    ample, short = (prepare(scene, "taylor", effort=effort).many for effort in (1.0, 1e-3))
    assert (ample(starts, 3e3)[1] == Statuses.SENSITIVE).all()
    assert (short(starts, 3e3)[1] == Statuses.GAVE_UP).all()


@pytest.mark.parametrize("attitude0", [None, np.array([[1.0, 0.0, 0.0, 0.0]])])
def test_a_refused_body_has_no_numbers(attitude0: Array | None) -> None:
    moments = np.tile([3.0, 2.0, 1.0], (3, 1))
    moments[1, 2] = -1.0
    found = solve_many(TOP, 1.0, moments=moments, attitude0=attitude0)
    assert found.status.tolist() == [Statuses.COMPLETE, Statuses.REFUSED, Statuses.COMPLETE]
    for rows in (found.omega, found.attitude):
        if rows is not None:
            assert np.isnan(rows).all(axis=1).tolist() == [False, True, False]
