"""The command line: contracts and exit codes."""

import csv
import ctypes
import json
import math
import os
import platform
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pyharness import Listing, NotBuiltError, case_scene, read_scene, run_program, solve, subset
from pyharness.cli.main import VERBS, main
from pyharness.cli.parser import Parser
from pyharness.model import build, extension
from pyharness.model.report import short
from pyharness.thesis import compiled
from tests.conftest import Capture, Patch, Printed, ResultOf
from tests.instruction_sets import CHOSEN, LEVELS, levels_here


def test_help_and_version(printed: Printed) -> None:
    assert printed("--version").startswith("pyharness 0.")
    for verb in ("compare", "run", "doctor"):
        assert "--out" in printed(f"{verb} --help")
        assert printed(f"{verb} -h") == printed(f"help {verb}")


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("columns", [80, 100])
def test_help_is_in_whole_sentences_and_fits(
    verb: str, columns: int, printed: Printed, monkeypatch: Patch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    told = printed(f"help {verb}")
    assert max(map(len, told.splitlines())) <= columns
    assert f"example:\n  pyharness {verb}" in told
    parser = Parser(verb)
    assert parser.read(verb, shlex.split(parser.module.EXAMPLE)[1:])
    for option, text in parser.module.OPTIONS.items():
        assert text[0].isupper(), (option, text)
        assert text.endswith("."), (option, text)
        assert len(text.split()) >= 3, (option, text)


@pytest.mark.parametrize("verb", VERBS)
def test_help_lists_the_fields_of_json(verb: str, printed: Printed) -> None:
    told = printed(f"help json {verb}").splitlines()
    assert "  schema" in told
    assert max(map(len, told)) <= 100


def test_overview_names_every_verb_once(printed: Printed) -> None:
    lines = printed("help").splitlines()
    named = [line.split()[0] for line in lines if re.match(r"  \w", line)]
    assert sorted(named) == sorted([*VERBS, "pyharness"])
    assert max(map(len, lines)) <= 100
    for other in ("", "-h", "--help", "help -h", "help --help"):
        assert printed(other).splitlines() == lines, other


def _record(printed: Printed, command: str) -> dict[str, Any]:
    text = printed(f"{command} --format json")
    return json.loads(text, parse_constant=pytest.fail)  # type: ignore[no-any-return]


def test_run_json_says_where_a_torque_ends_the_run(printed: Printed, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        "body.moments = [1, 2, 3]\ninitial.omega = [0, 0.1, 1]\n"
        "torque.expression = ['sqrt(0.5 - t)', '0', '0']\nrun = { step_size = 0.25, steps = 4 }\n"
    )
    record = _record(printed, f"run --scene {path} --method auto")
    assert record["ended"] == "singular"
    assert record["reason"].startswith("the torque is not defined at t = 0.5 s: the square root")


def test_run_counts_the_steps_with_a_singular_matrix(printed: Printed, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        "body.moments = [1, 2, 3]\ninitial.omega = [0, 0.1, 1]\n"
        "run = { step_size = 1e-30, steps = 3 }\n"
    )
    command = f"run --scene {path} --program four-term --listing corrected"
    told = "a singular matrix (IER = 129) in 3 steps"
    assert printed(command).splitlines()[-1].endswith(f"; {told}")
    assert _record(printed, command)["singular_steps"] == 3
    run = run_program(read_scene(path), subset("four-term", "corrected"))
    assert run.message == f"The integration reached all requested times, but with {told}."
    assert "singular_steps" not in _record(printed, "run --case 3 --program four-term")


def test_run_json_is_as_contracted(printed: Printed) -> None:
    record = _record(printed, "run --case 3 --program runge-kutta")
    assert list(record) == [
        "schema", "scene", "method", "listing", "trajectory", "steps", "evaluations", "stop",
        "ended", "build", "assumptions",
    ]  # fmt: skip
    assert record["schema"] == 1
    assert record["stop"] == {"step": 24, "variable": "V2", "quotient": record["stop"]["quotient"]}
    assert record["ended"] == "stopped"
    wanted = compiled.run(case_scene(3), Listing.original("runge-kutta"))
    trajectory = record["trajectory"]
    np.testing.assert_array_equal(trajectory["omega"], wanted.omega)
    np.testing.assert_array_equal(trajectory["velocity"], wanted.velocity)
    assert trajectory["time"][0] == 0.01
    assert {"compiler", "flags", "numpy", "scipy", "platform"} <= set(record["build"])


def test_run_json_of_a_method_and_of_an_overflow(printed: Printed) -> None:
    record = _record(printed, "run --case 3 --method dop853 --times -0.5,-1")
    assert record["listing"] is None
    assert record["trajectory"]["velocity"] is None
    assert record["trajectory"]["time"] == record["trajectory"]["recorded_time"] == [-0.5, -1.0]
    record = _record(printed, "run --case 6 --program two-term")
    assert record["ended"] == "overflow"
    assert len(record["trajectory"]["omega"]) == record["steps"] == 56


# Beside the middle axis, which it leaves.
_FAR = "run --case 3 --method taylor --omega 1e-5,10,0 --times 1,15 --tolerance"
_BESIDE = "compare --case 3 --program two-term --omega 1e-5,10,0 --steps 1500 --tolerance 1e-11"


def test_run_tells_of_error_growth_and_digits(printed: Printed) -> None:
    scene = replace(case_scene(3), omega=(1e-5, 10.0, 0.0))
    for tolerance, ended in (("1e-12", "sensitive"), ("1e-6", "complete")):
        found = solve(scene, [1.0, 15.0], "taylor", float(tolerance))
        told = {"error": found.error, "growth": found.growth, "digits": found.digits}
        record = _record(printed, f"{_FAR} {tolerance}")
        assert record["ended"] == ended
        assert told == {name: record["trajectory"][name] for name in told}
    lines = printed(f"{_FAR} 1e-12").splitlines()
    assert lines[-2].startswith(
        "sensitive: rounding errors are amplified by 1.8e7; 8 digits left (69 "
    )
    assert lines[-1] == (
        "estimated error 2.1e-9 of the largest |omega|; digits left 8.7; error amplification 1.8e7"
    )
    assert max(map(len, lines)) <= 100
    assert printed("run --case 3 --method rk4 --times 1").splitlines()[-1].startswith("complete")
    record = _record(printed, "run --case 3 --program two-term")
    assert {name: record["trajectory"][name] for name in told} == dict.fromkeys(told)


@pytest.mark.campaign
def test_strict_takes_what_is_sensitive_for_a_failure(capsys: Capture) -> None:
    for command, code in (
        (f"{_FAR} 1e-12", 0), (f"{_FAR} 1e-12 --strict", 1), (f"{_FAR} 1e-6 --strict", 0),
        (f"{_BESIDE}", 0), (f"{_BESIDE} --strict", 1),
        ("compare --case 3 --program two-term --strict", 0),
    ):  # fmt: skip
        assert main(command.split()) == code, command
        assert capsys.readouterr().out


SINGULAR = "body.moments = [3, 2, 1]\ninitial.omega = [0, 1, 1]\ntorque.expression = [{}]\n"


@pytest.mark.parametrize(
    ("torque", "told"),
    [("'1/w1', '0', '0'", "overflow: the rows end"), ("'sqrt(0.5 - t)', '0', '0'", "singular: ")],
)
def test_missing_rows_are_told_and_fail_if_strict(
    torque: str, told: str, capsys: Capture, tmp_path: Path
) -> None:
    """Regression test: the result was a head without rows, and the exit status 0."""
    (tmp_path / "x.toml").write_text(SINGULAR.format(torque))
    command = ["run", "--scene", str(tmp_path / "x.toml"), "--format"]
    for form in ("csv", "markdown", "table"):
        assert main([*command, form]) == 0
        found = capsys.readouterr()
        assert told in (found.out if form == "table" else found.err)
        assert main([*command, form, "--strict"]) == 1
        capsys.readouterr()
    # Of a program of the thesis, an overflow may be the expected result.
    assert main(["run", "--case", "6", "--program", "two-term", "--format", "csv"]) == 0
    assert "overflow" not in capsys.readouterr().err


@pytest.mark.campaign
def test_compare_tells_of_the_growth_of_the_motion(printed: Printed) -> None:
    record = _record(printed, _BESIDE)
    assert record["sensitive"] is True
    scene = replace(case_scene(3), omega=(1e-5, 10.0, 0.0), steps=1500)
    assert record["growth"] == solve(scene, scene.times()).growth
    assert record["digits"] == pytest.approx(-math.log10(2.0**-53 * record["growth"]))
    lines = printed(f"{_BESIDE} --numerics").splitlines()
    assert any(line.startswith("sensitive: rounding errors are amplified by ") for line in lines)
    assert any(line.startswith("error amplification ") for line in lines)
    assert max(map(len, lines)) <= 100
    record = _record(printed, "compare --case 3 --program two-term")
    assert record["sensitive"] is False
    for each in record["programs"] + record["methods"]:
        assert each["estimated_error"] is each["growth"] is each["digits"] is None
        assert len(each["error"]) == 3


def test_run_csv_round_trips_and_both_implementations_agree(printed: Printed) -> None:
    command = "run --case 3 --program two-term --format csv --implementation"
    fortran, python = (printed(f"{command} {each}") for each in ("fortran", "python"))
    assert fortran == python
    rows = list(csv.DictReader(fortran.splitlines()))
    wanted = compiled.run(case_scene(3), Listing.original("two-term"))
    assert [float(row["omega2"]) for row in rows] == wanted.omega[:, 1].tolist()


def test_run_for_people_fits_the_terminal(printed: Printed) -> None:
    command = "run --case 7 --program four-term --steps 300"
    lines = printed(command).splitlines()
    assert max(map(len, lines)) <= 100
    assert any("280 rows left out" in line for line in lines)
    steps = [int(line.split()[0]) for line in lines if line.strip()[:1].isdigit()]
    assert steps == [*range(1, 11), *range(291, 301)]
    assert printed(f"{command} --format markdown").count("\n") == 302
    for more in ("", " matrix"):
        lines = printed(f"run --case 3 --program two-term --steps 3 --attitude{more}").splitlines()
        assert max(map(len, lines)) <= 100


@pytest.mark.parametrize(("options", "words"), [
    ("3 --program two-term --steps 1 --step-size 20", "1 step of 20 s"),
    ("3 --program two-term --steps 1 --step-size 20", "(1 step, "),
    ("3 --program four-term", "complete (100 steps, 500 right-hand sides)"),
    ("2 --program runge-kutta", "stopped at step 25 by V2: Lipschitz quotient 3.3e3 ("),
    ("3 --method taylor --times 0.1", "tolerance 1e-09"),
    ("3 --method gauss-1 --times 0.1", "tolerance 1e-06"),
])  # fmt: skip
def test_run_says(options: str, words: str, printed: Printed) -> None:
    assert words in printed(f"run --case {options}")


@pytest.mark.parametrize(("line", "told"), [
    ("plan --case 3 --times 1,2,1", "times: not strictly monotonic"),
    ("deck --program two-term --terms 5", "terms: not for this program; allowed: with"),
    ("deck --program runge-kutta --terms 5", "terms: not for this program; allowed: with"),
    ("deck --program four-term --terms 4", "terms is 4; allowed: 3 or 5"),
])  # fmt: skip
def test_an_unsuitable_value_is_refused(line: str, told: str, result_of: ResultOf) -> None:
    assert told in result_of(line.split(), 2).err


def test_options_reach_the_program(printed: Printed) -> None:
    def record(options: str) -> dict[str, Any]:
        return _record(printed, f"run --case 3 --program runge-kutta {options}")

    assert record("--no-stop")["steps"] == 100
    assert record("--lipschitz 1e9 --steps 7")["steps"] == 7
    assert record("--step-size 0.001")["scene"]["run"]["step_size"] == 0.001
    assert record("--omega -1,2,3e0")["scene"]["initial"]["omega"] == [-1.0, 2.0, 3.0]
    assert record("--listing corrected")["listing"]["defects"] == []
    assert record("--keep stage-base")["listing"]["defects"] == ["stage-base"]
    assert "stage-base" not in record("--fix stage-base")["listing"]["defects"]
    assert record("--reading do-variable")["listing"]["readings"] == ["do-variable"]


def test_scene_file_on_the_command_line(result_of: ResultOf, tmp_path: Path) -> None:
    path = tmp_path / "brick.toml"
    for largest, words in ((3, ""), (200, "no rigid body has these moments")):
        path.write_text(f"[body]\nmoments=[{largest},2,1]\n[initial]\nomega=[0.1,1,0.2]\n")
        captured = result_of(["plan", "--scene", str(path)])
        assert captured.out.startswith("brick\n")
        assert words in captured.err
        assert bool(words) == bool(captured.err)


@pytest.mark.campaign
def test_files_are_written_whole(printed: Printed, tmp_path: Path) -> None:
    out, picture = tmp_path / "found.json", tmp_path / "found.png"
    assert printed(f"compare --case 3 --format json --out {out} --plot {picture}") == ""
    assert {path.name for path in tmp_path.iterdir()} == {"found.csv", "found.json", "found.png"}
    assert json.loads(out.read_text())["unexpected"] == []


def test_pipe_is_written_to_and_not_replaced(printed: Printed, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True)
    printed(f"run --case 3 --program two-term --format csv --out {pipe}")
    assert reader.communicate()[0].startswith("time,")
    assert pipe.is_fifo()


def test_unexpected_difference_is_exit_code_1(result_of: ResultOf, monkeypatch: Patch) -> None:
    monkeypatch.setattr("pyharness.checks.compare.comparison.differences", lambda *_: ["omega"])
    shown = result_of(["compare", "--case", "3", "--program", "two-term"], 1).out
    assert "UNEXPECTED: two-term original: Fortran and twin differ in omega" in shown


def test_extension_that_is_not_built_is_exit_code_3(capsys: Capture, monkeypatch: Patch) -> None:
    def missing() -> None:
        raise NotBuiltError("the Fortran extension is not built; run 'make compare'")

    monkeypatch.setattr("pyharness.thesis.compiled.extension", missing)
    run = ["run", "--case", "3", "--program", "two-term"]
    assert main(run) == 3
    captured = capsys.readouterr()
    assert captured.err == "pyharness: the Fortran extension is not built; run 'make compare'\n"
    assert main([*run, "--implementation", "python"]) == 0


def test_extension_that_can_not_be_imported_says_how_to_build(
    monkeypatch: Patch, tmp_path: Path
) -> None:
    """A source folder may hide the installed package."""
    monkeypatch.setitem(sys.modules, "pyharness._kernels", None)
    monkeypatch.delattr("pyharness._kernels", raising=False)
    with pytest.raises(NotBuiltError, match="make compare"):
        extension.extension()
    (tmp_path / "_kernels.so").touch()
    installed = SimpleNamespace(locate_file=lambda name: tmp_path)
    monkeypatch.setattr("importlib.metadata.distribution", lambda name: installed)
    with pytest.raises(NotBuiltError, match="; run from another folder, or use the command"):
        extension.extension()


def test_doctor(printed: Printed) -> None:
    out = printed("doctor")
    for words in ("Fortran compiler", "-ffp-contract=off", "NumPy", "matplotlib"):
        assert words in out
    assert _record(printed, "doctor")["build"]["extension"]


def test_doctor_prints_what_a_bug_report_needs(printed: Printed, monkeypatch: Patch) -> None:
    for name in build.INFLUENCES:
        monkeypatch.delenv(name, raising=False)
    assert "environment       no variable" in printed("doctor")
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    out = printed("doctor")
    assert "environment       OPENBLAS_CORETYPE=Haswell\n" in out
    found = _record(printed, "doctor")["installation"]
    assert found["environment"] == {"OPENBLAS_CORETYPE": "Haswell"}
    assert found["instructions"] == LEVELS[max(each for each in levels_here() if each <= CHOSEN)]
    assert found["installer"] in out
    assert found["cores"] >= 1
    for name, text in found["packages"].items():
        assert f"{name:18s}{text or 'missing'}" in out
    assert Path(found["folder"]).samefile(Path(build.__file__).parents[1])


def test_doctor_fails_if_the_arithmetic_is_not_as_written(
    result_of: ResultOf, monkeypatch: Patch
) -> None:
    monkeypatch.setattr("pyharness._kernels.arithmetic_faults", lambda numbers: (1, 0))
    assert "arithmetic        results may be wrong: built with" in result_of(["doctor"], 1).out


@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="sets a register of x86-64"
)
def test_doctor_sees_that_subnormal_numbers_become_0() -> None:
    """As in a process that has loaded a library linked with -ffast-math."""
    assert build.installation()["arithmetic"] == build.AS_WRITTEN
    library, kept = ctypes.CDLL("libm.so.6"), ctypes.create_string_buffer(32)
    library.fegetenv(kept)
    changed = ctypes.create_string_buffer(kept.raw, 32)
    changed[29] = bytes([kept.raw[29] | 0x80])  # flush to zero, in the control register of SSE
    library.fesetenv(changed)
    try:
        found = build.installation()["arithmetic"]
    finally:
        library.fesetenv(kept)
    assert found == "subnormal numbers become 0: a library was linked with -ffast-math"
    assert build.installation()["arithmetic"] == build.AS_WRITTEN


