"""Bodies side by side have the bits of single runs, whatever the block, the thread, the processor."""

import functools
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from pyharness.compare.random_scenes import draw
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.listing import PROGRAMS, Listing, corrected, original, subset
from pyharness.model.scene import Scene, TorqueLaw, most_steps
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import STOP_VARIABLES
from pyharness.original import compiled, many
from pyharness.original.cells import all_listings
from pyharness.original.many import ProgramEnsemble, run_many
from tests.original.test_programs import NASTY

Options = dict[str, Any]


def same_bits(found: object, wanted: object) -> bool:
    """Whether numbers agree to the last bit, one NaN like another."""
    one, other = (np.asarray(each, dtype=np.float64) for each in (found, wanted))
    if one.shape != other.shape:
        return False
    alike = np.ascontiguousarray(one).view(np.int64) == np.ascontiguousarray(other).view(np.int64)
    return bool((alike | (np.isnan(one) & np.isnan(other))).all())


def single_scene(scene: Scene, options: Options, row: int) -> Scene:
    """Return the scene of one body."""
    given = {
        name: options[name] if np.ndim(options[name]) < 2 else options[name][row]
        for name in ("omega0", "moments", "coefficients", "torque_constant")
        if name in options
    }
    if "torque_constant" in given:
        scene = replace(scene, torque=replace(scene.torque, constant=given["torque_constant"]))
    if "moments" in given:
        scene = replace(scene, moments=given["moments"], coefficients=None, inertia=None)
    if "coefficients" in given:
        scene = replace(scene, coefficients=given["coefficients"], moments=None, inertia=None)
    if "omega0" in given:
        scene = replace(scene, omega=given["omega0"])
    step_size = options.get("step_size", scene.step_size)
    return replace(scene, step_size=step_size[row] if np.ndim(step_size) else step_size)


def assert_alike(found: ProgramEnsemble, scene: Scene, listing: Listing, options: Options) -> None:
    """Hold every body against its single run."""
    lipschitz = np.broadcast_to(options.get("lipschitz", 500.0), len(found.n_rows))
    at = found.at - 1
    for row in range(len(found.n_rows)):
        wanted = compiled.run(
            single_scene(scene, options, row), listing, float(lipschitz[row]),
            options.get("may_stop", True), options.get("velocity", False),
        )  # fmt: skip
        where = (listing, scene, options, row)
        assert found.n_rows[row] == wanted.steps, where
        assert ENDS[found.status[row]] == wanted.ended, where
        stop = wanted.stop
        variable = STOP_VARIABLES.index(stop.variable) + 1 if stop else 0
        assert found.stop_variable[row] == variable, where
        assert same_bits(found.stop_quotient[row], stop.quotient if stop else np.nan), where
        there = at < wanted.steps
        rows = at[there]
        assert same_bits(found.omega[row, there], wanted.omega[rows]), where
        assert np.isnan(found.omega[row, ~there]).all(), where
        assert (found.velocity is None) == (wanted.velocity is None)
        if found.velocity is not None and wanted.velocity is not None:
            assert same_bits(found.velocity[row, there], wanted.velocity[rows]), where
            assert np.isnan(found.velocity[row, ~there]).all(), where
        assert (found.ier is None) == (wanted.ier is None)
        if found.ier is not None and wanted.ier is not None:
            np.testing.assert_array_equal(found.ier[row, there], wanted.ier[rows])
            assert (found.ier[row, ~there] == -1).all()
        time = found.recorded_time if found.recorded_time.ndim == 1 else found.recorded_time[row]
        assert same_bits(time[there], wanted.recorded_time[rows]), where
        if found.recorded_time.ndim == 2:
            assert np.isnan(time[~there]).all()
    if found.recorded_time.ndim == 1:
        reached = found.at <= found.n_rows.max(initial=0)
        np.testing.assert_array_equal(np.isnan(found.recorded_time), ~reached)


def assert_same(one: ProgramEnsemble, other: ProgramEnsemble) -> None:
    for name, value in vars(one).items():
        if value is None:
            assert getattr(other, name) is None
        else:
            assert same_bits(value, getattr(other, name)), name
            assert value.dtype == getattr(other, name).dtype


