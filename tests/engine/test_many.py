"""Many bodies in one call: as accurate as single calls, with any other bodies and threads."""

import tracemalloc
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, prepare, run_many, solve, solve_many, torques
from pyharness.engine.plan.registry import FIXED_STEP, PREPARED
from pyharness.engine.prepared import many_scenes
from pyharness.engine.prepared.solver import CODES
from pyharness.engine.system.kernel_input import normalized
from pyharness.model.codes import Methods, Statuses
from pyharness.model.ensemble import Ensemble
from pyharness.model.extension import extension
from pyharness.model.listing import Listing
from pyharness.model.trajectory import Array
from tests.as_written import compiler_here, many_as_written
from tests.engine.tolerance_scenes import EDGES
from tests.many_errors import KINDS, bodies, exceeding, scene_of

LISTING = Listing.corrected("two-term")
TOP = Scene("top", (0.3, -0.4, 1.2), moments=(40.0, 30.0, 20.0))


def same(one: Ensemble, two: Ensemble) -> bool:
    """Return whether two ensembles have the same bits."""
    return one.omega.tobytes() == two.omega.tobytes() and np.array_equal(one.status, two.status)


@cache
def truths(kind: str, n: int, seed: int) -> Array:
    """Return omega of the bodies at the end; NaN where the error amplification is large."""
    drawn = bodies(kind, n, seed)
    ends = np.full((n, 3), np.nan)
    for row in range(n):
        truth = solve(scene_of(drawn, row), [drawn["t_end"][row]], "taylor", 1e-15)
        if truth.has_all_rows and (truth.growth or np.inf) < 1e3:
            ends[row] = truth.omega[-1]
    return ends


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("kind", KINDS)
def test_the_tolerance_holds(kind: str, tolerance: float, level: int) -> None:
    drawn = bodies(kind, 60, 1982)
    found = solve_many(TOP, tolerance=tolerance, **drawn)
    truth = truths(kind, 60, 1982)
    scale = np.maximum(np.abs(truth).max(axis=1), np.abs(drawn["omega"]).max(axis=1))
    off = np.abs(found.omega - truth).max(axis=1) / scale
    assert np.count_nonzero(np.isfinite(off)) > 50
    assert np.nanmax(off) <= tolerance + 4e-12
    assert found.has_result.all()
    # The results come from lanes: one by one they would have the single solver's bits.
    alone = [prepare(scene_of(drawn, row), tolerance=tolerance) for row in range(20)]
    same = [
        np.array_equal(solver(drawn["omega"][row], drawn["t_end"][row]), found.omega[row])
        for row, solver in enumerate(alone)
    ]
    assert np.count_nonzero(same) < 10


@pytest.mark.sampled
@pytest.mark.parametrize("tolerance", [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-6, 1e-8, 1e-10])
def test_the_tolerance_holds_where_the_motion_magnifies_errors(tolerance: float) -> None:
    """Bodies leave their middle axis under a faint torque: local errors grow by e2 to e16."""
    n = 8000
    rng = np.random.default_rng(1)
    moments = np.sort(10.0 ** rng.uniform(-0.5, 0.5, (n, 3)), axis=1)
    moments[:, 2] = np.minimum(moments[:, 2], 0.95 * (moments[:, 0] + moments[:, 1]))
    least, middle, largest = np.sort(moments, axis=1).T
    omega0 = 10.0 ** rng.uniform(-9, -2, (n, 1)) * rng.standard_normal((n, 3)) + [0.0, 1.0, 0.0]
    rate = np.sqrt((middle - least) * (largest - middle) / (least * largest))
    drawn = {
        "moments": np.column_stack([least, middle, largest]),
        "omega": omega0,
        "t_end": np.minimum(rng.uniform(2.0, 16.0, n) / np.maximum(rate, 0.05), 60.0),
        "torque_constant": 1e-6 * moments * rng.standard_normal((n, 3)),
    }
    found = solve_many(TOP, tolerance=tolerance, **drawn)
    truth = solve_many(TOP, tolerance=1e-13, **drawn)
    complete = (found.status == Statuses.COMPLETE) & truth.has_result
    assert np.count_nonzero(complete) > n / 2
    error = np.abs(found.omega - truth.omega).max(axis=1) / np.abs(truth.omega).max(axis=1)
    assert error[complete].max() <= tolerance