def _python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False)


@pytest.mark.campaign
def test_as_a_module_and_as_a_command() -> None:
    for command in (["-m", "pyharness"], ["-c", "from pyharness.cli.main import main; main()"]):
        done = _python(*command, "defects")
        assert "stage-base" in done.stdout
        assert done.stderr == ""


def test_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -m pyharness run --case 3 --program two-term --steps 20000"
    command += " --format csv | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.stdout.startswith("time,")
    assert done.stderr == ""


def test_rooms_are_entered_only_when_needed(tmp_path: Path) -> None:
    """`import pyharness` loads no NumPy; a program's run loads neither SciPy nor matplotlib."""
    code = "import sys, pyharness; print('numpy' in sys.modules)"
    assert _python("-c", code).stdout == "False\n"
    code = (
        "import sys; from pyharness.cli.main import main; "
        "main(['run', '--case', '3', '--program', 'four-term', '--out', sys.argv[1]]); "
        "own = 'pyharness.checks.compare.comparison'; "
        "print([m for m in ('scipy', 'matplotlib', 'decimal', own) if m in sys.modules])"
    )
    assert _python("-c", code, str(tmp_path / "x")).stdout == "[]\n"


def test_constant_of_the_stop_test_reaches_compare(printed: Printed) -> None:
    for constant, steps in ((500.0, 25), (1e9, 100)):
        record = _record(printed, f"compare --case 2 --program runge-kutta --lipschitz {constant}")
        assert record["lipschitz"] == constant
        assert record["programs"][0]["steps"] == steps


