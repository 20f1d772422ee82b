"""Prepared solvers, `solve` and the plan: right, checked once, cheap to call, bits the same."""

import doctest
import threading

import numpy as np
import pytest

import pyharness.solver as room
from pyharness import InputError, Scene, TorqueLaw, case_scene, prepare, solve
from pyharness.cli import main
from pyharness.plan import closed_form, plan
from pyharness.reference import reference
from pyharness.scene import Triple
from pyharness.solver import PREPARED


def _omega(scene: Scene) -> np.ndarray:
    return np.array(scene.omega)


@pytest.mark.parametrize("case", range(1, 8))
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-12])
def test_auto_meets_the_tolerance(case: int, tolerance: float) -> None:
    scene = case_scene(case)
    solver = prepare(scene, tolerance=tolerance)
    for t_end in (0.3, 3.0, -1.0):
        truth = reference(scene, [t_end])
        scale = max(np.abs(truth.omega).max(), max(map(abs, scene.omega)))
        error = np.abs(solver(_omega(scene), t_end) - truth.omega[0]).max()
        assert solver.status == "complete"
        assert error <= tolerance * scale + truth.error


@pytest.mark.parametrize("method", [name for name in PREPARED if name != "auto"])
def test_every_method_gives_what_its_rows_give(method: str) -> None:
    """The packed call against the entry that takes everything apart."""
    scene = Scene(
        "", (0.3, -1.0, 2.0), moments=(40.0, 30.0, 20.0), step_size=0.125,
        torque=TorqueLaw(
            (1.0, 2.0, 3.0), (0.5, 0.0, -1.0),
            (((1.0, 2.0, 3.0), 3.0), ((0.0, 0.0, 0.0), 9.0)), (((4.0, 0.0, 1.0), 2.0),),
        ),
    )  # fmt: skip
    if method == "closed-form":
        scene = Scene("", (0.3, -1.0, 2.0), moments=(40.0, 30.0, 20.0))
    solver = prepare(scene, method, tolerance=1e-10)
    one = solver(_omega(scene), 2.0).copy()
    truth = reference(scene, [2.0]).omega[0]
    bound = {"improved-euler": 2e-2, "taylor-3": 2e-2, "rk4": 1e-4, "gauss-1": 2e-2}
    assert np.abs(one - truth).max() <= bound.get(method, 1e-4 if "gauss" in method else 1e-9)
    assert np.abs(one - truth).max() > 0.0 or method == "closed-form"


def test_sphere_is_a_closed_form_under_any_torque() -> None:
    law = TorqueLaw((1.0, -2.0, 3.0), (0.5, 0.0, -1.0), (((1.0, 2.0, 3.0), 3.0),))
    scene = Scene("", (0.3, -1.0, 2.0), moments=(2.0, 2.0, 2.0), torque=law)
    solver = prepare(scene)
    assert (solver.plan.method, solver.plan.closed_form) == ("closed-form", "sphere")
    np.testing.assert_allclose(solver(_omega(scene), 2.0), reference(scene, [2.0]).omega[0], 1e-15)


def test_another_start_than_the_scenes() -> None:
    for case in (4, 5):
        scene = case_scene(case)
        start: Triple = (3.0, -2.0, 0.5)
        other = Scene("", start, moments=scene.moments, torque=scene.torque)
        solver = prepare(scene, tolerance=1e-12)
        truth = reference(other, [1.0, 2.0])
        np.testing.assert_allclose(solver(np.array(start), 2.0), truth.omega[1], rtol=1e-11)
        rows = solver.trajectory(start, [1.0, 2.0])
        np.testing.assert_allclose(rows.omega, truth.omega, rtol=1e-11)


def test_result_is_one_array_that_the_next_call_overwrites() -> None:
    scene = case_scene(3)
    solver = prepare(scene)
    first = solver(_omega(scene), 1.0)
    kept = first.copy()
    second = solver(_omega(scene), 2.0)
    assert second is first
    assert not np.array_equal(first, kept)


def test_failure_is_nan_with_a_status() -> None:
    runaway = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    solver = prepare(runaway, tolerance=1e-9)
    assert solver.plan.method == "taylor"
    assert np.isnan(solver(_omega(runaway), 2.0)).all()
    assert solver.status == "overflow"
    assert solver(_omega(runaway), 0.5) == pytest.approx(2.0)
    assert solver.status == "complete"


