"""Prepared solvers and the plan: right results, one check of arguments, cheap calls, equal bits."""

import copy
import math
import pickle
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import pyharness.engine.plan.plan as planning
import pyharness.engine.prepared.solver as solver_module
from pyharness import InputError, Scene, Solver, TorqueLaw, case_scene, prepare, solve, solve_many
from pyharness.bench.growth import growth
from pyharness.bench.savings import measured_saving
from pyharness.engine.plan.plan import RK4_OR_TAYLOR, plan
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.trajectory import Array
from pyharness.torques import damping
from pyharness.truth.reference import reference
from tests.conftest import ResultOf
from tests.refused import refused

PUSHED = case_scene(5)
RUNAWAY = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))


def _omega(scene: Scene) -> Array:
    return np.array(scene.omega)


def test_sphere_is_a_closed_form_under_any_torque() -> None:
    law = TorqueLaw((1.0, -2.0, 3.0), (0.5, 0.0, -1.0), (((1.0, 2.0, 3.0), 3.0),))
    scene = Scene("", (0.3, -1.0, 2.0), moments=(2.0, 2.0, 2.0), torque=law)
    solver = prepare(scene)
    assert (solver.plan.method, solver.plan.closed_form) == ("closed-form", "sphere")
    np.testing.assert_allclose(solver(_omega(scene), 2.0), reference(scene, [2.0]).omega[0], 1e-15)


@pytest.fixture
def solver() -> Solver:
    return prepare(PUSHED)


def test_results_are_new_arrays_unless_out_is_given(solver: Solver) -> None:
    start = _omega(PUSHED)
    found = [solver(start * k, 1.0) for k in (1.0, 2.0)]
    wanted, other = (each.tolist() for each in found)
    assert wanted != other
    assert all(each.flags.owndata and each.flags.writeable for each in found)
    rows = np.zeros((2, 3))
    row = rows[1]
    assert solver(start, 1.0, out=row) is row
    assert rows.tolist() == [[0.0] * 3, wanted]
    assert solver(out=row, t_end=1.0, omega=start) is row
    assert solver(start, 1.0, **{"".join("out"): row}) is row
    assert solver(start, 1.0, out=None).tolist() == wanted
    assert solver(start, 1.0, out=start) is start  # into the array of the start
    assert start.tolist() == wanted


def test_calls_that_are_none_are_type_errors(solver: Any) -> None:
    start = np.ones(3)
    for arguments, named, words in (
        ((), {}, "omega"),
        ((start,), {}, "t_end"),
        ((start,), {"out": start}, "t_end"),
        ((start, 1.0, start), {}, "2 positional arguments but 3"),
        ((start, 1.0), {"buffer": start}, "buffer"),
        ((start, 1.0), {"t_end": 1.0}, "t_end"),
    ):
        with pytest.raises(TypeError, match=words):
            solver(*arguments, **named)


_NO_STARTS = (
    np.array([1.0, 2.0, 3.0j]), [1.0, 2.0, 3j], [1.0, 2.0], [1.0, 2.0, 3.0, 4.0], np.ones(4), 5.0,
    "123", b"123", ["1", "2", "3"], np.array(["1", "2", "3"]), None, [1.0, None, 3.0],
    [[1.0, 2.0, 3.0]], np.ones((1, 3)), np.ones((3, 1)), np.array(1.0), {1.0, 2.0, 3.0},
    bytearray(b"123"), frozenset((1.0, 2.0, 3.0)), {1: 1, 2: 2, 3: 3},
    np.array([1.0, None, 3.0], dtype=object), [10**400, 1, 2], [10**5000, 1, 2], 10**5000,
    [True, False, True], np.array([True, False, True]), ["\n", "\x1b[31m", 1.0],
    np.array([1, 2, 3], dtype="m8[s]"),
)  # fmt: skip
_NO_TIMES = (
    np.array([1.0, 2.0]), np.array([1.0]), [1.0], "1.0", None, 1j, np.complex64(1.0), 10**400,
    10**5000, True, np.array("1.0"), np.timedelta64(1, "s"),
)  # fmt: skip


def test_what_is_no_start_or_no_time_is_refused_and_not_counted(solver: Solver) -> None:
    out = np.zeros(3)
    solver(np.ones(3), 1.0)
    steps = solver.steps
    given: Any
    for name, wrongs in (("omega", _NO_STARTS), ("t_end", _NO_TIMES)):
        for wrong in wrongs:
            given = (wrong, 1.0) if name == "omega" else (np.ones(3), wrong)
            calls: list[Any] = [partial(solver, *given), partial(solver, *given, out=out)]
            if name == "omega":
                calls.append(partial(solver.trajectory, given[0], [1.0]))
            for call in calls:
                with pytest.raises(InputError, match=name) as caught:
                    call()
                assert str(caught.value).isprintable()
    assert not out.any()
    assert solver.steps == steps > 0


