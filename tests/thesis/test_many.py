"""Bodies in a batch have the bits of single runs, whatever the block, thread or processor."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, case_scene, run_many
from pyharness.checks.scenes.random_scenes import draw
from pyharness.model.listing import PROGRAMS, Listing, subset
from pyharness.thesis import many
from pyharness.thesis.cells import all_listings
from tests.thesis.single_runs import Options, assert_alike, assert_same, same_bits
from tests.thesis.test_programs import NASTY


def random_ensemble(number: int, n: int) -> tuple[Scene, Listing, Options]:
    drawn = draw("many", number)
    source = np.random.default_rng(number)
    scene = drawn.scene
    options: Options = {
        "omega": np.array(scene.omega) * source.uniform(-2.0, 2.0, (n, 3)),
        "lipschitz": drawn.lipschitz * 10.0 ** source.uniform(-1.0, 1.0, n),
        "may_stop": drawn.may_stop,
        "velocity": bool(source.random() < 0.5),
        "at": np.sort(source.choice(scene.steps, 4, replace=False)) + 1,
    }
    if source.random() < 0.3:
        # Also steps for which the matrix is singular, or other rows are its pivots.
        options["step_size"] = scene.step_size * 10.0 ** source.choice([-9.0, -0.5, 0.0, 2.0], n)
    if source.random() < 0.3:
        body = "moments" if source.random() < 0.7 else "coefficients"
        options[body] = source.uniform(0.5, 50.0, (n, 3))
    if source.random() < 0.3:
        size = np.abs(scene.law.constant).max() + 1.0
        options["torque_constant"] = source.normal(size=(n, 3)) * size
    if source.random() < 0.5:
        # Extremes among others: bodies that overflow, do not move, or vanish.
        some = source.choice([0.0, -0.0, 1e-310, 1e160, 1e300], (n, 3))
        options["omega"] = np.where(source.random((n, 3)) < 0.1, some, options["omega"])
    return scene, drawn.listing, options


@pytest.mark.campaign
@pytest.mark.property
def test_random_bodies_have_the_bits_of_their_single_runs(level: int) -> None:
    """Each instruction set has its own scenes, plain and nasty."""
    for number in range(240 * level, 240 * level + 240):
        scene, listing, options = random_ensemble(number, (1, 2, 7, 8, 9, 31, 32, 33)[number % 8])
        assert_alike(run_many(scene, listing, **options), scene, listing, options)


@pytest.mark.campaign
@pytest.mark.bitwise
@pytest.mark.parametrize("program", PROGRAMS)
def test_every_listing_has_the_bits_of_its_single_runs(program: str) -> None:
    scenes = [*NASTY.values(), case_scene(7)]
    for index, listing in enumerate(all_listings(program)):
        for scene in [scenes[(index + k) % len(scenes)] for k in range(0, len(scenes), 3)]:
            options: Options = {
                "omega": np.multiply(scene.omega, [[1.0], [0.5], [-1.5]]),
                "lipschitz": [500.0, 1.0, 1e-2],
                "velocity": index % 2 == 0,
                "at": range(1, scene.steps + 1),
            }
            assert_alike(run_many(scene, listing, **options), scene, listing, options)
    scene, conjectures = case_scene(7), Listing.original(program).conjectures | {"initial-torque"}
    moments, coefficients = [[30.0, 20.0, 50.0], [3.0, 2.0, 1.0]], [0.1, 0.2, -0.3]
    for listing in (Listing.original(program), Listing.corrected(program)):
        assumed = replace(listing, conjectures=conjectures)
        for body in ({}, {"moments": moments}, {"coefficients": coefficients}):
            options = {"at": range(1, 101), "velocity": True, **body}
            assert_alike(run_many(scene, assumed, **options), scene, assumed, options)


@pytest.mark.sampled
@pytest.mark.parametrize("n", [1, 7, 8, 9, 64, 1000])
@pytest.mark.parametrize("program", PROGRAMS)
def test_threads_change_no_bit(program: str, n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many, "_LEAST_WORK", 1)
    scene = replace(case_scene(7), steps=20)
    source = np.random.default_rng(n)
    options: Options = {
        "omega": source.normal(size=(n, 3)) * 10.0 ** source.uniform(-1.0, 3.0, (n, 1)),
        "lipschitz": 10.0 ** source.uniform(0.0, 3.0, n), "velocity": True, "at": [3, 20],
    }  # fmt: skip
    for listing in (Listing.original(program), Listing.corrected(program)):
        one = run_many(scene, listing, **options)
        assert_alike(one, scene, listing, options)
        for threads in (2, 3):
            assert_same(one, run_many(scene, listing, threads=threads, **options))
        mixed = {**options, "step_size": 0.01 * source.integers(1, 4, n)}
        assert_same(run_many(scene, listing, **mixed), run_many(scene, listing, threads=3, **mixed))
        backward = {k: v[::-1] if np.shape(v)[:1] == (n,) else v for k, v in options.items()}
        if n not in (1, 2):
            found = run_many(scene, listing, **backward)
            assert same_bits(found.omega[::-1], one.omega)
            np.testing.assert_array_equal(found.n_rows[::-1], one.n_rows)


def test_blocks_are_shared_among_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many, "_LEAST_WORK", 1)
    for n, threads in ((1, 3), (64, 2), (1000, 3), (5000, 2)):
        pieces = list(many._pieces(n, 100, threads))
        assert all(each.start % 32 == 0 for each in pieces)
        assert (len(pieces) >= threads) == (n >= 32 * threads)
        assert [each.start for each in pieces] == [0, *(each.stop for each in pieces[:-1])]
        assert pieces[-1].stop == n
    assert len(list(many._pieces(1000, 100, 1))) == 1


def test_stops_of_the_thesis() -> None:
    """Section V.2: Case 2 ends after 25 steps, by V2; the other bodies of the batch don't."""
    scene, listing = case_scene(2), Listing.original("runge-kutta")
    cases = [case_scene(number) for number in (1, 2, 3)]
    options: Options = {
        "omega": [case.omega for case in cases], "moments": [case.moments for case in cases],
        "torque_constant": [case.law.constant for case in cases], "at": [25, 26, 100],
    }  # fmt: skip
    found = run_many(scene, listing, **options)
    assert (found.n_rows[1], found.status[1], found.stop_variable[1]) == (25, 1, 5)
    assert found.ended[1] == "stopped"
    assert not found.has_result[1]
    assert repr(found).startswith("ProgramEnsemble(omega=<float64 (3, 3, 3)>, status=")
    assert found.stop_quotient[1] > 500.0
    np.testing.assert_array_equal(np.isnan(found.omega[1, :, 0]), [False, True, True])
    assert_alike(found, scene, listing, options)