@pytest.mark.parametrize("method", FIXED_STEP)
@pytest.mark.parametrize("torque", [(0.0, 0.0, 0.0), (3.0, -2.0, 1.0)])
def test_fixed_steps_are_those_of_the_single_method(
    method: str, torque: tuple[float, float, float], level: int
) -> None:
    rng = np.random.default_rng(5)
    starts, moments = rng.standard_normal((90, 3)), rng.uniform(1.0, 3.0, (90, 3))
    scene = replace(TOP, torque=TorqueLaw(torque), step_size=0.07)
    for t_end in (2.1, -1.0, 0.01):
        found = solve_many(scene, t_end, omega=starts, moments=moments, method=method)
        assert found.has_result.all()
        for start, body, omega in zip(starts, moments, found.omega, strict=True):
            alone = prepare(replace(scene, moments=body), method)(start, t_end)
            assert np.abs(omega - alone).max() <= 2e-14 * np.abs(alone).max()


@pytest.mark.parametrize("method", PREPARED)
def test_many_bodies_are_those_of_the_prepared_solver(method: str) -> None:
    rng = np.random.default_rng(11)
    starts, moments = rng.standard_normal((20, 3)), rng.uniform(1.0, 3.0, (20, 3))
    law = TorqueLaw() if method == "closed-form" else TorqueLaw((0.3, -0.2, 0.1))
    scene = replace(TOP, torque=law, step_size=0.05)
    tolerance = None if method in FIXED_STEP else 1e-7
    found = solve_many(
        scene, 2.0, omega=starts, moments=moments, method=method, tolerance=tolerance
    )
    assert found.has_result.all()
    for start, body, omega in zip(starts, moments, found.omega, strict=True):
        alone = prepare(replace(scene, moments=body), method, tolerance)(start, 2.0)
        assert np.abs(omega - alone).max() <= (tolerance or 1e-13) * np.abs(alone).max()


def test_bodies_by_coefficients_under_a_torque_of_the_state() -> None:
    rows = np.array([(0.1, 0.2, -0.3), (0.2, 0.1, -0.3)])
    scene = Scene("", (1, 2, 3), coefficients=rows[0], torque=torques.damping(0.1))
    for row, omega in zip(rows, solve_many(scene, 2.0, coefficients=rows).omega, strict=True):
        alone = solve(replace(scene, coefficients=row), 2.0)
        assert omega == pytest.approx(alone.omega[0], rel=1e-9)


def test_kernels_refuse_a_method_that_they_do_not_have() -> None:
    """A method that was added in Python alone had the results of rk4."""
    scene = replace(TOP, torque=TorqueLaw((0.3, -0.2, 0.1)), step_size=0.05)
    known = {*CODES.values(), *(each for name, each in vars(Methods).items() if name.isupper())}
    for code in (Methods.FIXED + 99, Methods.GAUSS + 9, -1):
        assert code not in known
        with patch.dict(CODES, {"rk4": code}):
            solver = prepare(scene, "rk4")
            assert np.isnan(solver(scene.omega, 1.0)).all()
            assert solver.status == "refused"
            assert not solve_many(scene, 1.0, omega=np.ones((40, 3)), method="rk4").has_result.any()
    rows = extension().fixed_step_solution(
        *normalized(scene), scene.omega, [1.0], 99, 0.1, effort=np.array([1.0, 0.0])
    )
    assert rows[1:3] == (0, Statuses.REFUSED)


def test_what_has_no_lanes_is_solved_one_by_one() -> None:
    starts = np.random.default_rng(1).standard_normal((5, 3))
    law = TorqueLaw(rate=(1.0, 0.0, 2.0), sines=[((1.0, 2.0, 0.0), 3.0)])
    ways = [
        (replace(TOP, torque=law), "rk4"), (replace(TOP, moments=(2.0, 2.0, 1.0)), "rk4"),
        (replace(TOP, torque=law), "gauss-3"), (TOP, "quick"),
        (replace(TOP, moments=(2.0, 2.0, 2.0), torque=law), "auto"),
    ]  # fmt: skip
    for scene, method in ways:
        solver = prepare(scene, method, 1e-6)
        alone = [solver(start, 1.5) for start in starts]
        found = solver.many(starts, 1.5)[0]
        assert np.allclose(found, alone, rtol=0, atol=1e-5 if method == "auto" else 0)


