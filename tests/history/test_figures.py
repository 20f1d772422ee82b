"""Figures 6 to 12: the right files, the right curves, each as long as its program ran."""

import csv
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import case_scene
from pyharness.cli.main import main
from pyharness.cli.output import write_folder
from pyharness.history import figure_pictures as figure_plots
from pyharness.history import figures
from pyharness.history.figures import Curve, FigureFinding
from pyharness.model.listing import corrected, original
from pyharness.original import compiled
from pyharness.truth.reference import reference
from pyharness.views import pictures
from pyharness.views.pictures import saved

Capture = pytest.CaptureFixture[str]
STEMS = ["06", "07", "08", "09", "10a", "10b", "11", "12"]
ALL = [f"figure-{stem}{part}" for part in ("", "-corrected") for stem in STEMS]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All figures, drawn once."""
    out = tmp_path_factory.mktemp("figures") / "new"
    assert main(["figures", "--out", str(out)]) == 0
    return out


def _finding(stem: str) -> FigureFinding:
    return next(each for each in figures.findings() if each.plan.stem == stem)


def _rows(text: str, curve: str) -> np.ndarray:
    names = ("time", "omega1", "omega2", "omega3")
    rows = [row for row in csv.DictReader(text.splitlines()) if row["curve"] == curve]
    return np.array([[float(row[name]) for name in names] for row in rows])


def test_every_figure_is_there_in_every_form_and_nothing_else(folder: Path) -> None:
    wanted = {f"{stem}.{ending}" for stem in ALL for ending in ("svg", "png", "csv")}
    assert {path.name for path in folder.iterdir()} == wanted
    for stem in ALL:
        assert (folder / f"{stem}.png").read_bytes().startswith(b"\x89PNG\r\n")
        assert b"</svg>" in (folder / f"{stem}.svg").read_bytes()[-20:]


def test_figure_n_is_case_n_minus_5_and_holds_what_the_text_says() -> None:
    programs = {plan.stem: plan.programs for plan in figures.plans()}
    assert list(programs) == ALL
    assert all(plan.case == plan.number - 5 for plan in figures.plans())
    every = ("two-term", "four-term", "runge-kutta")
    for stem in ("06", "07", "08", "09"):
        assert programs[f"figure-{stem}"] == programs[f"figure-{stem}-corrected"] == every
    for stem in ("10a", "10b", "11", "12"):
        assert "runge-kutta" not in programs[f"figure-{stem}"]
    assert set(programs["figure-10a"]) | set(programs["figure-10b"]) == {"two-term", "four-term"}
    assert "two-term" not in programs["figure-11"]
    assert "two-term" in programs["figure-11-corrected"]
    for plan in figures.plans():
        assert plan.source
        assert plan.caption.endswith(".")


def test_numbers_are_those_of_the_trajectories(folder: Path) -> None:
    for plan in figures.plans():
        text = (folder / f"{plan.stem}.csv").read_text()
        scene = case_scene(plan.case)
        truth = reference(scene, scene.times())
        rows = _rows(text, "reference")
        np.testing.assert_array_equal(rows, np.hstack([truth.time[:, None], truth.omega]))
        for program in plan.programs:
            listing = original(program) if plan.set == "original" else corrected(program)
            run = compiled.run(scene, listing)
            rows = _rows(text, program)
            np.testing.assert_array_equal(rows, np.hstack([run.time[:, None], run.omega]))
        listings = {row["listing"] for row in csv.DictReader(text.splitlines())}
        assert listings == {"", "original" if plan.set == "original" else "corrected"}
        curves = {row["curve"] for row in csv.DictReader(text.splitlines())}
        assert curves == {"reference", *plan.programs}


def test_case_2_shows_the_known_solution(folder: Path) -> None:
    rows = _rows((folder / "figure-07.csv").read_text(), "reference")
    t = rows[:, 0]
    wanted = np.array([np.sin(5 * t), np.cos(5 * t), np.full(len(t), 10.0)]).T
    np.testing.assert_allclose(rows[:, 1:], wanted, rtol=0, atol=1e-14)


def test_curves_stop_where_the_program_stopped(folder: Path) -> None:
    ends = {"figure-06": 100, "figure-07": 25, "figure-08": 24, "figure-09": 23}
    for stem, steps in ends.items():
        assert len(_rows((folder / f"{stem}.csv").read_text(), "runge-kutta")) == steps
        after = (folder / f"{stem}-corrected.csv").read_text()
        assert len(_rows(after, "runge-kutta")) == 100


def test_lines_are_drawn_to_their_end_which_is_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    """What matplotlib is given: the curve's own points, a cross at the last one, the label."""
    from matplotlib.axes import Axes

    finding = _finding("figure-07")
    seen: list[tuple[np.ndarray, np.ndarray, dict[str, Any]]] = []
    plot = Axes.plot

    def spy(self: Axes, *values: np.ndarray, **style: Any) -> Any:
        seen.append((np.array(values[0]), np.array(values[1]), style))
        return plot(self, *values, **style)

    monkeypatch.setattr(Axes, "plot", spy)
    figure_plots.figure_picture(finding)
    stopped = [each for each in seen if "runge-kutta" in str(each[2].get("label"))]
    crosses = [each for each in seen if each[2].get("marker") == "X"]
    run = compiled.run(case_scene(2), original("runge-kutta"))
    assert len(stopped) == len(crosses) == 3
    for row in range(3):
        x, y, style = stopped[row]
        np.testing.assert_array_equal(x, run.time)
        np.testing.assert_array_equal(y, run.omega[:, row])
        assert style["label"] == "runge-kutta (stopped at step 25 by V2)"
        assert crosses[row][0].tolist() == run.time[-1:].tolist()
        assert crosses[row][1].tolist() == run.omega[-1:, row].tolist()
    # Without colour: no two lines share dash, marker and width.
    looks = {
        (str(s.get("linestyle")), str(s.get("marker")), str(s.get("linewidth")))
        for _, _, s in seen
        if s.get("marker") != "X"
    }
    assert len(looks) == 4


