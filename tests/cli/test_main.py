"""The command line: contracts, exit codes, and every mistake answered in one line."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import case_scene
from pyharness.cli.main import main
from pyharness.model import extension
from pyharness.model.errors import NotBuiltError
from pyharness.model.listing import original
from pyharness.model.report import short
from pyharness.original import compiled

Capture = pytest.CaptureFixture[str]

RUN = ["run", "--case", "3"]
COMPARE = ["compare", "--case", "3"]

# arguments, words that the line must hold
MISTAKES = [
    (["comapre"], "unknown verb 'comapre'; did you mean 'compare'"),
    (["compare"], "--case N"),
    (["compare", "--case", "8"], "unknown case '8'"),
    (["compare", "--case", "x"], "unknown case 'x'"),
    (["compare", "--case", "3", "--scene", "x.toml"], "either --case"),
    (["compare", "--scene", "missing.toml"], "No such file"),
    ([*COMPARE, "--program", "four-terms"], "did you mean 'four-term'"),
    ([*COMPARE, "--fix", "stagebase"], "did you mean 'stage-base'"),
    ([*COMPARE, "--fix", ""], "unknown defect ''"),
    ([*COMPARE, "--fix", "stage-base", "--keep", "stage-base"], "both --fix and --keep"),
    ([*COMPARE, "--program", "two-term", "--fix", "stage-base"], "unknown defect 'stage-base'"),
    ([*COMPARE, "--listing", "mended"], "unknown listing 'mended'"),
    ([*COMPARE, "--reading", "nonsense"], "unknown reading 'nonsense'"),
    ([*COMPARE, "--format", "xml"], "unknown format 'xml'"),
    ([*COMPARE, "--stpes", "3"], "did you mean '--steps'"),
    ([*COMPARE, "surplus"], "unknown option 'surplus'"),
    ([*COMPARE, "--steps"], "expected one argument"),
    ([*COMPARE, "--steps", "0"], "steps is 0"),
    ([*COMPARE, "--steps", "-3"], "steps is -3"),
    ([*COMPARE, "--steps", "10000000000"], "GB"),
    ([*COMPARE, "--steps", "1e3"], "'1e3' where a whole number belongs"),
    ([*COMPARE, "--steps", "9" * 5000], "--steps"),
    ([*COMPARE, "--step-size", "0"], "step_size is 0"),
    ([*COMPARE, "--step-size", "-0.1"], "step_size is -0.1"),
    ([*COMPARE, "--step-size", "small"], "'small' where a number belongs"),
    ([*COMPARE, "--step-size", "nan"], "not finite"),
    ([*COMPARE, "--omega0", "1,2"], "2 numbers; allowed: three"),
    ([*COMPARE, "--omega0", "1,2,3,4"], "4 numbers; allowed: three"),
    ([*COMPARE, "--omega0", "1,2,inf"], "not finite"),
    ([*COMPARE, "--omega0", "1,2,"], "where a number belongs"),
    ([*COMPARE, "--lipschitz", "0"], "allowed: a number above 0"),
    ([*COMPARE, "--tolerance", "2"], "--tolerance: 2; allowed"),
    ([*COMPARE, "--tolerance", "1e-16"], "--tolerance: 1e-16; allowed"),
    ([*COMPARE, "--out", "no/such/folder/x"], "there is no folder"),
    ([*COMPARE, "--out", "."], "is a folder"),
    ([*COMPARE, "--plot", "x.gif"], "unknown picture format"),
    ([*COMPARE, "--plot", "no/such/folder/x.png"], "there is no folder"),
    ([*COMPARE, "--out", "a\0b"], "--out"),
    ([*COMPARE, "--plot", "a.png", "--out", "a.png"], "puts the picture; give a file of another"),
    ([*COMPARE, "--plot", "a.png", "--out", "./a.csv"], "puts its numbers; give a file of another"),
    ([*RUN, "--method", "auto", "--plot", "a.svg", "--out", "a.csv"], "puts its numbers"),
    (["bench", "--case", "5", "--plot", "a.pdf", "--out", "a.csv"], "puts its numbers"),
    (["bench", "--growth", "--plot", "a.pdf", "--out", "a.csv"], "puts its numbers"),
    (
        ["stress", "--only", "separatrix", "--plot", "a.png", "--out", "a.csv"],
        "puts its numbers",
    ),
    (RUN, "either --program"),
    ([*RUN, "--program", "two-term", "--method", "dop853"], "either --program"),
    ([*RUN, "--program", "five-term"], "unknown program 'five-term'"),
    ([*RUN, "--program", "four-term", "--fix", "stage-base"], "four-term has no defect"),
    ([*RUN, "--program", "four-term", "--times", "1"], "--times has no meaning with --program"),
    ([*RUN, "--program", "four-term", "--lipschitz", "1"], "--lipschitz has no meaning"),
    ([*RUN, "--program", "four-term", "--no-stop"], "--no-stop has no meaning"),
    ([*RUN, "--program", "runge-kutta", "--lipschitz", "5", "--no-stop"], "with --no-stop"),
    ([*COMPARE, "--lipschitz", "5", "--no-stop"], "--lipschitz has no meaning with --no-stop"),
    ([*COMPARE, "--program", "four-term", "--no-stop"], "--no-stop has no meaning with --program"),
    ([*RUN, "--program", "four-term", "--implementation", "c"], "unknown implementation 'c'"),
    ([*RUN, "--method", "dop835"], "did you mean 'dop853'"),
    ([*RUN, "--method", "dop853", "--fix", "stage-base"], "--fix has no meaning with --method"),
    ([*RUN, "--method", "dop853", "--times", "1,1"], "not strictly monotonic"),
    ([*RUN, "--method", "dop853", "--times", "-1,1,0"], "not strictly monotonic"),
    ([*RUN, "--method", "dop853", "--times", ""], "where a number belongs"),
    ([*RUN, "--method", "dop853", "--tolerance", "0"], "allowed: a number above 0"),
    ([*RUN, "--method", "dop853", "--tolerance", "1e-20"], "allowed for dop853"),
    (["doctor", "--format", "csv"], "unknown format 'csv'"),
]


@pytest.mark.parametrize(("arguments", "words"), MISTAKES, ids=range(len(MISTAKES)))
def test_mistake_is_one_line_and_exit_code_2(
    arguments: list[str],
    words: str,
    capsys: Capture,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("pyharness: ")
    assert words in captured.err
    assert list(tmp_path.iterdir()) == []


def test_help_and_version(capsys: Capture) -> None:
    for arguments in ([], ["--help"]):
        assert main(arguments) == 0
        assert "compare" in capsys.readouterr().out
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("pyharness 0.")
    for verb in ("compare", "run", "doctor"):
        with pytest.raises(SystemExit) as caught:
            main([verb, "--help"])
        assert caught.value.code == 0
        assert "--out" in capsys.readouterr().out


def test_run_json_is_as_contracted(capsys: Capture) -> None:
    assert main([*RUN, "--program", "runge-kutta", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert list(record) == [
        "schema", "scene", "method", "listing", "trajectory", "steps", "evaluations", "stop",
        "ended", "build",
    ]  # fmt: skip
    assert record["schema"] == 1
    assert record["stop"] == {"step": 24, "variable": "V2", "quotient": record["stop"]["quotient"]}
    assert record["ended"] == "stopped"
    wanted = compiled.run(case_scene(3), original("runge-kutta"))
    trajectory = record["trajectory"]
    np.testing.assert_array_equal(trajectory["omega"], wanted.omega)
    np.testing.assert_array_equal(trajectory["velocity"], wanted.velocity)
    assert trajectory["time"][0] == 0.01
    assert {"compiler", "flags", "numpy", "scipy", "platform"} <= set(record["build"])


def test_run_json_of_a_method_and_of_an_overflow(capsys: Capture, tmp_path: Path) -> None:
    assert main([*RUN, "--method", "dop853", "--times", "-0.5,-1", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["listing"] is None
    assert record["trajectory"]["velocity"] is None
    assert record["trajectory"]["time"] == record["trajectory"]["recorded_time"] == [-0.5, -1.0]
    assert main(["run", "--case", "6", "--program", "two-term", "--format", "json"]) == 0
    record = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert record["ended"] == "overflow"
    assert len(record["trajectory"]["omega"]) == record["steps"] == 56


def test_run_csv_round_trips_and_both_implementations_agree(capsys: Capture) -> None:
    texts = []
    for implementation in ("fortran", "python"):
        arguments = [*RUN, "--program", "two-term", "--implementation", implementation]
        assert main([*arguments, "--format", "csv"]) == 0
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1]
    rows = list(csv.DictReader(texts[0].splitlines()))
    wanted = compiled.run(case_scene(3), original("two-term"))
    assert [float(row["omega2"]) for row in rows] == wanted.omega[:, 1].tolist()


@pytest.mark.parametrize("form", ["table", "markdown"])
def test_run_for_people_fits_the_terminal(form: str, capsys: Capture) -> None:
    arguments = ["run", "--case", "7", "--program", "four-term", "--steps", "300"]
    assert main([*arguments, "--format", form]) == 0
    out = capsys.readouterr().out
    if form == "table":
        assert max(map(len, out.splitlines())) <= 100
        assert "280 rows left out" in out
        assert "complete (300 steps, 1500 right-hand sides)" in out
    else:
        assert out.count("\n") == 302


def test_one_is_not_many(capsys: Capture) -> None:
    assert main([*RUN, "--program", "two-term", "--steps", "1", "--step-size", "20"]) == 0
    out = capsys.readouterr().out
    assert "1 step of 20 s" in out
    assert "(1 step, " in out


def test_options_reach_the_program(capsys: Capture) -> None:
    base = [*RUN, "--program", "runge-kutta", "--format", "json"]

    def record(*options: str) -> dict[str, Any]:
        assert main([*base, *options]) == 0
        result: dict[str, Any] = json.loads(capsys.readouterr().out)
        return result

    assert record("--no-stop")["steps"] == 100
    assert record("--lipschitz", "1e9", "--steps", "7")["steps"] == 7
    assert record("--step-size", "0.001")["scene"]["run"]["step_size"] == 0.001
    assert record("--omega0", "-1,2,3e0")["scene"]["initial"]["omega"] == [-1.0, 2.0, 3.0]
    assert record("--listing", "corrected")["listing"]["defects"] == []
    assert record("--keep", "stage-base")["listing"]["defects"] == ["stage-base"]
    assert "stage-base" not in record("--fix", "stage-base")["listing"]["defects"]
    assert record("--reading", "do-variable")["listing"]["readings"] == ["do-variable"]


def test_scene_file_on_the_command_line(capsys: Capture, tmp_path: Path) -> None:
    path = tmp_path / "brick.toml"
    path.write_text("[body]\nmoments=[3,2,1]\n[initial]\nomega=[0.1,1,0.2]\n")
    assert main(["compare", "--scene", str(path)]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("brick\n")
    assert captured.err == ""
    path.write_text("[body]\nmoments=[200,10,20]\n[initial]\nomega=[0.1,1,0.2]\n")
    assert main(["compare", "--scene", str(path)]) == 0
    assert "no rigid body has these moments" in capsys.readouterr().err


def test_files_are_written_whole(capsys: Capture, tmp_path: Path) -> None:
    out, picture = tmp_path / "found.json", tmp_path / "found.png"
    arguments = [*COMPARE, "--format", "json", "--out", str(out), "--plot", str(picture)]
    assert main(arguments) == 0
    assert capsys.readouterr().out == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "found.csv", "found.json", "found.png",
    ]  # fmt: skip
    assert json.loads(out.read_text())["unexpected"] == []
    assert out.stat().st_mode & 0o077 == 0o666 & ~_mask() & 0o077


def test_device_or_link_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe, link, target = tmp_path / "pipe", tmp_path / "link", tmp_path / "target"
    os.mkfifo(pipe)
    link.symlink_to(target)
    reader = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True)
    arguments = [*RUN, "--program", "two-term", "--format", "csv", "--out"]
    assert main([*arguments, str(pipe)]) == 0
    assert reader.communicate()[0].startswith("time,")
    assert pipe.is_fifo()
    assert main([*arguments, str(link)]) == 0
    assert link.is_symlink()
    assert target.read_text().startswith("time,")


def _mask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_unexpected_difference_is_exit_code_1(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pyharness.compare.comparison.differences", lambda *_: ["omega"])
    assert main(COMPARE) == 1
    assert "UNEXPECTED: two-term original: Fortran and twin differ in omega" in (
        capsys.readouterr().out
    )


def test_extension_that_is_not_built_is_exit_code_3(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> None:
        raise NotBuiltError("the Fortran extension is not built; run 'make compare'")

    monkeypatch.setattr("pyharness.original.compiled.extension", missing)
    assert main([*RUN, "--program", "two-term"]) == 3
    captured = capsys.readouterr()
    assert captured.err == "pyharness: the Fortran extension is not built; run 'make compare'\n"
    assert main([*RUN, "--program", "two-term", "--implementation", "python"]) == 0


def test_extension_that_can_not_be_imported_says_how_to_build(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "pyharness._kernels", None)
    monkeypatch.delattr("pyharness._kernels", raising=False)
    with pytest.raises(NotBuiltError, match="make compare"):
        extension.extension()


def test_doctor(capsys: Capture) -> None:
    assert main(["doctor"]) == 0
    out = capsys.readouterr().out
    for words in ("Fortran compiler", "-ffp-contract=off", "NumPy", "matplotlib"):
        assert words in out
    assert main(["doctor", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["build"]["extension"]


def _python(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_as_a_module_and_as_a_command() -> None:
    for command in (["-m", "pyharness"], ["-c", "from pyharness.cli.main import main; main()"]):
        done = _python(*command, "run", "--case", "2", "--program", "runge-kutta")
        assert "stopped at step 25 by V2" in done.stdout
        assert done.stderr == ""


def test_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -m pyharness run --case 3 --program two-term --steps 20000"
    done = subprocess.run(
        ["sh", "-c", f"{command} --format csv | head -n 1"], capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.stdout.startswith("time,")
    assert done.stderr == ""


def test_rooms_are_entered_only_when_needed(tmp_path: Path) -> None:
    """`import pyharness` loads no NumPy; a program's run loads neither SciPy nor matplotlib."""
    code = "import sys, pyharness; print('numpy' in sys.modules)"
    assert _python("-c", code).stdout == "False\n"
    code = (
        "import sys; from pyharness.cli.main import main; "
        "main(['run', '--case', '3', '--program', 'four-term', '--out', sys.argv[1]]); "
        "print([m for m in ('scipy', 'matplotlib', 'decimal', 'pyharness.compare.comparison')"
        " if m in sys.modules])"
    )
    assert _python("-c", code, str(tmp_path / "x")).stdout == "[]\n"


