"""`compare`: its findings, the results it reports as unexpected, and the agreement of its views."""

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Comparison, Listing, case_scene
from pyharness.checks.compare import candidates
from pyharness.checks.compare import comparison as room
from pyharness.checks.compare import report as report_module
from pyharness.checks.compare.agreement import accuracy, differences, distance, ulps
from pyharness.checks.compare.comparison import compare_programs, listings_for
from pyharness.checks.compare.picture import comparison_picture
from pyharness.checks.compare.report import comparison_report, verdict
from pyharness.engine.plan.registry import SCIPY_METHODS
from pyharness.engine.plan.report import trajectory_report
from pyharness.model.attitude import product
from pyharness.model.trajectory import Trajectory, turned_to_space
from pyharness.thesis.programs import PROGRAM_REGISTRY, Program
from pyharness.truth.reference import reference
from pyharness.views.pictures import saved
from pyharness.views.render import json_text, render


def _text(found: Comparison, numerics: bool = True) -> str:
    return render(comparison_report(found, numerics), "table")


@pytest.fixture(scope="module")
def case_2() -> Comparison:
    return compare_programs(case_scene(2))


@pytest.mark.campaign
def test_all_is_as_expected_in_every_case() -> None:
    for case in range(1, 8):
        found = compare_programs(case_scene(case))
        assert (found.unexpected, found.not_judged) == ((), ())
        assert [each.ulps for each in found.programs] == [0.0] * 6
        for numerics in (False, True):
            assert max(map(len, _text(found, numerics).splitlines())) <= 100
        assert verdict(found)[0].startswith("as expected: Fortran = Python bit for bit in 6")
        if case == 6:  # the solution reaches 1e111
            files = saved(comparison_picture(found), "x.png")
            assert len(files) == 2
            assert files["x.png"].startswith(b"\x89PNG")
        assert (found.programs[0].accuracy.momentum is not None) == found.scene.torque.is_zero