@pytest.mark.parametrize("program", PROGRAMS)
def test_bodies_that_overflow_spoil_no_other(program: str) -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(50.0, 60.0, 70.0), steps=40)
    options: Options = {"omega": np.full((40, 3), 1.0), "at": range(1, 41), "may_stop": False}
    options["omega"] *= (10.0 ** np.linspace(-2.0, 2.0, 40))[:, None]
    found = run_many(scene, Listing.corrected(program), **options)
    assert len(set(found.n_rows)) > 10
    assert set(found.status) == {0, 2}
    assert_alike(found, scene, Listing.corrected(program), options)


@pytest.mark.parametrize("program", ["two-term", "four-term"])
def test_steps_of_any_size_side_by_side(level: int, program: str) -> None:
    """In each lane a singular matrix leaves B unchanged; long steps have other rows for pivots."""
    scene = replace(case_scene(5), steps=12)
    step_size = np.tile([1e-17, 1e-9, 1e-3, 0.3, 1.0, 2.5, 40.0, 1e5, 1e200], 5)
    for listing in (Listing.original(program), Listing.corrected(program)):
        options: Options = {"step_size": step_size, "at": range(1, 13), "velocity": True}
        found: Any = run_many(scene, listing, **options)
        assert {0, 129} <= set(found.ier[:, 0].tolist())
        assert_alike(found, scene, listing, options)
        for one in (1e-17, 1e-9, 1e-3, 2.5, 40.0):
            alike = {**options, "step_size": one, "omega": np.eye(3)}
            assert_alike(run_many(scene, listing, **alike), scene, listing, alike)