def random_ensemble(number: int, n: int) -> tuple[Scene, Listing, Options]:
    """Return a scene, and what differs from body to body of what may."""
    drawn = draw("many", number)
    source = np.random.default_rng(number)
    scene = drawn.scene
    options: Options = {
        "omega0": np.array(scene.omega) * source.uniform(-2.0, 2.0, (n, 3)),
        "lipschitz": drawn.lipschitz * 10.0 ** source.uniform(-1.0, 1.0, n),
        "may_stop": drawn.may_stop,
        "velocity": bool(source.random() < 0.5),
        "at": np.sort(source.choice(scene.steps, 4, replace=False)) + 1,
    }
    if source.random() < 0.3:
        # Also steps with which the matrix is singular, and other rows are its pivots.
        options["step_size"] = scene.step_size * 10.0 ** source.choice([-9.0, -0.5, 0.0, 2.0], n)
    if source.random() < 0.3:
        body = "moments" if source.random() < 0.7 else "coefficients"
        options[body] = source.uniform(0.5, 50.0, (n, 3))
    if source.random() < 0.3:
        size = np.abs(scene.torque.constant).max() + 1.0
        options["torque_constant"] = source.normal(size=(n, 3)) * size
    if source.random() < 0.5:
        # Extremes among others: what overflows, stands still, or vanishes.
        some = source.choice([0.0, -0.0, 1e-310, 1e160, 1e300], (n, 3))
        options["omega0"] = np.where(source.random((n, 3)) < 0.1, some, options["omega0"])
    return scene, drawn.listing, options


@pytest.mark.property
@pytest.mark.parametrize("part", range(4))
def test_random_bodies_have_the_bits_of_their_single_runs(level: int, part: int) -> None:
    """Scenes plain and nasty, every program, torque of any kind, listings of any flags."""
    for number in range(250 * part, 250 * part + 250):
        n = (1, 2, 7, 8, 9, 31, 32, 33)[number % 8]
        scene, listing, options = random_ensemble(number, n)
        assert_alike(run_many(scene, listing, **options), scene, listing, options)


@pytest.mark.bitwise
@pytest.mark.parametrize("program", PROGRAMS)
def test_every_listing_has_the_bits_of_its_single_runs(program: str) -> None:
    """Of nasty scenes, and of Case 7 with and without the torque of its cards."""
    scenes = [*NASTY.values(), case_scene(7)]
    for index, listing in enumerate(all_listings(program)):
        for scene in [scenes[(index + k) % len(scenes)] for k in range(0, len(scenes), 3)]:
            options = {
                "omega0": np.multiply(scene.omega, [[1.0], [0.5], [-1.5]]),
                "lipschitz": [500.0, 1.0, 1e-2],
                "velocity": index % 2 == 0,
                "at": range(1, scene.steps + 1),
            }
            assert_alike(run_many(scene, listing, **options), scene, listing, options)
    conjectures = original(program).conjectures | {"initial-torque"}
    for listing in (original(program), corrected(program)):
        for body in ({}, {"moments": [[30.0, 20.0, 50.0], [3.0, 2.0, 1.0]]},
                     {"coefficients": [0.1, 0.2, -0.3]}):  # fmt: skip
            assumed = replace(listing, conjectures=conjectures)
            options = {"at": range(1, 101), "velocity": True, **body}
            assert_alike(
                run_many(case_scene(7), assumed, **options), case_scene(7), assumed, options
            )


@pytest.mark.parametrize("n", [1, 7, 8, 9, 64, 1000])
@pytest.mark.parametrize("program", PROGRAMS)
def test_blocks_and_threads_change_no_bit(
    program: str, n: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(many, "_LEAST_WORK", 1)
    scene = replace(case_scene(7), steps=20)
    source = np.random.default_rng(n)
    options: Options = {
        "omega0": source.normal(size=(n, 3)) * 10.0 ** source.uniform(-1.0, 3.0, (n, 1)),
        "lipschitz": 10.0 ** source.uniform(0.0, 3.0, n),
        "velocity": True,
        "at": [3, 20],
    }
    for listing in (original(program), corrected(program)):
        one = run_many(scene, listing, **options)
        assert_alike(one, scene, listing, options)
        for threads in (2, 3):
            assert_same(one, run_many(scene, listing, threads=threads, **options))
        mixed = {**options, "step_size": 0.01 * source.integers(1, 4, n)}
        apart = run_many(scene, listing, **mixed)
        assert_same(apart, run_many(scene, listing, threads=3, **mixed))
        backward = {k: v[::-1] if np.shape(v)[:1] == (n,) else v for k, v in options.items()}
        if n not in (1, 2):
            found = run_many(scene, listing, **backward)
            assert same_bits(found.omega[::-1], one.omega)
            np.testing.assert_array_equal(found.n_rows[::-1], one.n_rows)


def test_blocks_are_shared_among_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many, "_LEAST_WORK", 1)
    for n, threads in ((1, 3), (64, 2), (1000, 3), (5000, 2)):
        pieces = list(many._pieces(n, 100, threads))
        assert [each.start for each in pieces] == [0, *(each.stop for each in pieces[:-1])]
        assert pieces[-1].stop == n
        assert all(each.start % 32 == 0 for each in pieces)
        assert (len(pieces) >= threads) == (n >= 32 * threads)
    assert list(many._pieces(1000, 100, 1)) == [slice(0, 1000)]
    assert list(many._pieces(0, 100, 2)) == []