@pytest.mark.parametrize(
    ("number", "text"),
    [(1.23e-3, "1.2e-3"), (-9.96e12, "-1.0e13"), (1.0, "1.0e0"), (0.0, "0"), (None, "-"),
     (float("inf"), "inf"), (float("-inf"), "-inf"), (float("nan"), "nan")],
)  # fmt: skip
def test_two_digits_of_a_number(number: float | None, text: str) -> None:
    assert short(number) == text


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [(KeyboardInterrupt(), 130, "interrupted"),
     (MemoryError(), 2, "not enough memory; use fewer steps"),
     (NotBuiltError("not built"), 3, "not built")],
)  # fmt: skip
def test_what_ends_a_run_has_an_exit_code(
    error: BaseException, code: int, words: str, capsys: Capture, monkeypatch: Patch
) -> None:
    def raises(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("pyharness.engine.solve.solve", raises)
    assert main(["run", "--case", "3", "--method", "taylor"]) == code
    assert capsys.readouterr().err == f"pyharness: {words}\n"


def test_json_of_a_scene_and_of_drifts_is_that_of_the_findings(
    printed: Printed, tmp_path: Path
) -> None:
    path = tmp_path / "x.toml"
    path.write_text(
        "[body]\nmoments = [4, 3, 2]\n[initial]\nomega = [1, 2, 3]\n[torque]\n"
        "sines = [{ amplitude = [1, 2, 3], frequency = 4 }]\n"
        "cosines = [{ amplitude = [5, 6, 7], frequency = 8 }]\n"
    )
    torque = _record(printed, f"run --scene {path} --program two-term")["scene"]["torque"]
    assert torque["sines"] == [{"amplitude": [1, 2, 3], "frequency": 4}]
    assert torque["cosines"] == [{"amplitude": [5, 6, 7], "frequency": 8}]
    for each in _record(printed, "compare --case 3 --program two-term")["programs"]:
        # Energy is a square's mean by moments, momentum by their squares: no run keeps both alike.
        assert each["energy_drift"] != each["momentum_drift"]
        if each["listing"]["label"] == "corrected":
            assert (each["order_state"], round(each["order"])) == ("as due", 2)


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("line", "wanted"),
    [("ver", "verify"), ("he", "help"), ("help ver", "verify"), ("run --me", "--method"),
     ("verify --listing", "--listing-output")],
)  # fmt: skip
def test_shell_completes_verbs_and_options(line: str, wanted: str, tmp_path: Path) -> None:
    found = tmp_path / "found"
    line = f"pyharness {line}"
    environment = {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_STDOUT_FILENAME": str(found), "COMP_LINE": line,
        "COMP_POINT": str(len(line)), "COMP_TYPE": "9", "IFS": "\v",
    }  # fmt: skip
    command = [sys.executable, "-m", "pyharness"]
    subprocess.run(command, env={**os.environ, **environment}, check=True)
    assert found.read_text().replace("\v", " ").split() == [wanted]