def test_bodies_on_edges_and_near_the_ends_of_the_range() -> None:
    large, small = (np.array([1.0, 2.0, 3.0]) * 10.0**power for power in (150, -150))
    edges = [*EDGES, (large, (3.0, 2.0, 1.0)), (small, (3.0, 2.0, 1.0))]
    omega0, moments = (np.array(each) for each in zip(*edges, strict=True))
    for t_end in (0.0, 1.0, 1e4):
        found = solve_many(TOP, t_end, omega=omega0, moments=moments, tolerance=1e-12)
        for row, (start, body) in enumerate(edges):
            alone = prepare(replace(TOP, moments=body), tolerance=1e-12)(start, t_end)
            allowed = 1e-12 * np.nan_to_num(np.abs(alone).max())
            assert np.allclose(found.omega[row], alone, rtol=0, atol=allowed, equal_nan=True)


def test_flips_after_long_and_orbits_next_to_the_separatrix(level: int) -> None:
    """The mean takes more levels than blocks have, and a rounded distance changes the time."""
    tilts = np.logspace(-3, -15, 97)
    spins = np.column_stack([tilts, np.ones_like(tilts), -0.5 * tilts])
    # A time during the flip.
    times = (np.log(4.0 / tilts) + np.tile([-1.0, 0.0, 1.0], 33)[:97]) * np.sqrt(3.0)
    apart = 1.0 + np.logspace(-2, -14, 97) * np.tile([1.0, -1.0], 49)[:97]
    beside = np.column_stack([apart / np.sqrt(3.0), np.full(97, 0.4), np.ones(97)])
    solver = prepare(replace(TOP, moments=(3.0, 2.0, 1.0)), tolerance=1e-12)
    for starts, ends in ((spins, times), (beside, np.full(97, 25.0))):
        alone = [solver(start, t) for start, t in zip(starts, ends.tolist(), strict=True)]
        found = solver.many(starts, ends)[0]
        assert np.abs(found - alone).max() <= 1e-12 * np.abs(alone).max()
        assert np.ptp(found[:, 1]) > 0.1


def test_coefficients_of_one_sign(level: int) -> None:
    """No body has such coefficients, and neither kernel of lanes takes them."""
    starts = np.random.default_rng(4).standard_normal((40, 3))
    for coefficients in ((0.3, 0.5, 0.2), (-0.3, -0.5, -0.2)):
        scene = Scene("", starts[0], coefficients=coefficients, step_size=0.05)
        for method, allowed in (("auto", 1e-11), ("rk4", 1e-14)):
            solver = prepare(scene, method)
            alone = np.array([solver(start, 0.5) for start in starts])
            bodies_too = solve_many(
                TOP, 0.5, omega=starts, coefficients=coefficients, method=method, step=0.05
            )
            for found in (solver.many(starts, 0.5)[0], bodies_too.omega):
                assert np.allclose(found, alone, rtol=0, atol=allowed * np.abs(alone).max())


def test_the_campaign_finds_what_exceeds() -> None:
    """One body is spoilt; a body whose single solution is too far off as well does not count."""
    drawn = bodies("waves", 40, 3)
    found, truth = (solve_many(TOP, tolerance=each, **drawn) for each in (1e-6, 1e-15))
    assert exceeding(drawn, 1e-6, found, truth)[0] == []
    found.omega[7] += 1e-4 * np.abs(found.omega[7]).max()
    beyond, alike, shares = exceeding(drawn, 1e-6, found, truth)
    assert (beyond, alike) == ([7], [])
    assert shares[7] > 10.0
    truth.omega[9] += 1e-4 * np.abs(truth.omega[9]).max()
    assert exceeding(drawn, 1e-6, found, truth)[:2] == ([7, 9], [9])


def test_no_bodies() -> None:
    assert solve_many(TOP, 1.0, omega=np.empty((0, 3))).omega.shape == (0, 3)
    assert prepare(TOP).many(np.empty((0, 3)), 1.0)[0].shape == (0, 3)


