"""The benchmark: known times and errors give the expected table; run times are not tested."""

import csv
import itertools
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, case_scene
from pyharness.bench import measure as bench
from pyharness.bench.contenders import Maker, SceneContender, list_own_contenders
from pyharness.bench.measure import (
    Finding,
    Refusal,
    Row,
    Workload,
    ladder,
    measure,
    relative_error,
    workloads,
)
from pyharness.bench.peers import RK4, compiled_function, peers, steps_source
from pyharness.bench.pictures import draw_slopes
from pyharness.bench.report import bench_report, ratio
from pyharness.bench.scores import Score, groups, means, scores, yardstick
from pyharness.checks.compare.candidates import End, Ready, not_finite
from pyharness.cli.main import main
from pyharness.cli.verbs.bench import chosen
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference
from pyharness.views.render import render
from tests.conftest import Capture, Patch

SHORT = Workload("5", case_scene(5), 3.0)
OTHER = Workload("6", case_scene(6), 3.0)


def _row(load: Workload, method: str, seconds: float | None, error: float | None) -> Row:
    note = "" if error is not None else "overflow"
    return Row(load, method, "tolerance", 1e-6, seconds, error, 7, note)


def _finding(rows: list[Row], *refused: Refusal) -> Finding:
    loads = list(dict.fromkeys(row.workload for row in rows))
    doubt = {load.label: 1e-16 for load in loads}
    return Finding(loads, rows, list(refused), {(5, "heyoka"): 0.5}, doubt)


# Made-up times (microseconds) and errors.
ROWS = [
    *(
        _row(SHORT, method, seconds, error)
        for method, seconds, error in (
            ("auto", 1e-6, 5e-4), ("auto", 2e-6, 1e-6), ("auto", 4e-6, 2e-13),
            ("auto", 9e-6, 1e-13), ("slow", None, None), ("slow", 1e-2, 1.1e-6),
            ("heyoka", 4e-6, 1e-7), ("heyoka", 6e-6, 3e-16),
        )
    ),
    _row(OTHER, "auto", 1e-6, 1e-13),
    _row(OTHER, "slow", 1e-2, 1e-2),
    _row(OTHER, "heyoka", 8e-6, 1e-13),
]  # fmt: skip
KNOWN = _finding(
    ROWS, Refusal(SHORT, "slow", 1e-15, "no tolerance below 2.2e-14"),
    Refusal(SHORT, "slow", 1e-15, "refused"), Refusal(OTHER, "slow", None, "refused"),
)  # fmt: skip


def test_time_to_an_error_is_that_of_the_fastest_setting_that_reaches_it() -> None:
    first, auto, slow = scores(KNOWN, SHORT)
    assert first == Score("heyoka", (4e-6, 4e-6, 6e-6, 6e-6), 3e-16, (1.0, 1.0, 1.0, 1.0))
    assert auto.seconds == (1e-6, 2e-6, 4e-6, 4e-6)
    assert auto.ratios == pytest.approx((4.0, 2.0, 1.5, 1.5))
    assert (slow.seconds, slow.best) == ((1e-2, None, None, None), 1.1e-6)
    assert slow.ratios[0] == pytest.approx(4e-4)


def test_means_are_geometric_and_need_every_case_of_the_group() -> None:
    (name, loads), *rest = groups(KNOWN).items()
    assert (name, rest) == ("torque, T = 3", [])
    found = means(KNOWN, loads)
    assert found["auto"] == pytest.approx([math.sqrt(r * 8.0) for r in (4.0, 2.0, 1.5, 1.5)])
    assert found["slow"] == [None, None, None, None]


def test_yardstick_is_heyoka_then_solve_ivp_then_whoever_is_there() -> None:
    others = [row for row in ROWS if row.method != "heyoka"]
    dop853 = _row(SHORT, "solve_ivp-dop853", 1.0, 0.1)
    for rows, name in ((ROWS, "heyoka"), ([*others, dop853], dop853.method), (others, "auto")):
        assert yardstick(_finding(rows)) == name
    assert yardstick(_finding([])) is None