def test_rows_that_are_shown_are_the_first_and_the_last(capsys: Capture) -> None:
    assert main([*RUN, "--program", "two-term", "--steps", "300"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    steps = [int(line[0]) for line in lines if line and line[0].isdigit()]
    assert steps == [*range(1, 11), *range(291, 301)]


@pytest.mark.parametrize(("method", "tolerance"), [("taylor", "1e-09"), ("gauss-1", "1e-08")])
def test_tolerance_is_a_billionth_where_none_is_given(
    method: str, tolerance: str, capsys: Capture
) -> None:
    assert main([*RUN, "--method", method, "--times", "0.1"]) == 0
    assert f"tolerance {tolerance}" in capsys.readouterr().out


def test_constant_of_the_stop_test_reaches_compare(capsys: Capture) -> None:
    options = ["--case", "2", "--program", "runge-kutta", "--format", "json"]
    for constant, steps in ((500.0, 25), (1e9, 100)):
        assert main(["compare", *options, "--lipschitz", str(constant)]) == 0
        record = json.loads(capsys.readouterr().out)
        assert record["lipschitz"] == constant
        assert record["programs"][0]["steps"] == steps


@pytest.mark.parametrize(
    ("number", "text"),
    [(1.23e-3, "1.2e-3"), (-9.96e12, "-1.0e13"), (1.0, "1.0e0"), (0.0, "0"), (None, "-"),
     (float("inf"), "inf"), (float("-inf"), "-inf"), (float("nan"), "nan")],
)  # fmt: skip
def test_two_digits_of_a_number(number: float | None, text: str) -> None:
    assert short(number) == text


def test_quotient_that_stopped_a_run_is_told(capsys: Capture) -> None:
    assert main(["run", "--case", "2", "--program", "runge-kutta"]) == 0
    assert "stopped at step 25 by V2: Lipschitz quotient 3.3e3 (" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (MemoryError(), 2, "not enough memory; take fewer steps"),
        (NotBuiltError("not built"), 3, "not built"),
    ],
)
def test_what_ends_a_run_has_an_exit_code(
    error: BaseException, code: int, words: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def raises(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("pyharness.methods.solve.solve", raises)
    assert main([*RUN, "--method", "taylor"]) == code
    assert capsys.readouterr().err == f"pyharness: {words}\n"


def test_json_of_a_scene_and_of_drifts_is_that_of_the_findings(
    capsys: Capture, tmp_path: Path
) -> None:
    path = tmp_path / "x.toml"
    path.write_text(
        "[body]\nmoments = [4, 3, 2]\n[initial]\nomega = [1, 2, 3]\n[torque]\n"
        "sines = [{ amplitude = [1, 2, 3], frequency = 4 }]\n"
        "cosines = [{ amplitude = [5, 6, 7], frequency = 8 }]\n"
    )
    assert main(["run", "--scene", str(path), "--program", "two-term", "--format", "json"]) == 0
    torque = json.loads(capsys.readouterr().out)["scene"]["torque"]
    assert torque["sines"] == [{"amplitude": [1, 2, 3], "frequency": 4}]
    assert torque["cosines"] == [{"amplitude": [5, 6, 7], "frequency": 8}]
    assert main([*COMPARE, "--program", "two-term", "--format", "json"]) == 0
    for each in json.loads(capsys.readouterr().out)["programs"]:
        # Energy is a square's mean by moments, momentum by their squares: no run keeps both alike.
        assert each["energy_drift"] != each["momentum_drift"]
        if each["listing"]["label"] == "corrected":
            assert (each["order_state"], round(each["order"])) == ("as due", 2)