def test_results_go_where_the_caller_says() -> None:
    starts = np.random.default_rng(1).standard_normal((20000, 3))
    first = solve_many(TOP, 1.0, omega=starts)
    array = np.empty((20000, 3))
    assert solve_many(TOP, 1.0, omega=starts, out=array).omega is array
    assert prepare(TOP).many(starts, 1.0, out=array)[0] is array
    tracemalloc.start()
    again = solve_many(TOP, 2.0, omega=starts, out=first)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert again is first
    assert peak < 20000  # bytes: no object for each body
    assert np.array_equal(again.omega, solve_many(TOP, 2.0, omega=starts).omega)


@pytest.mark.parametrize("law", [TorqueLaw(), TorqueLaw((1.0, 2.0, 3.0))])
def test_results_may_overlap_the_starts(law: TorqueLaw) -> None:
    scene = replace(TOP, torque=law)
    solver = prepare(scene)
    rng = np.random.default_rng(7)
    starts, turns = rng.standard_normal((20, 3)), rng.standard_normal((20, 4))
    starts[::3] = [0.0, 1.2, 1e-9]  # left to the single-body kernel
    times = np.linspace(0.5, 30.0, 20)
    omega, status = solver.many(starts, times)
    for shift in (0, 1, 20, 25):  # rows between the starts and the results
        place = np.zeros((45, 3))
        place[:20] = starts
        out = place[shift : shift + 20]
        found = solver.many(place[:20], times, out=out)
        assert found[0] is out
        assert out.tobytes() == omega.tobytes()
        assert found[1].tobytes() == status.tobytes()
    place = starts.copy()
    whole = solve_many(scene, times, omega=starts)
    assert same(solve_many(scene, times, omega=place, out=place), whole)
    wanted: Any = solve_many(scene, times, omega=starts, attitude=turns)
    both = Ensemble(starts.copy(), np.empty(20, np.int8), turns)
    assert solve_many(scene, times, omega=both.omega, attitude=turns, out=both) is both
    assert same(both, wanted)
    assert np.array_equal(turns, wanted.attitude)
    read_only = np.zeros((20, 3))
    read_only.flags.writeable = False
    wrongs = np.empty((19, 3)), np.empty((20, 4)), np.empty((20, 3), "f4"), place[0], read_only
    for wrong in wrongs:
        before = wrong.copy()
        with pytest.raises(InputError, match="out"):
            solver.many(starts, times, out=wrong)
        assert np.array_equal(wrong, before, equal_nan=True)
    with pytest.raises(TypeError):
        solver.many(starts, times, place=omega)


def test_a_masked_number_is_missing() -> None:
    starts = np.ma.masked_array([[1, 2, 3], [1, 2, 3]], mask=[[False, True, False], 3 * [False]])
    found = solve_many(TOP, 1.0, omega=starts)
    assert found.ended.tolist() == ["overflow", "complete"]
    assert np.isnan(found.omega[0]).all()


def test_any_array_will_do() -> None:
    solver = prepare(TOP)
    starts = np.random.default_rng(4).standard_normal((6, 3))
    found = solver.many(starts, 1.0)[0]
    for other in (starts.tolist(), np.asfortranarray(starts), starts.astype(">f8"), starts[::1]):
        assert np.array_equal(solver.many(other, 1.0)[0], found)
    assert np.array_equal(solver.many(starts, np.ones(6))[0], found)
    assert np.array_equal(solver.many(starts, 1.0, threads=2)[0], found)


@pytest.fixture(scope="module")
def by_loops(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Any, ...]]:
    """Return name, tolerance, bodies and results of the solutions by the loops as written."""
    loops = many_as_written(tmp_path_factory.mktemp("loops"))
    solved = []
    for kind, method, tolerance in (
        ("constant", 0, 1e-12), ("waves", 0, 1e-9), ("waves", 0, 1e-6), ("ramp", 0, 1e-3),
        ("constant", CODES["rk4"], 1.0),
    ):  # fmt: skip
        drawn = bodies(kind, 50, 3)
        if method:
            drawn["t_end"] = np.array([0.02])
        zero = np.zeros((50, 3))
        attitude0 = np.random.default_rng(6).standard_normal((0 if method else 50, 4))
        omega, attitude, status = loops(
            method, tolerance, 0.001, drawn["moments"], drawn["torque_constant"],
            drawn.get("torque_rate", zero), drawn.get("sines", np.empty((50, 0, 4))),
            drawn["omega"], drawn["t_end"], attitude0,
        )  # fmt: skip
        drawn.pop("cosines", None)
        if not method:
            drawn["attitude"] = attitude0
        if method:
            drawn["t_end"] = 0.02
        solved.append(("rk4" if method else "taylor", tolerance, drawn, omega, attitude, status))
    return solved