def test_methods_run_only_where_they_are_shown(
    case_2: Comparison, printed: Callable[[str], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[str] = []
    candidate = candidates.method_candidate

    def recorded(name: str, *rest: Any) -> Any:
        ran.append(name)
        return candidate(name, *rest)

    monkeypatch.setattr(room, "method_candidate", recorded)
    found = compare_programs(case_scene(2), methods=False)
    assert _text(found, False) == _text(case_2, False)
    assert (found.unexpected, found.tolerance, found.is_sensitive) == (
        case_2.unexpected, case_2.tolerance, case_2.is_sensitive,
    )  # fmt: skip
    one = "compare --case 2 --program two-term --listing original"
    printed(one)
    printed(f"{one} --format markdown")
    assert not ran
    for option in ("--numerics", "--format json", "--format csv"):
        printed(f"{one} {option}")
        assert ran == [*SCIPY_METHODS]
        ran.clear()


def test_table_says_which_variable_stopped_the_run(case_2: Comparison) -> None:
    for numerics in (False, True):
        lines = _text(case_2, numerics).splitlines()
        row = next(line for line in lines if line.startswith("runge-kutta") and "original" in line)
        assert row.split()[2:5] == ["25", "V2", "3305>500"]
        early = [line for line in lines if "ended at step" in line]
        assert [line.partition(":")[0] for line in early] == [
            "runge-kutta original ended at step 25 of 100"
        ]


def test_numerics_come_only_when_asked_for(case_2: Comparison) -> None:
    numerics = ("energy", "ulp", "us/step", "error amplification", "solve_ivp ", "radau")
    brief, whole = _text(case_2, False), _text(case_2)
    for each in numerics:
        assert each in whole
        assert each not in brief.replace(report_module._MORE, "")
    assert len(brief.splitlines()) < len(whole.splitlines()) - 5
    for form in ("json", "csv"):
        assert len({render(comparison_report(case_2, each), form) for each in (False, True)}) == 1


def test_table_of_what_failed_and_of_large_quotients_fits() -> None:
    found = compare_programs(replace(case_scene(3), step_size=1e-5, steps=3))
    why = "Radau exceeded its work limit at t = 49.568 s after 250000 right-hand sides; take less"
    failed = replace(found.methods[-1], trajectory=None, accuracy=None, failure=why)
    text = _text(replace(found, methods=(*found.methods[:-1], failed)))
    assert "U2 2.4e5>500" in text
    assert f"failed: {failed.method}: {why}" in " ".join(text.split())
    assert max(map(len, text.splitlines())) <= 100


def test_methods_keep_to_their_tolerance_and_the_reference_to_its_error(case_2: Comparison) -> None:
    assert [each.method for each in case_2.methods] == list(SCIPY_METHODS)
    for each in case_2.methods:
        assert each.accuracy is not None
        assert 0.0 < max(each.accuracy.omega) <= 1e-8 * 10.0
    assert case_2.reference.error < 3e-15


def test_listings_for_the_options() -> None:
    def labels(**options: object) -> list[tuple[str, str]]:
        rows = listings_for(**options)  # type: ignore[arg-type]
        return [(each.program, each.label) for each in rows]

    assert len(labels()) == 6
    assert labels(base="corrected") == [(p, "corrected") for p in PROGRAM_REGISTRY]
    wanted = [("four-term", label) for label in ("original", "custom", "corrected")]
    assert labels(programs=["four-term"], fix=["dt-accumulates"]) == wanted
    # A defect is selected only for the programs that have it.
    programs = [program for program, label in labels(fix=["stage-base"]) if label == "custom"]
    assert programs == ["runge-kutta"]
    keeping = listings_for(["runge-kutta"], keep=["stage-base"])
    assert [each.defects for each in keeping if each.label == "custom"] == [{"stage-base"}]
    (chosen,) = (each for each in listings_for(readings=["c1-for-c"]) if each.readings)
    assert (chosen.program, chosen.label) == ("two-term", "original")


def _trajectory(omega: np.ndarray) -> Trajectory:
    time = np.arange(1.0, len(omega) + 1.0)
    return Trajectory(time, time, omega, None, len(omega), 0)


def test_ulps_count_representable_values() -> None:
    for x, y, between in (
        (1.0, 1.0, 0.0), (1.0, np.nextafter(1.0, 2.0), 1.0), (-1.0, np.nextafter(-1.0, 0.0), 1.0),
        (5e-324, -5e-324, 3.0), (0.0, -0.0, 1.0), (np.nan, np.nan, 0.0), (np.nan, 1.0, math.inf),
        (np.inf, np.finfo(float).max, 1.0), (-1.0, 1.0, 2.0 * 0x3FF0000000000000 + 1),
    ):  # fmt: skip
        assert ulps(np.array([x]), np.array([y])) == between


def test_accuracy_against_known_numbers() -> None:
    scene = replace(case_scene(4), steps=2)
    truth = reference(scene, scene.times())
    off = np.array([[1e-3, 0.0, 0.0], [0.0, -2e-3, 1e-4]])
    found = accuracy(scene, _trajectory(truth.omega + off), truth)
    np.testing.assert_allclose(found.omega, (1e-3, 2e-3, 1e-4), rtol=1e-9)
    np.testing.assert_allclose(found.error, [1e-3, 2e-3], rtol=1e-9)
    stretched = accuracy(scene, _trajectory(truth.omega * 1.01), truth)
    assert stretched.energy == pytest.approx(0.0201)
    assert stretched.momentum == pytest.approx(0.0201)
    # Only omega3 differs, so the drifts are its fractions of the sums of I w**2 and I**2 w**2.
    along = accuracy(scene, _trajectory(truth.omega * [1.0, 1.0, 1.01]), truth)
    moments = np.array(scene.moments)
    for drift, weights in ((along.energy, moments), (along.momentum, moments**2)):
        parts = weights * np.square(truth.omega[-1])
        assert drift == pytest.approx(0.0201 * parts[2] / parts.sum(), rel=1e-3)


@pytest.mark.parametrize("size", [1e-170, 1e170])
def test_drifts_need_no_squares_of_the_given_size(size: float) -> None:
    scene = replace(case_scene(4), steps=1, attitude=(1.0, 0.0, 0.0, 0.0))
    omega, moments = size * np.array(scene.omega), size * np.array(scene.moments)
    small = replace(scene, omega=tuple(omega), moments=tuple(moments))
    run = replace(_trajectory(omega[None, :] * 1.01), attitude=np.array([scene.attitude]))
    found = accuracy(small, run, replace(reference(scene, scene.times()), omega=run.omega))
    assert (found.energy, found.momentum) == pytest.approx((0.0201, 0.0201))
    assert found.momentum_in_space == pytest.approx(0.01)


def test_error_of_attitudes_is_an_angle() -> None:
    scene = replace(case_scene(4), steps=2, attitude=(0.5, -0.1, 0.7, 0.5))
    truth: Any = reference(scene, scene.times())
    # A rotation about an axis of space, and a change of the quaternion's sign, which has no effect.
    turn = (math.cos(5e-4), 0.0, math.sin(5e-4), 0.0)
    turned = np.array([truth.attitude[0], [-x for x in product(turn, tuple(truth.attitude[1]))]])
    found: Any = accuracy(scene, replace(_trajectory(truth.omega), attitude=turned), truth)
    assert found.turned == pytest.approx([0.0, 1e-3], abs=1e-15, rel=1e-9)
    assert found.angle == found.turned[1]
    # The angular momentum rotates with the body, in proportion to its component across the axis.
    start = turned_to_space(np.array([scene.attitude]), np.array([[0.0, 30.0, 200.0]]))[0]
    across = math.hypot(start[0], start[2]) / float(np.linalg.norm(start))
    assert found.momentum_in_space == pytest.approx(1e-3 * across, rel=1e-6)
    pushed = accuracy(case_scene(5), _trajectory(truth.omega), truth)
    assert pushed.angle is pushed.momentum_in_space is None


@pytest.mark.campaign
def test_compare_shows_attitudes_where_they_are_asked_for() -> None:
    found = compare_programs(case_scene(4), attitude=True)
    angles = {
        (each.listing.program, each.listing.label): each.accuracy.angle for each in found.programs
    }
    assert 1e-5 < angles["two-term", "corrected"] < 1e-3  # type: ignore[operator]
    assert 1e-9 < angles["runge-kutta", "corrected"] < 1e-7  # type: ignore[operator]
    for method in found.methods:
        assert method.accuracy is not None
        assert 0.0 < method.accuracy.angle < found.tolerance  # type: ignore[operator]
        assert 0.0 < method.accuracy.momentum_in_space < found.tolerance  # type: ignore[operator]
    assert max(map(len, _text(found).splitlines())) <= 100
    record = json.loads(render(comparison_report(found), "json"))
    rows = list(csv.DictReader(io.StringIO(render(comparison_report(found), "csv"))))
    for each, row in zip([*record["programs"], *record["methods"]], rows, strict=True):
        assert float(row["angle_error"]) == each["angle_error"]
        assert float(row["momentum_in_space"]) == each["momentum_in_space"]
    assert record["reference"]["angle_error"] < 1e-15
    picture = comparison_picture(found)
    assert len(picture.figure.axes) == 15
    assert picture.numbers.columns[-1].head == "angle_error"


def test_compare_asks_for_no_attitude_by_itself(case_2: Comparison) -> None:
    assert case_2.reference.attitude is None
    turned = compare_programs(replace(case_scene(2), attitude=(0.0, 1.0, 0.0, 0.0)))
    assert turned.scene.attitude is None
    record = json.loads(render(comparison_report(case_2), "json"))
    assert {each["angle_error"] for each in record["programs"]} == {None}
    assert "angle" not in _text(case_2)


@pytest.mark.campaign
def test_a_difference_and_a_missed_order_are_unexpected(monkeypatch: pytest.MonkeyPatch) -> None:
    real = Program.run

    def off_by_one_bit(self: Program, *given: Any, **named: Any) -> Trajectory:
        run = real(self, *given, **named)
        if "python" not in given:
            return run
        return replace(run, omega=np.nextafter(run.omega, 0.0))

    def wrong(self: Program, *given: Any, **named: Any) -> Trajectory:
        run = real(self, *given, **named)
        return replace(run, omega=run.omega * 1.0001)

    for planted, words in (
        (off_by_one_bit, "Fortran and twin differ in omega"),
        (wrong, "does not converge to the reference as the step is halved: order"),
    ):
        monkeypatch.setattr(Program, "run", planted)
        found = compare_programs(case_scene(3), [Listing.corrected("runge-kutta")])
        assert len(found.unexpected) == 1
        assert found.unexpected[0].startswith(f"runge-kutta corrected: {words}")
        assert found.unexpected[0].endswith(", due 4") == (planted is wrong)
        assert found.programs[0].ulps == (planted is off_by_one_bit)
        assert "UNEXPECTED" in _text(found)


def test_views_carry_the_same_numbers(case_2: Comparison) -> None:
    report = comparison_report(case_2)
    table = list(csv.DictReader(io.StringIO(render(report, "csv"))))
    record = json.loads(render(report, "json"))
    assert len(table) == len(record["programs"]) + len(record["methods"]) == 10
    for row, entry, each in zip(table, record["programs"], case_2.programs, strict=False):
        assert row["method"] == entry["program"] == each.listing.program
        assert float(row["error_w1"]) == entry["error"][0] == each.accuracy.omega[0]
        assert int(row["steps"]) == entry["steps"] == each.trajectory.steps
    assert table[4]["stop_variable"] == record["programs"][4]["stop"]["variable"] == "V2"
    assert render(report, "markdown").count("\n| two-term") == 2


def test_number_that_is_not_finite_is_null() -> None:
    text = json_text({"a": [1.0, math.inf, {"b": math.nan}], "c": (2.5,), "d": "x"})
    assert json.loads(text) == {"a": [1.0, None, {"b": None}], "c": [2.5], "d": "x"}


@pytest.mark.campaign
def test_picture_and_its_numbers(case_2: Comparison) -> None:
    files = saved(comparison_picture(case_2), "x.svg", "x.pdf")
    for name, start in (("x.svg", b"<?xml"), ("x.pdf", b"%PDF")):
        assert files[name].startswith(start)
    rows = list(csv.DictReader(io.StringIO(files["x.csv"].decode())))
    # reference, five complete runs and one that stopped at step 25
    assert len(rows) == 100 + 5 * 100 + 25
    first = next(row for row in rows if row["method"] == "four-term")
    assert float(first["omega1"]) == case_2.programs[2].trajectory.omega[0, 0]


def test_a_reading_that_is_not_adopted_is_not_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reading has no expected order, and its time per step counts the steps that were run."""
    monkeypatch.setattr(room, "timed", lambda *_: [1.0])
    listings = [Listing("two-term", ["c1-for-c"]), Listing.original("runge-kutta")]
    reading, before = compare_programs(case_scene(2), listings).programs
    assert reading.listing.label == "custom"
    assert reading.order is None
    assert reading.seconds_per_step == 1.0 / 100.0
    assert (before.trajectory.steps, before.seconds_per_step) == (25, 1.0 / 25.0)


def test_bits_of_all_that_a_program_returns_are_held() -> None:
    run: Any = PROGRAM_REGISTRY["runge-kutta"].run(case_scene(2), Listing.original("runge-kutta"))
    assert differences(run, run) == []
    assert distance(run, run) == 0.0
    velocity = run.velocity.copy()
    velocity[3, 1] = np.nextafter(velocity[3, 1], math.inf)
    stop = replace(run.stop, quotient=np.nextafter(run.stop.quotient, math.inf))
    for changed, name, ulp in (
        (replace(run, velocity=velocity), "velocity", 1.0),
        (replace(run, stop=stop), "stop", 0.0),
        (replace(run, recorded_time=np.nextafter(run.recorded_time, 9.0)), "TIME", 1.0),
        (replace(run, time=np.nextafter(run.time, 9.0)), "time", 0.0),
    ):
        assert differences(run, changed) == [name]
        assert distance(run, changed) == ulp
    assert distance(_trajectory(np.ones((3, 3))), _trajectory(np.ones((2, 3)))) == math.inf
    printed: Any = PROGRAM_REGISTRY["two-term"].run(case_scene(2), Listing.corrected("two-term"))
    assert differences(printed, replace(printed, ier=printed.ier + 129)) == ["IER"]


def test_record_of_a_run_has_the_time_that_the_program_recorded() -> None:
    listing = Listing.original("two-term")
    run = PROGRAM_REGISTRY["two-term"].run(case_scene(5), listing)
    found = trajectory_report(case_scene(5), "two-term", listing, "", run).record()["trajectory"]
    assert found["recorded_time"] == run.recorded_time.tolist() != run.time.tolist()
