"""Results in a batch: their bits depend on the body alone, their status is a single solver's."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Ensemble, Scene, TorqueLaw, case_scene, prepare, solve, solve_many
from pyharness.model.attitude import IDENTITY, angle_between
from pyharness.model.codes import Statuses
from pyharness.model.extension import extension
from tests.many_alone import BASE, METHODS, differing, differing_starts, mixed, same_bits

TOP = Scene("top", (0.3, -0.4, 1.2), moments=(3.0, 2.0, 1.0))
SINE = (((1.0, 0.5, -0.2), 3.0),)
ROUNDING = 2.0**-53


@pytest.mark.parametrize("method", METHODS)
def test_no_bit_depends_on_other_bodies(method: str, level: int) -> None:
    """`python -m tests.many_alone` tries more."""
    settings = {"method": method, "tolerance": 10.0 ** -min(9, METHODS[method]), "effort": 1e-4}
    for by_moments in (True, False):
        assert differing(mixed(80, 5, by_moments), 1, alone=10, **settings) == {}


@pytest.mark.parametrize("tolerance", [1e-14, 1e-6])
def test_no_bit_depends_on_other_bodies_with_attitudes_or_many_waves(tolerance: float) -> None:
    drawn = mixed(200, 8)
    drawn["attitude"] = np.random.default_rng(1).standard_normal((200, 4))
    assert differing(drawn, 2, alone=20, tolerance=tolerance, effort=1e-4) == {}
    drawn = mixed(200, 9, waves=9)  # some bodies have more than 16 waves, which lanes do not take
    assert differing(drawn, 3, alone=20, tolerance=tolerance, effort=1e-4) == {}


@pytest.mark.parametrize("attitude", [False, True])
def test_threads_change_no_bit(attitude: bool) -> None:
    drawn = mixed(601, 11)
    if attitude:
        drawn["attitude"] = np.random.default_rng(5).standard_normal((601, 4))
    whole = solve_many(BASE, tolerance=1e-6, effort=1e-4, **drawn)
    for threads in (2, 7):
        dealt = solve_many(BASE, tolerance=1e-6, effort=1e-4, threads=threads, **drawn)
        assert same_bits(whole, dealt).all()


@pytest.mark.parametrize("bad", ["moments", "omega", "attitude", "torque_constant", "t_end"])
@pytest.mark.parametrize("attitude", [False, True])
def test_a_bad_body_spoils_no_other(bad: str, attitude: bool, level: int) -> None:
    rng = np.random.default_rng(8)
    drawn: dict[str, Any] = {
        "moments": rng.uniform(2.0, 3.0, (40, 3)), "omega": rng.standard_normal((40, 3)),
        "torque_constant": rng.standard_normal((40, 3)), "t_end": np.full(40, 2.0),
    }  # fmt: skip
    if attitude or bad == "attitude":
        drawn["attitude"] = rng.standard_normal((40, 4))
    wrong = {
        "moments": (0.0, -2.0, np.nan), "omega": (np.nan, np.inf, 1e300), "t_end": (np.inf,),
        "attitude": (np.nan, 0.0), "torque_constant": (np.nan,),
    }  # fmt: skip
    for torque in (drawn["torque_constant"], np.zeros((40, 3))):
        drawn["torque_constant"] = torque
        good = solve_many(BASE, **drawn)
        assert good.has_result.all()
        spoilt = {**drawn, bad: drawn[bad].copy()}
        rows = [3 + 5 * n for n in range(len(wrong[bad]))]
        for row, value in zip(rows, wrong[bad], strict=True):
            # One wrong number is enough; a quaternion of zeros has four.
            spoilt[bad].reshape(40, -1)[row, slice(None) if value == 0.0 else -1] = value
        found = solve_many(BASE, effort=1e-3, **spoilt)
        assert np.flatnonzero(~same_bits(good, found)).tolist() == rows
        for array in (found.omega, found.attitude):
            assert array is None or np.isnan(array[rows]).all()
        if bad in ("moments", "torque_constant"):
            assert (found.status[rows] == Statuses.REFUSED).all()
        assert not found.has_result[rows].any()


def test_the_norm_of_an_attitude_may_be_any() -> None:
    turns = np.random.default_rng(8).standard_normal((40, 4))
    good: Any = solve_many(TOP, 2.0, tolerance=1e-9, attitude=turns)
    found: Any = solve_many(
        TOP, 2.0, tolerance=1e-9, attitude=turns * np.logspace(-200, 200, 40)[:, None]
    )
    assert found.has_result.all()
    assert angle_between(found.attitude, good.attitude).max() <= 1e-9


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
    free = solve_many(TOP, 1e4, omega=starts)
    torque[250] = [1.0, 0.0, 0.0]
    found = solve_many(TOP, 1e4, omega=starts, torque_constant=torque, effort=1e-3)
    others = np.arange(500) != 250
    assert same_bits(free, Ensemble(found.omega[others], found.status[others]), others).all()
    assert found.status[250] == Statuses.GAVE_UP


def test_waves_without_amplitude_are_none() -> None:
    starts = np.random.default_rng(2).standard_normal((40, 3))
    torque = np.tile([1.0, 0.5, 0.0], (40, 1))
    waves = np.zeros((40, 20, 4))
    waves[:, :, 3] = 1e9
    bare = solve_many(TOP, 2.0, omega=starts, torque_constant=torque)
    idle = solve_many(TOP, 2.0, omega=starts, torque_constant=torque, sines=waves, cosines=waves)
    assert same_bits(bare, idle).all()
    waves[3, 4, 3] = np.nan
    spoilt = solve_many(TOP, 2.0, omega=starts, torque_constant=torque, sines=waves)
    assert np.flatnonzero(~same_bits(bare, spoilt)).tolist() == [3]
    assert spoilt.status[3] == Statuses.REFUSED


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
        "moments": moments, "omega": omega + beside, "torque_constant": torque, "t_end": times,
    }  # fmt: skip


def rows_of(drawn: dict[str, Any]) -> Iterator[tuple[Scene, float]]:
    """Yield the scene and the time of each body."""
    for moments, omega, torque, time in zip(*drawn.values(), strict=True):
        yield Scene("", omega, moments=moments, torque=TorqueLaw(torque), attitude=IDENTITY), time


@pytest.mark.parametrize("tolerance", [1e-15, 1e-14, 1e-12, 1e-8, 1e-3])
@pytest.mark.parametrize("with_torque", [False, True])
def test_statuses_are_those_of_a_single_solver(with_torque: bool, tolerance: float) -> None:
    drawn = unstable(100, 3, with_torque)
    for attitude in (False, True):
        statuses = []
        for scene, time in rows_of(drawn):
            solver = prepare(scene, "auto", tolerance, effort=1e-2, attitude=attitude)
            solver(scene.omega, time)
            statuses.append(solver.status)
        if attitude:
            drawn["attitude"] = np.tile(IDENTITY, (100, 1))
        found = solve_many(BASE, tolerance=tolerance, effort=1e-2, **drawn)
        assert found.ended.tolist() == statuses
        assert "sensitive" in statuses or tolerance == 1e-3


def test_collocation_says_sensitive_where_a_single_solver_does() -> None:
    starts = np.array([[1e-9, 1.0, 0.0], [0.3, -0.4, 1.2]])
    for law in (TorqueLaw(), TorqueLaw((1e-3, 0.0, 0.0))):
        scene = replace(TOP, torque=law, step_size=0.05)
        found = solve_many(scene, 25.0, omega=starts, method="gauss-4", tolerance=1e-12)
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
    for row, (scene, time) in enumerate(rows_of(drawn)):
        solver = prepare(scene, "taylor", tolerance, effort=1e-2, attitude=False)
        alone = solver(scene.omega, time)
        # Lanes measure the growth from time 0 on, a single solver also from later times.
        if (solver.growth or 0.0) > 3.0 * min(1000.0, 0.1 * tolerance / ROUNDING):
            left += 1
            assert np.array_equal(found.omega[row], alone, equal_nan=True)
    assert left > 10


def test_estimates_of_lanes_are_trusted_less_where_errors_grow(level: int) -> None:
    """Test one of 200 000 random bodies, whose error by lanes alone would be near the tolerance."""
    body = {name: values[946:947] for name, values in unstable(5000, 108, with_torque=True).items()}
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
            found = solve_many(scene, t_end, tolerance=tolerance, omega=start)
            if growth > 0.0 and found.has_result[0]:
                assert (found.ended[0] == "sensitive") == (growth > max(limit, 2.0**44))
            # With a matrix the initial omega counts as rounded.
            rounded: Any = {"inertia": np.diag(moments), "omega": start}
            found = solve_many(scene, t_end, tolerance=tolerance, **rounded)
            if growth > 0.0 and found.has_result[0]:
                assert (found.ended[0] == "sensitive") == (growth > limit)


MATRIX = np.array([[40.0, 3.0, 1.0], [3.0, 30.0, -2.0], [1.0, -2.0, 20.0]])
LAWS = (TorqueLaw(), TorqueLaw((3.0, -2.0, 1.0), (0.1, 0.2, 0.3), (((1.0, 2.0, 0.5), 2.0),)))


@pytest.mark.parametrize("law", LAWS, ids=("free", "torque"))
def test_arrays_of_full_inertia_matrices_are_those_of_scenes(law: TorqueLaw) -> None:
    rng = np.random.default_rng(3)
    starts, attitudes = rng.standard_normal((6, 3)), rng.standard_normal((6, 4))
    matrices = [MATRIX + np.diag(rng.uniform(0.0, 9.0, 3)) for _ in range(6)]
    full = [
        Scene("", start, inertia=matrix.tolist(), attitude=attitude, torque=law)
        for start, matrix, attitude in zip(starts, matrices, attitudes, strict=True)
    ]
    plain = [replace(TOP, attitude=attitude, torque=law) for attitude in attitudes]
    scenes = [each for pair in zip(full, plain, strict=True) for each in pair]
    found = solve_many(scenes, 2.0)
    for row, scene in enumerate(scenes):
        assert same_bits(found, solve_many([scene], 2.0), [row]).all()
    arrays = solve_many(
        BASE, 2.0, omega=starts, inertia=np.array(matrices), attitude=attitudes,
        torque_constant=law.constant, torque_rate=law.rate,
        sines=[[*amplitude, frequency] for amplitude, frequency in law.sines] or None,
    )  # fmt: skip
    for array, wanted in ((arrays.omega, found.omega), (arrays.attitude, found.attitude)):
        assert array is not None
        assert wanted is not None
        assert np.allclose(array, wanted[::2], rtol=0, atol=1e-13)
    shared = solve_many(full[0], 2.0, omega=starts, out=solve_many(full[0], 2.0, omega=starts))
    for row, start in enumerate(starts):
        truth = solve(replace(full[0], omega=start), [2.0])
        assert np.allclose(shared.omega[row], truth.omega[-1], rtol=0, atol=1e-10)


def test_arrays_of_torques_in_space_are_those_of_scenes() -> None:
    rng = np.random.default_rng(3)
    starts, attitudes = rng.standard_normal((5, 3)), rng.standard_normal((5, 4))
    torques = rng.standard_normal((5, 3))
    scene = replace(TOP, torque=TorqueLaw((1.0, 0.5, 2.0), frame="space"))
    scenes = [
        replace(scene, omega=start, attitude=turn, torque=TorqueLaw(torque, frame="space"))
        for start, turn, torque in zip(starts, attitudes, torques, strict=True)
    ]
    # Scenes and arrays normalise quaternions with other roundings.
    attitudes = np.array([each.attitude for each in scenes])
    found = solve_many(scene, 1.5, omega=starts, attitude=attitudes, torque_constant=torques)
    # The torque of the last scene of the list turns with the body.
    body = replace(TOP, torque=TorqueLaw((1.0, 0.5, 2.0)), attitude=IDENTITY)
    listed = solve_many([*scenes, body], 1.5, threads=2)
    for row, each in enumerate([*scenes, body]):
        assert same_bits(listed, solve_many([each], 1.5), [row]).all()
    assert np.array_equal(found.omega, listed.omega[:5])
    starts[1] = np.nan
    spoilt = solve_many(scene, 1.5, omega=starts, attitude=attitudes, torque_constant=torques)
    assert np.flatnonzero(~spoilt.has_result).tolist() == [1]


def test_a_prepared_solver_of_many_starts_has_its_work_limit() -> None:
    scene = case_scene(5)
    starts = np.tile(scene.omega, (2, 1))
    ample, short = (prepare(scene, "taylor", 1e-12, effort=effort).many for effort in (1.0, 1e-5))
    assert (ample(starts, 150.0)[1] == Statuses.SENSITIVE).all()
    assert (short(starts, 150.0)[1] == Statuses.GAVE_UP).all()