def test_stops_of_the_thesis() -> None:
    """Section V.2: Case 2 ends after 25 steps, by V2; the others beside it don't."""
    cases = [case_scene(number) for number in (1, 2, 3)]
    found = run_many(
        cases[1], original("runge-kutta"), omega0=[case.omega for case in cases],
        moments=[case.moments for case in cases], at=[25, 26, 100],
        torque_constant=[case.torque.constant for case in cases],
    )  # fmt: skip
    assert (found.n_rows[1], found.status[1], found.stop_variable[1]) == (25, 1, 5)
    assert found.stop_quotient[1] > 500.0
    np.testing.assert_array_equal(np.isnan(found.omega[1, :, 0]), [False, True, True])
    for number, scene in enumerate(cases):
        wanted = compiled.run(scene, original("runge-kutta"))
        assert found.n_rows[number] == wanted.steps
        if wanted.steps >= 25:
            assert same_bits(found.omega[number, 0], wanted.omega[24])


@pytest.mark.parametrize("program", PROGRAMS)
def test_bodies_that_overflow_spoil_no_other(program: str) -> None:
    """One after the other, at every step, among those that go on to the end."""
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(50.0, 60.0, 70.0), steps=40)
    options: Options = {"omega0": np.full((40, 3), 1.0), "at": range(1, 41), "may_stop": False}
    options["omega0"] *= (10.0 ** np.linspace(-2.0, 2.0, 40))[:, None]
    found = run_many(scene, corrected(program), **options)
    assert len(set(found.n_rows)) > 10
    assert set(found.status) == {0, 2}
    assert_alike(found, scene, corrected(program), options)


@pytest.mark.parametrize("program", ["two-term", "four-term"])
def test_steps_of_any_size_side_by_side(level: int, program: str) -> None:
    """A singular matrix stays as it was, lane by lane; pivots are other rows where steps are long."""
    scene = replace(case_scene(5), steps=12)
    step_size = np.tile([1e-17, 1e-9, 1e-3, 0.3, 1.0, 2.5, 40.0, 1e5, 1e200], 5)
    for listing in (original(program), corrected(program)):
        options: Options = {"step_size": step_size, "at": range(1, 13), "velocity": True}
        found = run_many(scene, listing, **options)
        assert found.ier is not None
        assert {0, 129} <= set(found.ier[:, 0].tolist())
        assert_alike(found, scene, listing, options)
        for one in (1e-17, 1e-9, 1e-3, 2.5, 40.0):
            alike = {**options, "step_size": one, "omega0": np.eye(3)}
            assert_alike(run_many(scene, listing, **alike), scene, listing, alike)


def test_rows_in_the_order_asked_for() -> None:
    scene = case_scene(3)
    every = run_many(scene, corrected("four-term"), at=range(1, 101))
    some = run_many(scene, corrected("four-term"), at=[100, 3, 3, 50])
    for name in ("omega", "ier"):
        np.testing.assert_array_equal(
            getattr(some, name)[0], getattr(every, name)[0, [99, 2, 2, 49]]
        )
    np.testing.assert_array_equal(some.recorded_time, every.recorded_time[[99, 2, 2, 49]])
    np.testing.assert_array_equal(some.at, [100, 3, 3, 50])
    last = run_many(scene, corrected("four-term"))
    np.testing.assert_array_equal(last.omega[:, 0], every.omega[:, -1])
    none = run_many(scene, corrected("four-term"), at=[], omega0=np.ones((5, 3)))
    assert (none.omega.shape, none.n_rows.tolist()) == ((5, 0, 3), [100] * 5)