def test_threads_with_a_solver_each_give_the_same_bits() -> None:
    scene = case_scene(7)
    wanted = prepare(scene, tolerance=1e-12)(_omega(scene), 3.0).tolist()
    found: list[list[float]] = []

    def work() -> None:
        solver = prepare(scene, tolerance=1e-12)
        found.extend(solver(_omega(scene), 3.0).tolist() for _ in range(50))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [wanted] * 200


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"method": "tailor"}, "did you mean 'taylor'"),
        ({"method": "dop853"}, "unknown method 'dop853'"),
        ({"tolerance": 0.0}, "allowed: 1e-15 to 1"),
        ({"tolerance": 1e-17}, "allowed: 1e-15 to 1"),
        ({"tolerance": 2.0}, "allowed: 1e-15 to 1"),
        ({"tolerance": float("nan")}, "allowed: 1e-15 to 1"),
        ({"method": "closed-form"}, "has torque and is no sphere"),
    ],
)
def test_preparation_checks_once(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        prepare(case_scene(5), **arguments)  # type: ignore[arg-type]
    if arguments.get("method") != "dop853":  # which `solve` knows
        with pytest.raises(ValueError, match=r"allowed|can't"):
            solve(case_scene(5), [1.0], **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("times", [[], [1.0, 1.0], [-1.0, 1.0], [float("inf")], [2.0, 1.0, 3.0]])
def test_times_are_checked(times: list[float]) -> None:
    with pytest.raises(InputError, match="times"):
        solve(case_scene(5), times)
    with pytest.raises(InputError, match="times"):
        prepare(case_scene(5)).trajectory((1.0, 2.0, 3.0), times)


def test_start_is_checked_for_rows() -> None:
    with pytest.raises(InputError, match="allowed: three"):
        prepare(case_scene(5)).trajectory((1.0, 2.0), [1.0])
    with pytest.raises(InputError, match="not finite"):
        prepare(case_scene(5)).trajectory((1.0, 2.0, float("nan")), [1.0])


def test_closed_forms_are_recognised() -> None:
    def scene(a: float, b: float, c: float, torque: float = 0.0) -> Scene:
        law = TorqueLaw((torque, 0.0, 0.0))
        return Scene("", (1.0, 2.0, 3.0), coefficients=(a, b, c), torque=law)

    assert closed_form(scene(0.0, 0.0, 0.0, 1.0)) == "sphere"
    assert closed_form(scene(0.5, -0.5, 0.0)) == "symmetric"
    assert closed_form(scene(0.5, 0.5, 0.0)) is None
    assert closed_form(scene(0.5, -0.4, 0.1)) == "elliptic"
    assert closed_form(scene(0.5, -0.4, 0.1, 1.0)) is None
    assert closed_form(scene(1.0, 1.0, 1.0)) is None


def test_plan_says_what_is_skipped_and_why(capsys: pytest.CaptureFixture[str]) -> None:
    assert {"integration", "torque", "C w1 w2", "velocity"} <= plan(case_scene(2)).skipped
    assert {"torque of time", "sines", "cosines"} <= plan(case_scene(5)).skipped
    assert not {"torque of time", "sines", "torque"} & plan(case_scene(7)).skipped
    assert "velocity" not in plan(case_scene(7), velocity=True).skipped
    assert "dense output" not in plan(case_scene(7), rows=True).skipped
    assert plan(case_scene(7), tolerance=1e-6).method == "quick or taylor"
    assert plan(case_scene(7), tolerance=1e-6, rows=True).method == "taylor"
    for form in ("table", "json", "csv", "markdown"):
        assert main(["plan", "--case", "7", "--format", form]) == 0
        out = capsys.readouterr().out
        assert "torque of time" in out
        if form == "table":
            assert max(map(len, out.splitlines())) <= 100
    assert main(["plan", "--case", "7", "--method", "tailor"]) == 2
    assert main(["plan", "--case", "7", "--method", "closed-form"]) == 2
    assert main(["plan", "--case", "7", "--tolerance", "1e-20"]) == 2


def test_wave_without_effect_is_not_packed() -> None:
    """A plan that skips the sines gives the bits of a scene that has none."""
    scene = case_scene(5)
    silent = TorqueLaw(scene.torque.constant, sines=(((0.0, 0.0, 0.0), 50.0),))
    same = Scene("", scene.omega, moments=scene.moments, torque=silent)
    one, other = prepare(scene), prepare(same)
    np.testing.assert_array_equal(one(_omega(scene), 3.0), other(_omega(scene), 3.0))


def test_examples_in_the_docstrings_run() -> None:
    result = doctest.testmod(room)
    assert result.attempted >= 5
    assert result.failed == 0


def test_plan_savings_are_measured() -> None:
    from pyharness.plan_bench import _saving

    def slow() -> int:
        return sum(range(20000))

    saving = _saving("part", "where", slow, lambda: None)
    assert saving.with_it > saving.without > 0.0
    assert saving.ratio == saving.with_it / saving.without


def test_error_of_the_series_grows_as_the_conditioning_of_the_motion() -> None:
    """A few roundings of time, no more; measured to 1e5 s by `bench --growth`."""
    from pyharness.growth import growth

    for case in (3, 4):
        for found in growth(case_scene(case), (10.0, 100.0, 1000.0)):
            assert found.error <= 8.0 * max(found.conditioning, 2.0**-53)
    with pytest.raises(InputError, match="closed form"):
        growth(case_scene(5), (1.0,))


def test_plan_and_growth_on_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--plan", "--case", "3"]) == 2
    assert main(["bench", "--growth", "--peers", "none"]) == 2
    assert main(["bench", "--plan", "--growth"]) == 2
    capsys.readouterr()


def test_auto_solves_what_the_closed_form_refuses() -> None:
    """A disturbance of the middle axis whose square is no number."""
    scene = Scene("", (1e-130, 1.0, 0.0), moments=(3.0, 2.0, 1.0))
    with pytest.raises(InputError, match="too faint"):
        solve(scene, [5.0], "closed-form")
    solver = prepare(scene, "closed-form")
    solver(_omega(scene), 5.0)
    assert solver.status == "refused"
    wanted = reference(scene, [5.0]).omega[0]
    np.testing.assert_allclose(solve(scene, [5.0]).omega[0], wanted, rtol=1e-11)
    solver = prepare(scene)
    np.testing.assert_allclose(solver(_omega(scene), 5.0), wanted, rtol=1e-11)
    assert solver.status == "complete"
    np.testing.assert_allclose(solver.trajectory(scene.omega, [5.0]).omega[0], wanted, rtol=1e-11)
    # And where both refuse, the reason is that of the closed form.
    with pytest.raises(InputError, match="the phase is beyond"):
        solve(case_scene(4), [1e18])


def test_what_the_closed_form_gives_up_no_series_is_asked() -> None:
    """It would need more steps than there may be: only what is refused is worth a series."""
    scene = case_scene(4)
    solver = prepare(scene)
    assert np.isnan(solver(_omega(scene), 1e18)).all()
    assert (solver.status, solver.steps) == ("gave up", 0)