def test_groups_part_torque_from_none_and_short_from_long() -> None:
    found = Finding(workloads(), [], [], {}, {})
    labels = {name: [load.label for load in loads] for name, loads in groups(found).items()}
    assert labels == {
        "torque, T = 3": ["5", "6", "7"],
        "torque-free, T = 3": ["2", "3", "4"],
        "T = 100": ["3L", "4L"],
    }
    assert [load.label for load in workloads(5)] == ["5"]
    assert [load.horizon for load in workloads(3)] == [3.0, 100.0]
    assert [load.horizon for load in workloads(3, 7.5)] == [7.5]


def test_table_shows_ratios_refusals_and_fits() -> None:
    text = render(bench_report(KNOWN, [], ""), "table")
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    at = next(i for i, line in enumerate(lines) if line.startswith("us per solve"))
    assert (
        " ".join(lines[at + 1].split()) == "heyoka 4.00 1.00 4.00 1.00 6.00 1.00 6.00 1.00 3.0e-16"
    )
    assert " ".join(lines[at + 3].split()) == "slow 10000 0.00040 - - - - - - 1.1e-6"
    assert "slow: no tolerance below 2.2e-14 (case 5 at 1e-15)" in lines
    assert "slow: overflow (case 5 at 1e-06)" in lines
    assert "slow: refused (case 5 at 1e-15, case 6)" in lines
    assert "heyoka 0.50" in text


def test_markdown_page_tells_versions_and_the_command() -> None:
    text = render(bench_report(KNOWN, ["numpy"], "pyharness bench"), "markdown")
    for words in ("`pyharness bench`", "| numpy | ", "| auto | 1.00 | 4.00 | 2.00 | 2.00 |"):
        assert words in text


def test_record_is_as_contracted_and_csv_has_every_row() -> None:
    report = bench_report(KNOWN, [], "")
    record = json.loads(render(report, "json"))
    contract = ["case", "horizon", "method", "setting", "seconds", "error", "evaluations"]
    assert record["schema"] == 1
    assert list(record["rows"][4].values()) == [5, 3.0, "slow", 1e-6, None, None, 7,
                                                "tolerance", "overflow"]  # fmt: skip
    assert list(record["rows"][4]) == [*contract, "kind", "note"]
    assert record["refused"][0] == {
        "case": 5, "horizon": 3.0, "method": "slow", "setting": 1e-15,
        "reason": "no tolerance below 2.2e-14",
    }  # fmt: skip
    assert record["compile_seconds"] == [{"case": 5, "method": "heyoka", "seconds": 0.5}]
    head, *rows = csv.reader(render(report, "csv").splitlines())
    assert head[:3] == contract[:3]
    assert len(rows) == len(ROWS)


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "-"), (1.0, "1.00"), (123.4, "123"), (12.34, "12.3"), (0.01234, "0.0123"),
     (9.999, "10.0"), (0.000012, "0.00001")],
)  # fmt: skip
def test_ratio_has_three_digits_in_seven_characters(value: float | None, text: str) -> None:
    assert ratio(value) == text


def test_error_is_relative_to_the_largest_component() -> None:
    truth = reference(case_scene(3), [3.0])
    omega = truth.omega[0].copy()
    # Rounding the truth to double precision has an error of at most half a unit in the last place
    # of its largest component.
    assert 0.0 < (relative_error(omega, truth) or 0.0) <= 2.0**-53
    assert relative_error(omega, replace(truth, remainder=None)) == 0.0
    omega[0] += 1e-5
    assert relative_error(omega, truth) == pytest.approx(1e-5 / abs(truth.omega[0]).max())
    assert relative_error(np.array([math.nan, 0.0, 0.0]), truth) is None


def test_ladder_begins_too_coarse_for_anyone_and_has_rungs_between_powers_of_two() -> None:
    by_name = {each.name: each for each in list_own_contenders()}
    assert list(ladder(by_name["gauss-8"], case_scene(7), 3.0))[:4] == [2.0, 3.0, 4.0, 6.0]
    assert list(ladder(by_name["taylor-3"], case_scene(7), 3.0))[:3] == [2.0, 4.0, 8.0]
    assert next(ladder(by_name["rk4"], case_scene(4), 100.0)) == 64.0
    assert next(ladder(by_name["auto"], case_scene(4), 3.0)) == 0.5


def _fake(answer: Callable[[float], End]) -> Callable[[Scene], Maker]:
    def make(horizon: float, setting: float) -> Ready:
        if setting < 1e-9:
            raise InputError("too fine")
        return Ready(lambda: setting, answer)

    return lambda _: make