@pytest.mark.parametrize("command", ["verify --listing-output x", "claims --assignments"])
def test_only_formats_of_the_output_are_allowed(command: str, capsys: Capture) -> None:
    for form in ("csv", "junit"):
        assert main([*command.split(), "--format", form]) == 2
        assert capsys.readouterr().err.endswith(f"format '{form}'; allowed: table, json\n")


def test_old_names_of_options_stay_with_a_line(capsys: Capture) -> None:
    for old, new in (("--omega0 1,2,3", "--omega=1,2,3"), ("--omega0=-1,2,3", "--omega -1,2,3")):
        found = []
        for option in (old, new):
            assert main(f"run --case 5 --method auto --times 1 {option}".split()) == 0
            found.append(capsys.readouterr())
        assert found[0].out == found[1].out
        assert found[0].err.count("--omega0 is now --omega") == 1
        assert found[1].err == ""
    # An old name of another verb is unknown.
    assert main(["run", "--case", "5", "--methods", "auto", "--random", "3"]) == 2
    assert "unknown option '--random'" in capsys.readouterr().err


def test_a_scene_file_is_solved_by_auto_with_its_attitude(capsys: Capture, tmp_path: Path) -> None:
    path = tmp_path / "turned.toml"
    body = "[body]\nmoments = [40.0, 30.0, 20.0]\n[initial]\nomega = [0.0, 1.0, 1.0]\n"
    path.write_text(f"{body}attitude = [1.0, 0.0, 0.0, 0.0]\n")
    outputs = []
    for more in ([], ["--attitude"], ["--method", "auto", "--attitude", "quaternion"]):
        assert main(["run", "--scene", str(path), "--times", "1", *more]) == 0
        outputs.append(capsys.readouterr().out)
    assert "q0" in outputs[0]
    assert outputs[0] == outputs[1] == outputs[2]
    plans = []
    for times in ("1", "1,2"):
        assert main(["plan", "--case", "5", "--times", times]) == 0
        plans.append(capsys.readouterr().out)
    assert plans[0] != plans[1]