@pytest.mark.campaign
@pytest.mark.external
@pytest.mark.skipif(not compiler_here(), reason="no compiler")
def test_loops_as_written_do_what_they_do_written_out(
    by_loops: list[tuple[Any, ...]], level: int
) -> None:
    """The loops as written take the same steps as those of unroll.py, with other roundings."""
    for name, tolerance, drawn, omega, attitude, status in by_loops:
        found = solve_many(TOP, method=name, tolerance=tolerance, step=0.001, **drawn)
        solved = status == Statuses.COMPLETE
        assert np.count_nonzero(solved) > 20
        off = np.abs(omega - found.omega) / np.abs(found.omega).max(axis=1, keepdims=True)
        assert off[solved].max() <= 1e-11
        if found.attitude is not None:
            assert np.abs(attitude - found.attitude)[solved].max() <= 1e-11


@pytest.mark.parametrize("torque", [
    TorqueLaw(),
    TorqueLaw(constant=(1.0, -2.0, 0.5)),
    TorqueLaw(sines=[((1.0, 2.0, 3.0), 2.0), ((1.0, 2.0, 3.5), -2.0)]),
    TorqueLaw(constant=(1.0, 0.0, 2.0), cosines=[((1.0, 2.0, 3.0), 0.0)]),
])  # fmt: skip
def test_a_scene_and_the_same_arrays_have_the_same_bits(torque: TorqueLaw) -> None:
    """The rows of a scene are kept from call to call, and an array replaces only its own row."""
    scene = replace(TOP, torque=torque)
    starts = np.array([[0.3, -0.4, 1.2], [1.0, 2.0, -0.5]])
    arrays: dict[str, Any] = {
        "moments": np.array([scene.moments]),
        "torque_constant": np.array([torque.constant]),
        "sines": np.array([[*amplitude, f] for amplitude, f in torque.sines]),
        "cosines": np.array([[*amplitude, f] for amplitude, f in torque.cosines]),
    }
    first = solve_many(scene, 3.0, omega=starts)
    assert same(solve_many(scene, 3.0, omega=starts), first)
    for name, array in arrays.items():
        assert same(solve_many(scene, 3.0, omega=starts, **{name: array}), first), name
    assert not same(solve_many(scene, 3.0, omega=starts, torque_constant=(3.0, 1.0, 1.0)), first)
    assert same(solve_many(scene, 3.0, omega=starts), first)


def test_equal_scenes_with_other_zeros_keep_their_signs() -> None:
    ends = [
        solve_many(Scene("", (zero, 0.0, 1.0), moments=(40.0, 40.0, 20.0)), 0.0).omega[0, 0]
        for zero in (0.0, -0.0, 0.0)
    ]
    assert np.signbit(ends).tolist() == [False, True, False]


def test_the_arrays_of_few_scenes_are_kept() -> None:
    scenes = [replace(TOP, omega=(0.1 * n, 1.0, 2.0)) for n in range(30)]
    alone = [solve_many(each, 3.0).omega[0] for each in scenes]
    assert np.array_equal(alone, solve_many(scenes, 3.0).omega)
    assert len(many_scenes._kept) < len(scenes)


def test_one_attitude_for_all_and_arrays_of_the_caller() -> None:
    starts = np.random.default_rng(1).standard_normal((30, 3))
    turned = [0.5, -0.5, 0.5, 0.5]
    each: Any = solve_many(TOP, 3.0, omega=starts, attitude=np.tile(turned, (30, 1)))
    out: Any = solve_many(TOP, 1.0, omega=starts, attitude=turned)
    shared: Any = solve_many(TOP, 3.0, omega=starts, attitude=turned, out=out)
    assert shared is out
    assert np.array_equal(shared.attitude, each.attitude)
    scene = replace(TOP, attitude=(0.5, -0.5, 0.5, 0.5))
    assert np.array_equal(solve_many(scene, 3.0, omega=starts).omega, each.omega)