def _refuses(scene: Scene) -> Maker:
    raise InputError("not this scene")


@pytest.fixture
def few_steps(hurried: None, monkeypatch: Patch) -> None:
    monkeypatch.setattr(bench, "_LARGEST_STEPS", 64)
    monkeypatch.setattr(bench, "_ROUNDS", 2)


@pytest.fixture(scope="module")
def right() -> Array:
    return np.array(reference(SHORT.scene, [3.0], precise=True).omega[0])


@pytest.mark.usefixtures("few_steps")
def test_measure_judges_refuses_and_goes_on(right: Array) -> None:
    def answer(setting: float) -> End:
        if setting > 1e-4:
            return not_finite("stopped")
        return End(right * [1.0, 1.0, 1.0 + setting], evaluations=11)

    told: list[str] = []

    def progress(done: int, total: int, what: str) -> None:
        assert (done, total) == (0, 1)
        told.append(what)

    contenders = [
        SceneContender("exact", "tolerance", _fake(answer), (1e-3, 1e-6, 1e-12)),
        SceneContender("picky", "none", _refuses, (0.0,)),
    ]
    found = measure([SHORT], contenders, progress)
    stopped, good = found.rows
    assert stopped == Row(SHORT, "exact", "tolerance", 1e-3, None, None, None, "stopped")
    assert good.error == pytest.approx(1e-6, rel=1e-3)
    assert good.seconds is not None
    assert good.evaluations == 11
    assert found.refused == [
        Refusal(SHORT, "exact", 1e-12, "too fine"),
        Refusal(SHORT, "picky", None, "not this scene"),
    ]
    assert found.doubt["5"] < 1e-15
    assert "case 5: exact" in told


@pytest.mark.campaign
@pytest.mark.usefixtures("few_steps")
def test_every_contender_of_ours_meets_its_order_or_tolerance_and_counts() -> None:
    """Check every contender on Case 3, which has a closed form and suits every method."""
    others = [each for each in peers() if each.package == "scipy"][:2]
    found = measure([Workload("3", case_scene(3), 3.0)], list_own_contenders() + others)
    good = {(row.method, row.setting): row for row in found.rows if row.error is not None}
    assert {name for name, _ in good} >= {each.name for each in list_own_contenders()} - {
        "runge-kutta-original"
    }
    for (name, setting), row in good.items():
        if name in ("auto", "taylor", "closed-form"):
            assert (row.error or 0.0) <= max(setting or 0.0, 5e-15), row
        elif name in ("rk4", "runge-kutta-corrected"):
            assert row.evaluations == 4 * (setting or 0.0)
        elif name in [each.name for each in others]:
            assert (row.evaluations or 0) > 10
    coarse, fine = (good["gauss-2", steps].error or 0.0 for steps in (32.0, 64.0))
    assert coarse / fine == pytest.approx(16.0, rel=0.2)
    assert any("100 eps" in each.reason for each in found.refused)