@pytest.mark.parametrize("threads", [1, 2])
def test_no_bodies_at_all(threads: int) -> None:
    found = run_many(case_scene(3), corrected("two-term"), omega0=np.ones((0, 3)), threads=threads)
    assert (found.omega.shape, found.ier is not None) == ((0, 1, 3), True)
    assert np.isnan(found.recorded_time).all()


def test_types_and_shapes_of_what_is_found() -> None:
    given = {"omega0": np.ones((4, 3)), "at": [1, 2]}
    found = run_many(case_scene(3), corrected("runge-kutta"), **given)
    assert (found.omega.shape, found.recorded_time.shape) == ((4, 2, 3), (2,))
    assert (found.velocity, found.ier) == (None, None)
    kinds = found.n_rows.dtype, found.status.dtype, found.stop_variable.dtype
    assert kinds == (np.int32, np.int8, np.int8)
    apart = run_many(
        case_scene(3), corrected("two-term"), step_size=[1.0, 1.0, 1.0, 2.0], velocity=True, **given
    )
    assert apart.recorded_time.shape == (4, 2)
    assert apart.velocity is not None
    assert apart.velocity.shape == (4, 2, 3)


def test_numbers_of_any_type() -> None:
    scene, listing = case_scene(3), corrected("two-term")
    wanted = run_many(scene, listing, omega0=[[0.5, 1.0, 2.0]], moments=(4.0, 3.0, 2.0))
    for omega, moments in (
        ([[Fraction(1, 2), 1, 2]], np.array([4, 3, 2])),
        (np.array([[0.5, 1.0, 2.0]], dtype=np.float32), (4, 3, Fraction(2))),
        (np.asfortranarray([[0.5, 1.0, 2.0]]), np.array([4, 9, 3, 9, 2, 9.0])[::2]),
    ):
        found = run_many(scene, listing, omega0=omega, moments=moments, threads=np.int64(1))
        assert_same(found, wanted)


def _bad(row: int, value: float) -> np.ndarray:
    array = np.ones((20, 3))
    array[row, 1] = value
    return array