def test_rows_in_the_order_asked_for() -> None:
    scene, listing, at = case_scene(3), Listing.corrected("four-term"), [100, 3, 3, 50]
    every = run_many(scene, listing, at=range(1, 101))
    some = run_many(scene, listing, at=at)
    rows = np.subtract(at, 1)
    for name in ("omega", "ier"):
        np.testing.assert_array_equal(getattr(some, name)[0], getattr(every, name)[0, rows])
    np.testing.assert_array_equal(some.recorded_time, every.recorded_time[rows])
    np.testing.assert_array_equal(some.at, at)
    np.testing.assert_array_equal(run_many(scene, listing).omega[:, 0], every.omega[:, -1])
    none = run_many(scene, listing, at=[], omega=np.ones((5, 3)))
    assert (none.omega.shape, none.n_rows.tolist()) == ((5, 0, 3), [100] * 5)


def test_types_and_shapes_of_what_is_found() -> None:
    scene, given = case_scene(3), Options(omega=np.ones((4, 3)), at=[1, 2])
    found = run_many(scene, Listing.corrected("runge-kutta"), **given)
    assert (found.omega.shape, found.recorded_time.shape) == ((4, 2, 3), (2,))
    assert (found.velocity, found.ier) == (None, None)
    kinds = found.n_rows.dtype, found.status.dtype, found.stop_variable.dtype
    assert [str(each) for each in kinds] == ["int32", "int8", "int8"]
    two = Listing.corrected("two-term")
    apart: Any = run_many(scene, two, step_size=[1.0, 1.0, 1.0, 2.0], velocity=True, **given)
    assert apart.recorded_time.shape == (4, 2)
    assert apart.velocity.shape == (4, 2, 3)
    for threads in (1, 2):  # no bodies at all
        found = run_many(scene, two, omega=np.ones((0, 3)), threads=threads)
        assert (found.omega.shape, found.ier is not None) == ((0, 1, 3), True)
        assert np.isnan(found.recorded_time).all()


def test_velocity_that_the_stop_test_reads_is_computed_unasked() -> None:
    listing = subset("runge-kutta", "corrected", keep=["lipschitz-tests-velocity"])
    options: Options = {"lipschitz": [1e-3, 1.0, 1e3], "at": [1, 2, 3]}
    found = run_many(case_scene(5), listing, **options)
    assert found.stop_variable[0] == 8
    assert_alike(found, case_scene(5), listing, options)


@pytest.mark.parametrize("keep", [[], ["lipschitz-per-component"], ["lipschitz-tests-velocity"]])
def test_constants_beside_the_quotient_itself(level: int, keep: list[str]) -> None:
    """The last bit of a constant decides, even for numbers whose squares underflow or overflow."""
    listing = subset("runge-kutta", "corrected", keep=keep)
    source = np.random.default_rng(1)
    scene = replace(case_scene(5), steps=2)
    sizes = 10.0 ** source.choice([-165.0, -150.0, 0.0, 1.0, 75.0], (80, 1))
    omega = source.normal(size=(80, 3)) * sizes
    found = run_many(scene, listing, omega=omega, lipschitz=0.0, at=[])
    stopped = found.stop_variable > 0
    assert stopped.sum() > 40
    quotient, omega = found.stop_quotient[stopped], omega[stopped]
    for constant in (
        quotient,
        *(np.nextafter(quotient, end) for end in (0.0, np.inf)),
        *(quotient * (1.0 + few * 2.0**-52) for few in (-3, -2, 2, 3)),
    ):
        options: Options = {"omega": omega, "lipschitz": constant, "at": [1, 2]}
        assert_alike(run_many(scene, listing, **options), scene, listing, options)