def test_slow_contenders_are_left_out_and_it_is_said(right: Array, monkeypatch: Patch) -> None:
    clock = itertools.count(0.0)
    monkeypatch.setattr(bench, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(bench, "_ROUNDS", 1)
    slow = SceneContender("slow", "tolerance", _fake(lambda _: End(right)), (1e-3, 1e-4))
    found = measure([SHORT], [slow])
    assert [row.setting for row in found.rows] == [1e-3]
    why = "and finer: left out, a call would take about 1 s"
    assert found.refused == [Refusal(SHORT, "slow", 1e-4, why)]


def test_a_call_that_never_ends_is_ended(right: Array, monkeypatch: Patch) -> None:
    monkeypatch.setattr(bench, "_LONGEST_FIRST", 0.05)

    def answer(setting: float) -> End:
        while setting > 1e-4:
            pass
        return End(right)

    found = measure([SHORT], [SceneContender("endless", "tolerance", _fake(answer), (1e-3, 1e-5))])
    assert [row.setting for row in found.rows] == [1e-5]
    assert found.refused == [Refusal(SHORT, "endless", 1e-3, "RuntimeError: ended after 0.05 s")]


LAWS = [case_scene(n) for n in range(1, 8)]
LAWS.append(
    Scene(
        "every term", (0.3, -0.2, 0.5), coefficients=(0.5, -0.7, 0.2),
        torque=TorqueLaw((0.1, 0.0, 0.2), (0.0, 0.3, 0.0), (((0.1, 0.2, 0.0), 2.0),),
                         (((0.0, 0.3, 0.1), 3.0),)),
    )
)  # fmt: skip


@pytest.mark.parametrize("scene", LAWS, ids=lambda scene: scene.name)
def test_source_written_for_numba_is_runge_kutta_of_the_scene(scene: Scene) -> None:
    from pyharness.engine.prepared.solver import prepare

    function = compiled_function(steps_source(scene, RK4))
    omega0, omega = np.array(scene.omega), np.empty(3)
    function(omega0, 1.0, 100, omega)
    assert omega == pytest.approx(prepare(scene, "rk4")(omega0, 1.0), rel=1e-11, abs=1e-11)


@pytest.mark.external
@pytest.mark.parametrize("name", ["heyoka", "numba-dop8"])
@pytest.mark.filterwarnings("ignore")
def test_peer_solves_every_law(name: str) -> None:
    peer = next(each for each in peers() if each.name == name)
    if not peer.is_installed:
        pytest.skip(f"{peer.package} is not installed")
    for scene in (LAWS[4], LAWS[-1]):
        ready = peer.prepare(scene)(2.0, 1000.0 if peer.setting == "steps" else 1e-12)
        for _ in range(2):
            error: Any = relative_error(ready.read(ready.run()).omega, reference(scene, [2.0]))
            assert error < 1e-10


ONLY = ["bench", "--case", "4", "--method", "auto,rk4", "--peers", "none"]


@pytest.mark.campaign
@pytest.mark.usefixtures("few_steps")
def test_verb_writes_json_csv_and_picture(tmp_path: Path, capsys: Capture) -> None:
    assert main([*ONLY, "--horizon", "1", "--format", "json"]) == 0
    captured = capsys.readouterr()
    record: dict[str, Any] = json.loads(captured.out, parse_constant=pytest.fail)
    assert captured.err == ""
    assert {(each["method"], each["horizon"]) for each in record["rows"]} == {
        ("auto", 1.0),
        ("rk4", 1.0),
    }
    assert record["machine"]["cores"]
    picture = tmp_path / "bench.svg"
    assert main([*ONLY, "--horizon", "3", "--plot", str(picture), "--format", "csv"]) == 0
    assert b"<svg" in picture.read_bytes()
    shown = capsys.readouterr().out.splitlines()
    assert shown == (tmp_path / "bench.csv").read_text().splitlines()
    assert len(shown) > 10


def test_missing_peer_is_said(monkeypatch: Patch, capsys: Capture) -> None:
    room = "pyharness.cli.verbs.bench"
    few = [each for each in peers() if each.name in ("heyoka", "odeint")]
    there = property(lambda contender: contender.package != "heyoka")
    monkeypatch.setattr(SceneContender, "is_installed", there)
    monkeypatch.setattr(f"{room}.peers", lambda: few)
    monkeypatch.setattr(bench, "_BUDGET", dict.fromkeys(("tolerance", "steps", "none"), 0.0))
    assert main(["bench", "--peers", "heyoka"]) == 2
    assert "heyoka" in capsys.readouterr().err
    assert main(["bench", "--case", "4", "--horizon", "1", "--method", "closed-form"]) == 0
    assert "heyoka: not installed" in capsys.readouterr().out


def test_a_package_stands_for_its_contenders() -> None:
    names = [each.name for each in chosen(peers(), "numba,odeint", "peer")]
    assert names == ["numba-rk4", "numba-dop8", "odeint"]


@pytest.mark.parametrize("order", [2, 4, 8])
def test_slopes_stand_where_no_curve_does(order: int) -> None:
    axes = pytest.importorskip("matplotlib.figure").Figure().subplots()
    count = np.geomspace(50.0, 1e6, 500)
    error = 0.5 * (count / 43.0) ** -float(order)
    axes.loglog(count[error > 1e-15], error[error > 1e-15])
    axes.set_xlim(20.0, 2e6)
    axes.set_ylim(1e-17, 1.0)
    draw_slopes(axes)
    axes.figure.draw_without_rendering()
    curve = axes.transData.transform(axes.lines[0].get_xydata())
    for label in axes.texts:
        box = label.get_window_extent()
        assert box.x1 <= axes.bbox.x1
        assert not any(box.contains(x, y) for x, y in curve), label.get_text()
