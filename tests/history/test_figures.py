"""Figures 6 to 12: the right files, the right curves, each as long as its program ran."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import case_scene, run_program
from pyharness.cli.main import main
from pyharness.history import figures
from pyharness.history.claims.rules import share_of_range
from pyharness.history.figures import Curve, FigureFinding, curve_numbers
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis import collocation, compiled
from pyharness.truth.reference import reference
from pyharness.views import pictures
from pyharness.views.pictures import saved
from pyharness.views.render import csv_text

Capture = pytest.CaptureFixture[str]
STEMS = ["06", "07", "08", "09", "10a", "10b", "11", "12"]
RUNGE_KUTTA = (100, 25, 24, 23)  # the steps at which it stopped
ALL = [f"figure-{stem}{part}" for part in ("", "-corrected") for stem in STEMS]


@pytest.fixture(scope="module")
def found() -> dict[str, FigureFinding]:
    return {each.plan.stem: each for each in figures.findings()}


@pytest.fixture
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw nothing, for tests of which files are written."""
    monkeypatch.setattr(figures, "figure_picture", lambda finding: finding.plan.files)
    monkeypatch.setattr(pictures, "saved", lambda names, *paths: dict.fromkeys(names, b"x"))


def _rows(finding: FigureFinding, curve: str) -> np.ndarray:
    table = curve_numbers(finding).rows
    return np.array([[row[2], *row[4:]] for row in table if row[0] == curve], dtype=float)


@pytest.mark.campaign
def test_figure_is_the_same_bytes_in_every_form_and_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, found: dict[str, FigureFinding]
) -> None:
    chosen = [plan for plan in figures.plans() if plan.stem in ("figure-06", "figure-11-corrected")]
    monkeypatch.setattr(figures, "plans", lambda: chosen)
    assert main(["figures", "--out", str(tmp_path / "new")]) == 0
    written = {path.name: path.read_bytes() for path in (tmp_path / "new").iterdir()}
    assert set(written) == {name for plan in chosen for name in plan.files}
    for plan in chosen:
        assert written[f"{plan.stem}.png"].startswith(b"\x89PNG\r\n")
        assert b"</svg>" in written[f"{plan.stem}.svg"][-20:]
        assert written[f"{plan.stem}.csv"].decode() == csv_text(curve_numbers(found[plan.stem]))
    code = (
        "import sys; from pyharness.history.figures import figure_picture, findings; "
        "from pyharness.views.pictures import saved; "
        "found = saved(figure_picture(next(findings())), 'figure-06.svg', 'figure-06.png'); "
        "sys.stdout.buffer.write(found['figure-06.svg'] + found['figure-06.png'])"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "77", "SOURCE_DATE_EPOCH": "0"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, check=True, env=environment)
    assert done.stdout == written["figure-06.svg"] + written["figure-06.png"]


def test_figure_n_is_case_n_minus_5_and_holds_what_the_text_says() -> None:
    programs = {plan.stem: plan.programs for plan in figures.plans()}
    assert list(programs) == ALL
    for stem in ("06", "07", "08", "09"):
        assert programs[f"figure-{stem}"] == programs[f"figure-{stem}-corrected"] == PROGRAMS
    for stem in ("10a", "10b", "11", "12"):
        assert "runge-kutta" not in programs[f"figure-{stem}"]
    assert set(programs["figure-10a"]) | set(programs["figure-10b"]) == {"two-term", "four-term"}
    assert "two-term" not in programs["figure-11"]
    assert "two-term" in programs["figure-11-corrected"]
    for plan in figures.plans():
        assert plan.case == plan.number - 5
        assert plan.source
        assert plan.caption.endswith(".")


def test_a_caption_tells_what_its_own_curves_do(found: dict[str, FigureFinding]) -> None:
    """V.2 saw the printed programs alone; what the corrected ones do is seen in their curves."""
    for stem, finding in found.items():
        if finding.plan.set == "original":
            assert found[f"{stem}-corrected"].plan.caption != finding.plan.caption
            continue
        assert "V.2" not in finding.plan.caption
        assert re.search(r"\bfollows?\b", finding.plan.caption)
        for curve in finding.curves:
            assert not curve.ending
            assert share_of_range(curve.trajectory.omega, finding.reference.omega) < 0.01


@pytest.mark.campaign
def test_numbers_are_those_of_the_trajectories(found: dict[str, FigureFinding]) -> None:
    assert list(found) == ALL
    for finding in found.values():
        scene, plan = case_scene(finding.plan.case), finding.plan
        truth = reference(scene, scene.times())
        wanted = {"reference": truth} | {
            name: compiled.run(scene, figures.SETS[plan.set](name)) for name in plan.programs
        }
        for curve, run in wanted.items():
            rows = np.column_stack([run.time, run.omega])
            rows = np.vstack([[0.0, *scene.omega], rows])
            np.testing.assert_array_equal(_rows(finding, curve), rows)
        if "runge-kutta" in wanted:
            steps = RUNGE_KUTTA[plan.number - 6] if plan.set == "original" else 100
            assert len(_rows(finding, "runge-kutta")) == 1 + steps
        table = curve_numbers(finding).rows
        limit = {"limit"} if plan.stem == "figure-07" else set()
        assert {row[0] for row in table} == set(wanted) | limit
        assert {row[1] for row in table} == {"", plan.set}