def test_a_prepared_solver_takes_many_starts() -> None:
    rng = np.random.default_rng(9)
    starts, attitudes = rng.standard_normal((17, 3)), rng.standard_normal((17, 4))
    laws = (TorqueLaw(), TorqueLaw((1.0, 2.0, 3.0)), TorqueLaw((1.0, 0.5, 2.0), frame="space"))
    full = Scene("", (1.0, 0.0, 0.0), inertia=[[40, 3, 1], [3, 30, -2], [1, -2, 20]])
    for body, law in ((TOP, laws[0]), (TOP, laws[1]), (TOP, laws[2]), (full, laws[1])):
        scene = replace(body, torque=law, attitude=(0.5, 0.5, 0.5, -0.5))
        many = prepare(scene, tolerance=1e-9, attitude=True).many
        found: Any = solve_many(scene, 2.0, omega=starts, attitude=attitudes, tolerance=1e-9)
        omega, attitude, status = many(starts, 2.0, attitudes, threads=2)
        assert np.allclose(omega, found.omega, rtol=0.0, atol=1e-8)
        assert np.allclose(attitude, found.attitude, rtol=0.0, atol=1e-9)
        assert np.array_equal(omega, found.omega) or body is full
        assert not status.any()
        usual: Any = solve_many(scene, 2.0, omega=starts, tolerance=1e-9)
        assert np.allclose(many(starts, 2.0)[1], usual.attitude, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("torque", [
    TorqueLaw((1.0, 0.0, 0.0)),
    TorqueLaw((1.0, 0.0, 0.0), frame="space"),
    torques.damping([1.0, 2.0, 3.0]),
])  # fmt: skip
def test_a_bad_attitude_spoils_no_other_of_a_prepared_solver(torque: Any) -> None:
    """Under most torques one such row had raised an error, and all results were lost."""
    starts, turns = np.ones((3, 3)), np.ones((3, 4))
    many = prepare(replace(TOP, torque=torque, attitude=(1.0, 0.0, 0.0, 0.0)), attitude=True).many
    good = many(starts, 1.0, turns)
    turns[0], turns[2, 1] = 0.0, np.nan
    omega, attitude, status = many(starts, 1.0, turns)
    assert np.isnan(attitude[[0, 2]]).all()
    assert np.isnan(omega[[0, 2]]).all()
    assert status[0]
    assert status[2]
    assert np.array_equal(attitude[1], good[1][1])
    assert np.array_equal(omega[1], good[0][1])


@pytest.mark.parametrize("given", [
    {"omega": np.ones((5, 2))}, {"omega": "abc"}, {"omega": [10**400, 1, 1]},
    {"omega": [[1.0, 2.0, 3.0], [1.0]]}, {"omega": np.ones((4, 3)), "moments": np.ones((3, 3))},
    {"moments": [1.0, 1, 1], "coefficients": [1.0, 1, 1]}, {"threads": 0}, {"effort": 0.0},
])  # fmt: skip
def test_mistake_has_the_same_words_for_methods_and_programs(given: dict[str, Any]) -> None:
    with pytest.raises(InputError) as first:
        solve_many(TOP, 1.0, **given)
    with pytest.raises(InputError) as second:
        run_many(TOP, LISTING, **given)
    assert str(first.value) == str(second.value)
    if given.keys() == {"omega"}:
        with pytest.raises(InputError) as third:
            prepare(TOP).many(given["omega"], 1.0)
        assert str(first.value) == str(third.value)


def test_one_row_is_shared_and_fractions_are_numbers() -> None:
    starts = np.ones((4, 3))
    moments: Any = [[Fraction(5, 2), 3, 4]]
    times = np.full(4, 0.5)
    found = solve_many(TOP, times, omega=starts[:1], moments=moments)
    wanted = solve_many(TOP, times, omega=starts, moments=np.tile([2.5, 3.0, 4.0], (4, 1)))
    assert np.array_equal(found.omega, wanted.omega)
    run = run_many(TOP, LISTING, omega=starts[:1], moments=moments, step_size=np.full(4, 0.01))
    alone = run_many(TOP, LISTING, omega=starts[0], moments=[2.5, 3.0, 4.0], step_size=0.01)
    assert np.array_equal(run.omega, np.tile(alone.omega, (4, 1, 1)))