def test_curve_that_diverges_leaves_the_picture() -> None:
    """The two-term program of Case 6 original, to 1e111, beside curves that stay legible."""
    finding = _finding("figure-11")
    wild = Curve(original("two-term"), compiled.run(finding.scene, original("two-term")))
    assert np.abs(wild.trajectory.omega).max() > 1e100
    beside = replace(finding, curves=(wild, *finding.curves))
    for row in range(3):
        calm = figure_plots._frame(finding, row)
        low, high = figure_plots._frame(beside, row)
        assert low <= calm[0] < calm[1] <= high
        assert high - low < 3.0 * (calm[1] - calm[0])
    content = saved(figure_plots.figure_picture(beside), "figure-11.svg")
    assert len(_rows(content["figure-11.csv"].decode(), "two-term")) == 56
    assert b"e+1" not in content["figure-11.svg"]
    assert figure_plots.ending(wild) == "overflow after step 56"


def test_same_bytes_in_every_process(folder: Path) -> None:
    code = (
        "import sys; from pyharness.history import figures, figure_pictures; "
        "from pyharness.views.pictures import saved; "
        "picture = figure_pictures.figure_picture(next(figures.findings())); "
        "found = saved(picture, 'figure-06.svg', 'figure-06.png'); "
        "sys.stdout.buffer.write(found['figure-06.svg'] + found['figure-06.png'])"
    )
    wanted = (folder / "figure-06.svg").read_bytes() + (folder / "figure-06.png").read_bytes()
    environment = {**os.environ, "PYTHONHASHSEED": "77", "SOURCE_DATE_EPOCH": "0"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=True, env=environment
    )
    assert done.stdout == wanted


def _fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw nothing: for the tests of what is written where."""
    monkeypatch.setattr(figure_plots, "figure_picture", lambda finding: finding)
    monkeypatch.setattr(
        pictures, "saved", lambda finding, *paths: dict.fromkeys(finding.plan.files, b"x")
    )


def test_list_of_files(capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _fast(monkeypatch)
    assert main(["figures", "--out", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    lines = captured.out.splitlines()
    assert max(map(len, lines)) <= 100
    assert len(lines) == 1 + len(ALL)
    assert "runge-kutta (stopped at step 25 by V2)" in lines[2]
    assert main(["figures", "--out", str(tmp_path), "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert record["schema"] == 1
    assert "numpy" in record["build"]
    listed = [name for figure in record["figures"] for name in figure["files"]]
    assert sorted(listed) == sorted(path.name for path in tmp_path.iterdir())
    assert record["figures"][4]["figure"] == "Figure 10, part A"


def test_progress_goes_to_a_terminal_only(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _fast(monkeypatch)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert main(["figures", "--out", str(tmp_path / "new")]) == 0
    assert "figures: 16 of 16" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("out", "words"),
    [
        (None, "give --out DIR"),
        ("", "is not a folder"),
        ("a\0b", "is not a folder"),
        ("file", "is not a folder"),
        ("dangling", "is not a folder"),
        ("file/new", "can't be made"),
        ("no/such/new", "can't be made"),
        ("taken", "figure-09.svg': is a folder"),
    ],
)
def test_folder_that_can_not_be_written_is_one_line(
    out: str | None,
    words: str,
    capsys: Capture,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(figures, "findings", lambda: pytest.fail("computed all the same"))
    (tmp_path / "file").touch()
    (tmp_path / "dangling").symlink_to("nowhere")
    (tmp_path / "taken/figure-09.svg").mkdir(parents=True)
    before = sorted(tmp_path.rglob("*"))
    assert main(["figures", *([] if out is None else ["--out", out])]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert words in captured.err
    assert sorted(tmp_path.rglob("*")) == before


def test_nothing_is_left_where_writing_fails(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _fast(monkeypatch)

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pyharness.cli.output.os.replace", full)
    assert main(["figures", "--out", str(tmp_path / "new")]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    kept = tmp_path / "kept"
    kept.mkdir()
    assert main(["figures", "--out", str(kept)]) == 2
    assert list(kept.iterdir()) == []
    monkeypatch.undo()
    write_folder(str(kept), {"a": b"1", "b": b"2"}, "--out")
    assert sorted(path.name for path in kept.iterdir()) == ["a", "b"]


def test_matplotlib_that_is_missing_is_named(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["figures", "--out", str(tmp_path / "new")]) == 2
    assert "pip install matplotlib" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_wrong_format_is_a_mistake(capsys: Capture, tmp_path: Path) -> None:
    assert main(["figures", "--out", str(tmp_path / "new"), "--format", "csv"]) == 2
    assert "allowed: table, json" in capsys.readouterr().err