def test_lines_are_drawn_to_their_end_which_is_marked(found: dict[str, FigureFinding]) -> None:
    """Check what matplotlib receives: the curve's points, a cross at the last one, the label."""
    run = compiled.run(case_scene(2), Listing.original("runge-kutta"))
    for row, axes in enumerate(figures.figure_picture(found["figure-07"]).figure.axes):
        (stopped,) = (each for each in axes.lines if "runge-kutta (" in str(each.get_label()))
        (cross,) = (each for each in axes.lines if each.get_marker() == "X")
        curve = [[0.0, *run.time], [case_scene(2).omega[row], *run.omega[:, row]]]
        np.testing.assert_array_equal(stopped.get_data(), curve)
        np.testing.assert_array_equal(cross.get_data(), [run.time[-1:], run.omega[-1:, row]])
        assert stopped.get_label() == "runge-kutta (stopped at step 25 by V2)"
        # The lines differ without colour: no two share marker and width.
        looks = {(each.get_marker(), each.get_linewidth()) for each in axes.lines}
        assert len(looks) == len(axes.lines) == 6
    # 2 y(t/2) - y(0) exceeds the sine, as V.2 saw.
    t, *omega = _rows(found["figure-07"], "limit").T
    limit = [2.0 * np.sin(2.5 * t), 2.0 * np.cos(2.5 * t) - 1.0, np.full_like(t, 10.0)]
    np.testing.assert_allclose(omega, limit, atol=1e-12)
    scene = replace(case_scene(2), step_size=1e-4, steps=10_000)
    run = compiled.run(scene, Listing.original("runge-kutta"), may_stop=False)
    t = run.time
    limit = [2.0 * np.sin(2.5 * t), 2.0 * np.cos(2.5 * t) - 1.0, np.full_like(t, 10.0)]
    assert np.abs(run.omega.T - limit).max() < 2e-3


def test_curve_that_diverges_leaves_the_picture(found: dict[str, FigureFinding]) -> None:
    """The two-term program of Case 6 original reaches 1e111; the other curves stay legible."""
    finding, listing = found["figure-11"], Listing.original("two-term")
    wild = Curve(listing, compiled.run(finding.scene, listing))
    assert np.abs(wild.trajectory.omega).max() > 1e100
    beside = replace(finding, curves=(wild, *finding.curves))
    for row in range(3):
        bottom, top = figures._frame(finding, row)
        low, high = figures._frame(beside, row)
        assert low <= bottom < top <= high < low + 3.0 * (top - bottom)
    assert len(_rows(beside, "two-term")) == 57
    assert b"e+1" not in saved(figures.figure_picture(beside), "figure-11.svg")["figure-11.svg"]
    assert wild.ending == "overflow after step 56"


def test_points_are_those_at_which_the_twins_collocate(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the second step on, a point of the printed programs is outside the step."""
    used: list[list[float]] = []
    interval = collocation.interval

    def recorded(start: Any, points: Any, end: float, rates: Any) -> Any:
        used.append(list(points))
        return interval(start, points, end, rates)

    monkeypatch.setattr(collocation, "interval", recorded)
    rows = figures.points_picture().numbers.rows
    scene = case_scene(2)
    for program, terms in figures.TERMS.items():
        used.clear()
        run_program(scene, Listing.original(program), "python")
        shown = [row[3] for row in rows if row[0] == program]
        np.testing.assert_allclose(np.reshape(shown, (-1, terms)), used[:10], rtol=1e-14)
        assert [max(points) > scene.step_size for points in used] == [False] + [True] * 99


@pytest.mark.campaign
@pytest.mark.usefixtures("fast")
def test_list_of_files(capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert main(["figures", "--out", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert (captured.err, lines.index("")) == ("", 1 + len(ALL))
    cases = [line.split()[1] for line in lines[1 : 1 + len(ALL)]]
    assert cases[:8] == ["1*", "2*", "3*", "4*", "5*", "5", "6*", "7*"]
    assert cases[8:] == ["1*", "2", "3*", "4*", "5", "5", "6*", "7*"]
    assert lines[2 + len(ALL)].startswith("* assumed: omega(0), ours (Case 1)")
    assert max(map(len, lines)) <= 100
    assert "runge-kutta (stopped at step 25 by V2)" in lines[2]
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert main(["figures", "--out", str(tmp_path), "--format", "json"]) == 0
    captured = capsys.readouterr()
    assert "/16 [" in captured.err
    record = json.loads(captured.out, parse_constant=pytest.fail)
    assert record["schema"] == 1
    assert "numpy" in record["build"]
    listed = [name for figure in record["figures"] for name in figure["files"]]
    assert sorted(listed) == sorted(path.name for path in tmp_path.iterdir())
    assert record["figures"][4]["figure"] == "Figure 10, part A"


@pytest.mark.parametrize("out", ["dangling", "taken", "without matplotlib"])
def test_folder_that_can_not_be_written_is_refused_before_any_work(
    out: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(figures, "findings", lambda: pytest.fail("computed all the same"))
    (tmp_path / "dangling").symlink_to("nowhere")
    (tmp_path / "taken/figure-09.svg").mkdir(parents=True)
    before = sorted(tmp_path.rglob("*"))
    if out == "without matplotlib":
        monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["figures", "--out", out]) == 2
    assert {"without matplotlib": "[plots]"}.get(out, out) in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.usefixtures("fast")
def test_nothing_is_left_where_writing_fails(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pyharness.model.output_files.os.replace", full)
    kept = tmp_path / "kept"
    kept.mkdir()
    for folder in (tmp_path / "new", kept):
        assert main(["figures", "--out", str(folder)]) == 2
        assert "No space left on device" in capsys.readouterr().err
    assert list(tmp_path.rglob("*")) == [kept]