SPACE = TorqueLaw(frame="space")
BAD: dict[str, tuple[Options, str]] = {
    "moment": ({"moments": _bad(17, -1.0)}, r"moments\[17\]\[1\] is -1; allowed: a finite .* 0"),
    "no moment": ({"moments": [1.0, 0.0, 2.0]}, r"moments\[1\] is 0; allowed"),
    "endless moment": ({"moments": _bad(3, np.inf)}, r"moments\[3\]\[1\] is inf; allowed"),
    "coefficient": ({"coefficients": _bad(0, np.nan)}, r"coefficients\[0\]\[1\] is nan; allowed"),
    "omega": ({"omega0": _bad(19, np.inf)}, r"omega0\[19\]\[1\] is inf; allowed: finite numbers"),
    "torque": ({"torque_constant": _bad(2, np.nan)}, r"torque_constant\[2\]\[1\] is nan"),
    "both": ({"moments": np.ones(3), "coefficients": np.ones(3)}, "are both given"),
    "rows": ({"moments": np.ones((4, 3)), "omega0": np.ones((5, 3))}, "body 4, omega 5"),
    "one row": ({"omega0": np.ones((1, 3)), "step_size": np.ones(7)}, "omega 1, step_size 7"),
    "width": ({"omega0": np.ones((5, 2))}, r"omega0 is of shape \(5, 2\); allowed: \(3,\) or"),
    "depth": ({"omega0": np.ones((5, 1, 3))}, "omega0 is of shape"),
    "number": ({"omega0": 1.0}, "omega0 is one number; allowed"),
    "ragged": ({"omega0": [[1.0, 2.0, 3.0], [1.0]]}, "omega0: a list that is no array"),
    "text": ({"omega0": ["1", "2", "3"]}, "omega0: text where a number belongs"),
    "truth": ({"omega0": [True, False, True]}, "omega0: true or false where a number belongs"),
    "complex": ({"omega0": np.ones(3) * 1j}, "omega0: a complex number where"),
    "nothing": ({"omega0": [None, 1.0, 2.0]}, "omega0: nothing where a number belongs"),
    "too large": ({"omega0": [10**400, 1, 1]}, "omega0: a number too large"),
    "step": ({"step_size": [0.1, 0.0]}, r"step_size\[1\] is 0; allowed: a finite number above 0"),
    "only step": ({"step_size": -1.0}, "step_size is -1; allowed"),
    "steps": ({"step_size": np.ones((3, 1))}, r"step_size is of shape \(3, 1\); allowed: one"),
    "end": ({"step_size": [1.0, 1e307]}, r"step_size\[1\] times steps is not finite"),
    "lipschitz": ({"lipschitz": [1.0, np.nan]}, r"lipschitz\[1\] is nan; allowed: a number from 0"),
    "below 0": ({"lipschitz": -1.0}, "lipschitz is -1; allowed"),
    "stop": ({"may_stop": 1}, "may_stop is a whole number; allowed: True or False"),
    "velocity": ({"velocity": None}, "velocity is nothing; allowed"),
    "at": ({"at": [0]}, "at: 0; allowed: steps from 1 to 100"),
    "late": ({"at": [1, 101]}, "at: 101; allowed"),
    "fraction": ({"at": [1.5]}, "at is a number; it must be a whole number"),
    "no list": ({"at": 5}, "at: a whole number; allowed: a list of steps"),
    "threads": ({"threads": 0}, "threads is 0; allowed: a whole number from 1"),
    "half a thread": ({"threads": 1.5}, "threads is a number; it must be a whole number"),
    "effort": ({"effort": 0.0}, "effort: 0; allowed"),
    "work": (
        {"omega0": np.ones((200, 3)), "effort": 1e-5},
        r"100 steps of 200 bodies would take too long; take fewer, or allow .* --effort 2",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_is_refused(name: str) -> None:
    options, message = BAD[name]
    with pytest.raises(InputError, match=message):
        run_many(case_scene(3), corrected("runge-kutta"), **options)


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "no scene": (lambda: run_many("case 3", corrected("two-term")), "scene is text"),  # type: ignore[arg-type]
    "no listing": (lambda: run_many(case_scene(3), "original"), "listing is text"),  # type: ignore[arg-type]
    "inertia": (
        lambda: run_many(Scene("", (1, 2, 3), inertia=np.eye(3)), corrected("two-term")),
        "the scene has a full inertia matrix",
    ),
    "space": (
        lambda: run_many(replace(case_scene(3), torque=SPACE), corrected("two-term"),
                         torque_constant=[[0.0, 0.0, 1.0]]),
        "the torque is about the axes of space",
    ),
    "memory": (
        lambda: run_many(
            replace(case_scene(3), steps=1000), corrected("two-term"), at=range(1, 1001),
            omega0=np.ones((most_steps() // 1000 + 1, 3)), effort=1e9,
        ),
        "what fits in",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_scenes_that_are_refused(name: str) -> None:
    run, message = REFUSED[name]
    with pytest.raises(InputError, match=message):
        run()


def test_arrays_stand_in_for_what_a_scene_lacks() -> None:
    """A full inertia matrix that is not read, and a torque in space that is none."""
    scene = Scene("", (1.0, 2.0, 3.0), inertia=np.eye(3), torque=SPACE)
    found = run_many(scene, corrected("two-term"), moments=(3.0, 2.0, 1.0))
    plain = Scene("", (1.0, 2.0, 3.0), (3.0, 2.0, 1.0))
    assert same_bits(found.omega[0, 0], compiled.run(plain, corrected("two-term")).omega[-1])


def test_an_effort_lets_more_bodies_run() -> None:
    run = functools.partial(
        run_many, case_scene(3), corrected("two-term"), omega0=np.ones((200, 3))
    )
    assert run(effort=1e-4).n_rows.tolist() == [100] * 200


def test_velocity_that_the_stop_test_reads_is_computed_unasked() -> None:
    listing = subset("runge-kutta", "corrected", keep=["lipschitz-tests-velocity"])
    options: Options = {"lipschitz": [1e-3, 1.0, 1e3], "at": [1, 2, 3]}
    found = run_many(case_scene(5), listing, **options)
    assert found.stop_variable[0] == 8
    assert_alike(found, case_scene(5), listing, options)