def test_starts_and_times_of_other_kinds_are_converted() -> None:
    solver = prepare(case_scene(5), tolerance=1e-9)
    wanted = solver(np.array([1.0, 2.0, 3.0]), 2.0).tolist()
    starts: tuple[Any, ...] = (
        [1, 2, 3], (1.0, 2.0, 3.0), range(1, 4), np.array([1, 2, 3], "f4"),
        np.array([1, 2, 3], "f2"), np.array([1, 2, 3], "u8"), np.array([1, 2, 3], "i1"),
        np.array([1, 2, 3], ">f8"), np.array([1, 2, 3], "g"),
        np.array([3.0, 2.0, 1.0])[::-1],
        np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]).T[:, 0], (1, 2, Fraction(3)),
        [np.float32(1), np.array(2), 3], [np.int8(1), np.float64(2), np.longdouble(3)],
        np.frombuffer(bytes(1) + np.array([1.0, 2.0, 3.0]).tobytes(), "u1")[1:].view("f8"),
    )  # fmt: skip
    for start in starts:
        assert solver(start, 2.0).tolist() == wanted
    for time in (2, np.float64(2.0), np.float32(2.0), np.int8(2), np.array(2.0), Fraction(2)):
        assert solver([1.0, 2.0, 3.0], time).tolist() == wanted
    assert solver([1.0, 2.0, 3.0], 10**300).tolist() == pytest.approx([np.nan] * 3, nan_ok=True)


@pytest.mark.parametrize("method", ["auto", "quick", "gauss-3"])
def test_copies_are_prepared_as_the_solver_was(method: str) -> None:
    scene = case_scene(7)
    solver = prepare(scene, method, tolerance=1e-4)
    wanted = solver(_omega(scene), 3.0).tolist()
    pickles = [pickle.dumps(solver, each) for each in range(pickle.HIGHEST_PROTOCOL + 1)]
    for other in (copy.copy(solver), copy.deepcopy(solver), *map(pickle.loads, pickles)):
        assert type(other) is Solver
        assert (other.plan, repr(other)) == (solver.plan, repr(solver))
        assert (other.status, other.steps) == ("complete", 0)
        assert other(_omega(scene), 3.0).tolist() == wanted
        rows = (each.trajectory(scene.omega, [1.0]).omega.tolist() for each in (other, solver))
        assert next(rows) == next(rows)


def test_another_kernel_may_stand_in_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted faults replace the kernel: its exceptions are raised, and its results are checked."""
    answers: list[Any] = []

    def kernel(packed: Array, omega0: Array, t_end: float) -> Any:
        assert (omega0.tolist(), t_end) == ([1.0, 1.0, 1.0], 2.0)
        assert not packed.flags.writeable
        return answers.pop(0)

    monkeypatch.setattr(solver_module, "extension", lambda: SimpleNamespace(solve_packed=kernel))
    solver = prepare(PUSHED)
    for found, status, steps, word in (
        (np.array([1.0, 2.0, 3.0]), 3, 7, "refused"),
        ([4, 5, 6], 0, 1, "complete"),
    ):
        answers.append((found, status, steps, (1e-9, 2.0, 9.0)))
        assert solver(np.ones(3), 2.0).tolist() == list(found)
        assert (solver.status, solver.steps) == (word, steps)
        assert (solver.error, solver.growth) == ((1e-9, 2.0) if status == 0 else (None, None))
    good = np.ones(3)
    for answer in (
        (np.ones(4), 0, 0, good), (np.ones(3), 0, 0), None, ("abc", 0, 0, good),
        (np.ones(3), 0, 0, np.ones(2)),
    ):  # fmt: skip
        answers.append(answer)
        with pytest.raises((TypeError, ValueError)):
            solver(np.ones(3), 2.0)
    with pytest.raises(IndexError):
        solver(np.ones(3), 2.0)
    assert (solver.status, solver.steps) == ("complete", 1)


def test_attitude_is_that_of_solve() -> None:
    """By default it is computed if the scene has one, or the torque needs it."""
    turning = replace(case_scene(5), attitude=(1.0, 0.0, 0.0, 0.0))
    in_space = replace(case_scene(5), torque=TorqueLaw((1.0, 0.0, 0.0), frame="space"))
    for scene in (turning, in_space):
        omega, attitude = prepare(scene)(scene.omega, 0.5)
        found = solve(scene, 0.5)
        assert found.attitude is not None
        assert omega == pytest.approx(found.omega[0], rel=1e-9)
        assert attitude == pytest.approx(found.attitude[0], abs=1e-9)
    assert prepare(turning, attitude=False)(turning.omega, 0.5).shape == (3,)
    assert prepare(turning, "quick")(turning.omega, 0.5).shape == (3,)
    assert prepare(case_scene(5))(case_scene(5).omega, 0.5).shape == (3,)


def test_quick_call_is_inherited() -> None:
    """Classes inherit the vectorcall; without it a keyword costs as much as an easy solve."""
    assert Solver.__flags__ & 1 << 11
    assert type("Other", (Solver,), {}).__flags__ & 1 << 11
    assert not type("Own", (Solver,), {"__call__": lambda self: 1}).__flags__ & 1 << 11


def test_closed_forms_are_recognised() -> None:
    for coefficients, torque, form in (
        ((0.0, 0.0, 0.0), 1.0, "sphere"),
        ((0.5, -0.5, 0.0), 0.0, "symmetric"),
        ((0.5, 0.5, 0.0), 0.0, None),
        ((0.5, -0.4, 0.1), 0.0, "elliptic"),
        ((0.5, -0.4, 0.1), 1.0, None),
        ((1.0, 1.0, 1.0), 0.0, None),
        ((-1.0, -1.0, -1.0), 0.0, None),
    ):
        law = TorqueLaw((torque, 0.0, 0.0))
        scene = Scene("", (1.0, 2.0, 3.0), coefficients=coefficients, torque=law)
        assert closed_form(scene) == form


def test_plan_says_what_is_skipped_and_why(result_of: ResultOf) -> None:
    assert {"integration", "torque", "C w1 w2", "velocity"} <= plan(case_scene(2)).skipped
    assert {"torque of time", "sines", "cosines"} <= plan(case_scene(5)).skipped
    assert not {"torque of time", "sines", "torque"} & plan(case_scene(7)).skipped
    assert "velocity" not in plan(case_scene(7), velocity=True).skipped
    assert "dense output" not in plan(case_scene(7), rows=True).skipped
    assert "dense output" in plan(case_scene(3), rows=True).skipped
    assert plan(case_scene(7), tolerance=1.1e-9).method == "quick or taylor"
    assert plan(case_scene(7), tolerance=0.9e-9).method == "taylor"
    assert plan(case_scene(5), tolerance=1e-3).method == "taylor"
    assert plan(case_scene(7), tolerance=1e-6, rows=True).method == "taylor"
    for form in ("table", "json", "csv", "markdown"):
        assert "torque of time" in result_of(["plan", "--case", "7", "--format", form]).out


def test_plan_says_that_a_torque_depends_on_the_state() -> None:
    chosen = plan(replace(case_scene(2), torque=damping(0.1)))
    told = {each.part: (each.kept, each.why) for each in chosen.decisions}
    assert told["integration"] == (True, "its torque depends on the state")
    kept, why = told["torque"]
    assert kept
    assert why.startswith("depends on the state: ")
    assert "torque" not in chosen.skipped


@pytest.mark.parametrize("case", [1, 3, 7])
def test_everyone_does_what_the_plan_says(case: int) -> None:
    """Both entry points follow another choice."""
    scene = case_scene(case)
    with patch.object(planning, "chosen_method", lambda *given, **named: ("taylor", None)):
        found, solver = solve(scene, [1.0], tolerance=1e-6), prepare(scene, tolerance=1e-6)
    solver(_omega(scene), 1.0)
    assert found.steps == solve(scene, [1.0], "taylor", 1e-6).steps > 0
    assert (solver.plan.method, solver.steps > 0) == ("taylor", True)
    # A property that no one reads is not computed.
    assert "decisions" not in vars(solver.plan)


def test_scipy_and_the_reference_are_not_even_imported() -> None:
    assert {"SciPy", "reference"} <= plan(PUSHED).skipped
    code = (
        "import sys; from pyharness import case_scene, prepare, solve; scene = case_scene(5); "
        "solve(scene, [1.0]); prepare(scene)(scene.omega, 1.0); "
        "print({'scipy', 'mpmath', 'pyharness.truth.reference'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


_SHAKEN = replace(PUSHED, torque=TorqueLaw(sines=[((0.1, 0.2, -0.1), 200.0)]))
_LONE = Scene("", PUSHED.omega, coefficients=(0.0, 0.0, 1.0), torque=_SHAKEN.torque)
# A perturbation of the middle axis whose square underflows.
_FAINT = Scene("", (1e-200, 1.0, 0.0), moments=(6.0, 5.0, 2.0))


@pytest.mark.parametrize(("scene", "asked", "tolerance", "planned", "found"), [
    (PUSHED, "auto", 1e-3, "taylor", "taylor"),
    (PUSHED, "quick", 1e-3, "quick", "quick"),
    (_SHAKEN, "auto", 1e-3, RK4_OR_TAYLOR, "quick"),
    # For eight digits the series takes fewer operations; with a single product `quick` refuses.
    (case_scene(7), "auto", 1e-8, RK4_OR_TAYLOR, "taylor"),
    (_LONE, "auto", 1e-3, RK4_OR_TAYLOR, "taylor"),
    (case_scene(3), "auto", 1e-6, "closed-form", "closed-form"),
    (_FAINT, "auto", 1e-6, "closed-form", "taylor"),
])  # fmt: skip
def test_what_the_kernel_chose_comes_back(
    scene: Scene, asked: str, tolerance: float, planned: str, found: str
) -> None:
    solver = prepare(scene, asked, tolerance)
    assert solver.method == solver.plan.method == planned
    solver(_omega(scene), 1.0)
    assert (solver.method, solver.steps > 0) == (found, found != "closed-form")


def test_wave_without_effect_is_not_packed(solver: Solver) -> None:
    """However fast the wave is, the bits are those of a scene without it."""
    idle = (((0.0, 0.0, 0.0), 1e200),)
    same = replace(PUSHED, torque=TorqueLaw(PUSHED.law.constant, sines=idle, cosines=idle))
    wanted = solver(_omega(PUSHED), 3.0)
    np.testing.assert_array_equal(prepare(same)(_omega(PUSHED), 3.0), wanted)
    for method in ("gauss-4", "dop853"):
        found, wanted = (solve(each, [1.0], method, 1e-9).omega for each in (same, PUSHED))
        np.testing.assert_array_equal(found, wanted)


def test_plan_savings_are_measured() -> None:
    saving = measured_saving("part", "where", lambda: sum(range(20000)), lambda: None)
    assert saving.with_it > saving.without > 0.0
    assert saving.ratio == saving.with_it / saving.without


def test_error_of_the_series_grows_as_the_conditioning_of_the_motion() -> None:
    """The error is a few roundings at most; `bench --growth` measures it to 1e5 s."""
    for case in (3, 4):
        for found in growth(case_scene(case), (10.0, 100.0, 1000.0)):
            assert found.error <= 8.0 * max(found.conditioning, 2.0**-53)


@pytest.mark.parametrize("attitude", [False, True])
def test_auto_solves_what_the_closed_form_refuses(attitude: bool) -> None:
    """A perturbation of the middle axis that is too faint for the closed form."""
    scene = Scene("", (1e-130, 1.0, 0.0), moments=(3.0, 2.0, 1.0))
    refused("", solve, scene, [5.0], "closed-form")
    make: Any = prepare
    solver = make(scene, "closed-form", attitude=attitude)
    assert np.isnan(np.hstack(solver(scene.omega, 5.0))).all()
    assert (solver.status, solver.error) == ("refused", None)
    solver = make(scene, tolerance=1e-12, attitude=attitude)
    found = np.hstack(solver(scene.omega, 5.0))
    assert (solver.status, solver.steps > 0) == ("complete", True)
    assert np.isfinite(found).all()
    wanted = reference(scene, [5.0]).omega[0]
    rows = [found[:3], solve(scene, [5.0], tolerance=1e-12).omega[0]]
    if not attitude:
        rows.append(solver.trajectory(scene.omega, [5.0]).omega[0])
    for row in rows:
        np.testing.assert_allclose(row, wanted, rtol=1e-11)


@pytest.mark.parametrize("moments", [(1.0, 2.0, 2.5), (2.0, 2.0, 2.0)])
@pytest.mark.parametrize("time", [math.nan, math.inf, -math.inf])
def test_a_steady_rotation_has_no_omega_at_no_finite_time(moments: Any, time: float) -> None:
    scene = Scene("steady", (0.0, 1.0, 0.0), moments=moments)
    solver = prepare(scene)
    assert np.isnan(solver(_omega(scene), time)).all()
    assert solver.status == "overflow"
    assert np.isnan(solve_many(scene, np.array([time])).omega).all()


def test_what_the_closed_form_gives_up_no_series_is_asked() -> None:
    """Only a refusal leads to the series, which would here need more steps than are allowed."""
    scene = case_scene(4)
    solver = prepare(scene)
    assert np.isnan(solver(_omega(scene), 1e18)).all()
    assert (solver.status, solver.steps) == ("gave up", 0)
