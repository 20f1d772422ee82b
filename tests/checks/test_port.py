"""`verify --port`: ports that are right, wrong by a bit, silent or crashing."""

import json
import math
import os
import re
import shlex
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import case_scene, run_program
from pyharness.checks.port import differences, port, port_cells
from pyharness.checks.port_process import PortError, PortProcess
from pyharness.checks.port_protocol import Answer, read_answer, request
from pyharness.cli.main import main
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene_file import case_numbers
from pyharness.thesis.cells import all_cells
from tests.conftest import Capture, ResultOf
from tests.ports import ROOT, SAMPLE, WEB, answering, documented, node, sample


def _python(path: Path, text: str) -> str:
    path.write_text(text)
    return shlex.join([sys.executable, str(path)])


@pytest.fixture(params=["documented", "JavaScript"])
def right(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Return the command of a port that is bit-for-bit identical to the twins."""
    if request.param == "JavaScript":
        return node(WEB)
    return _python(tmp_path / "port.py", documented())


def test_a_right_port_has_the_twins_bits(right: str) -> None:
    cells = sample()
    assert len(cells) == len(SAMPLE)
    checks = list(port(right, cells))
    assert [check.id for check in checks] == [f"port/{cell.name}" for cell in cells]
    assert [check.note for check in checks if not check.passed] == []
    assert {check.value for check in checks} == {0.0}


def test_all_cells_are_asked_for_but_where_fewer_are_named() -> None:
    assert len(port_cells(PROGRAMS, case_numbers(), ())) == len(list(all_cells()))
    cells = port_cells(["four-term"], [3], ())
    assert {(cell.listing.program, cell.scene.case) for cell in cells} == {("four-term", 3)}
    (cell,) = sample(["two-term/case-2/original"])
    assert cell.name == "two-term/case-2/original"


def _found(change: dict[str, Any], program: str = "runge-kutta", case: int = 3) -> list[str]:
    twin: Any = run_program(case_scene(case), Listing.original(program), "python")
    rows = np.column_stack([twin.recorded_time, twin.omega, twin.velocity])
    ier = None if twin.ier is None else twin.ier.tolist()
    return differences(twin, replace(Answer(rows, twin.ended, twin.stop, ier), **change))


def test_endings_count_as_rows_do() -> None:
    twin: Any = run_program(case_scene(3), Listing.original("runge-kutta"), "python")
    assert _found({}) == []
    assert _found({"stop": replace(twin.stop, step=3)})[0].startswith("stop: Stop(step=3")
    quotient = math.nextafter(twin.stop.quotient, math.inf)
    assert _found({"stop": replace(twin.stop, quotient=quotient)})[0].startswith("stop: ")
    assert _found({"ended": "overflow"}) == ["ended: overflow, due stopped"]
    assert _found({"rows": np.zeros((0, 7))}) == ["rows: 0, due 24"]
    assert _found({"ier": [0] * 24}) == ["ier: due null"]
    assert _found({}, "two-term") == []
    assert _found({"ier": None}, "two-term") == ["ier: due 100 values"]
    assert _found({"ier": [0, 0, 129, 129]}, "two-term") == ["IER at step 3: 129, due 0"]


ROW = [0.01, 1, "0x1.8p+1", "-0.0", "inf", "nan", 1e300]
FINE = {"rows": [ROW, ROW], "ended": "complete", "stop": None, "ier": [0, 129]}
STOP = {"step": 2, "variable": "V2", "quotient": "inf"}


def test_numbers_are_read_in_every_form() -> None:
    first = read_answer(json.dumps(FINE).encode(), 2).rows[0]
    assert first[:3].tolist() == [0.01, 1.0, 3.0]
    assert math.copysign(1.0, first[3]) == -1.0
    assert math.isinf(first[4])
    assert math.isnan(first[5])
    stopped: Any = read_answer(json.dumps({**FINE, "ended": "stopped", "stop": STOP}).encode(), 9)
    assert stopped.stop.quotient == math.inf


@pytest.mark.parametrize(("change", "words"), [
    ({"rows": [ROW]}, "1 rows of a run of 2 steps that ended 'complete'"),
    ({"rows": [ROW] * 3}, "3 rows of a run of 2 steps"),
    ({"rows": None}, "rows: nothing where a list belongs"),
    ({"rows": [ROW, 3]}, "row 2: a whole number where a list belongs"),
    ({"rows": [ROW, ROW[:6]]}, "row 2 has 6 numbers; it takes 7: TIME U1"),
    ({"rows": [ROW, [*ROW[:6], None]]}, "row 2: nothing where a number belongs"),
    ({"rows": [ROW, [*ROW[:6], True]]}, "row 2: true or false where a number belongs"),
    ({"rows": [ROW, [*ROW[:6], "one"]]}, 'row 2: "one" is no number'),
    ({"rows": [ROW, [*ROW[:6], "0xgg"]]}, 'row 2: "0xgg" is no number'),
    ({"rows": [ROW, [*ROW[:6], "1_0"]]}, 'row 2: "1_0" is no number'),
    ({"rows": [ROW, [*ROW[:6], 10**400]]}, "is no number of binary64"),
    ({"ended": "done"}, 'ended is "done"; allowed: complete, stopped, overflow'),
    ({"ended": ["complete"]}, "ended is"),
    ({"ended": "stopped"}, "ended 'stopped' with no stop"),
    ({"stop": STOP}, "ended 'complete' with a stop"),
    ({"ended": "stopped", "stop": {**STOP, "variable": "W1"}}, 'stop variable "W1"'),
    ({"ended": "stopped", "stop": {**STOP, "variable": []}}, "stop variable []"),
    ({"ended": "stopped", "stop": {**STOP, "step": "2"}}, "stop step: text where a whole"),
    ({"ended": "stopped", "stop": {"step": 2}}, "stop is no object with step"),
    ({"ended": "stopped", "stop": 3}, "stop is no object with step"),
    ({"ier": [0]}, "1 values of ier with 2 rows"),
    ({"ier": [0, 0.5]}, "ier: a number where a whole number belongs"),
])  # fmt: skip
def test_what_is_no_answer_is_told_in_a_line(change: dict[str, Any], words: str) -> None:
    with pytest.raises(PortError, match=re.escape(words)):
        read_answer(json.dumps({**FINE, **change}).encode(), 2)


@pytest.mark.parametrize(("line", "words"), [
    (b"step 1", "no JSON: 'step 1'"), (b"", "no JSON: ''"), (b"\xff\x00", "no JSON: "),
    (b"[" * 100_000, "no JSON: "), (b"3", "a whole number where an object belongs"),
    (b"9" * 5000, "no JSON: "), (b'{"rows": []}', "no 'ended'; an answer has rows"),
    (b'{"rows": [], "ended": "complete", "rows": [[]]}', 'the key "rows" occurs twice'),
    (b'{"stop": {"step": 1, "step": 2}}', 'the key "step" occurs twice'),
    (b'{"rows": [[NaN]]}', "NaN is not JSON"), (b"[-Infinity]", "-Infinity is not JSON"),
])  # fmt: skip
def test_what_is_no_object_is_told_in_a_line(line: bytes, words: str) -> None:
    with pytest.raises(PortError, match=re.escape(words)) as caught:
        read_answer(line, 2)
    assert len(str(caught.value)) < 250


@pytest.mark.sampled
@pytest.mark.parametrize(("script", "words"), [
    ("input(); print('hello', flush=True); input()", "no JSON: 'hello'"),
    ("input(); print('{}\\n{}', flush=True); input()", "more than one line for one run"),
    ("import time; time.sleep(60)", "no answer within 2 s"),
    ("input(); raise ValueError('lost')", "1 before it had answered: ValueError: lost"),
    ("raise SystemExit(0)", "it ended with exit code 0 before it had answered"),
    ("import os; os.kill(os.getpid(), 9)", "it ended by signal 9 before it had answered"),
    ("import os, time; os.close(1); time.sleep(60)", "it closed its input or output"),
    ("while True: print('x' * 4096, end='')", "more than 64 MB for one run"),
])  # fmt: skip
def test_a_port_that_does_not_answer(script: str, words: str, tmp_path: Path) -> None:
    *_, check = port(_python(tmp_path / "port.py", script), sample(), patience=2.0)
    assert (check.passed, check.value) == (False, None)
    assert words in check.note
    assert check.id == f"port/{sample()[0].name}"


@pytest.mark.campaign
def test_too_few_rows_and_a_crash_later_end_the_checks(tmp_path: Path, result_of: ResultOf) -> None:
    command = answering(tmp_path / "port.py", "del rows[50:]")
    captured = result_of(["verify", "--port", command, "--program", "two-term", "--case", "2"], 1)
    assert captured.err == ""
    told = " ".join(captured.out.split())
    assert "50 rows of a run of 100 steps that ended 'complete'" in told
    assert "ended at the first of 32 cells that it did not answer" in told


@pytest.mark.parametrize("command", ["no-such-port-here", "/"])
def test_a_command_that_is_not_there_is_a_line_and_exit_1(command: str, capsys: Capture) -> None:
    assert main(["verify", "--port", command]) == 1
    captured = capsys.readouterr()
    assert captured.err == ""
    assert f"FAILED port/start ('{command}' can't be started: " in captured.out
    assert f"  python -m pyharness verify --port {command}\n" in captured.out


@pytest.mark.parametrize("more", [[], ["--self-test"]])
def test_an_integrator_is_sent_to_its_option(more: list[str], result_of: ResultOf) -> None:
    command = shlex.join([sys.executable, str(ROOT / "docs/how-to/integrator/rk4.py")])
    assert "--integrator" in result_of(["verify", "--port", command, *more], 2).err


def _gone(pid: int) -> bool:
    end = time.monotonic() + 5.0
    while time.monotonic() < end:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        # A zombie, for which nobody has waited, has ended too.
        status = Path(f"/proc/{pid}/stat")
        if status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z":
            return True
        time.sleep(0.01)
    return False


def test_a_port_and_what_it_started_are_ended(tmp_path: Path) -> None:
    script = (
        "import subprocess, time\n"
        "child = subprocess.Popen(['sleep', '60'])\n"
        "input(); print(child.pid, flush=True); time.sleep(60)"
    )

    def started() -> Iterator[int]:
        with PortProcess(_python(tmp_path / "port.py", script)) as process:
            yield int(process.ask(b"who?"))
            raise KeyboardInterrupt

    running = started()
    child = next(running)
    os.kill(child, 0)
    with pytest.raises(KeyboardInterrupt):
        next(running)
    assert _gone(child)


def test_requests_give_the_floats_back() -> None:
    for case in case_numbers():
        asked = json.loads(request(case_scene(case), Listing.corrected("runge-kutta")))
        assert tuple(asked["scene"]["body"]["moments"]) == case_scene(case).moments
        assert asked["scene"]["masses"] == [100.0, 110.0, 120.0]
        assert asked["lipschitz"] == 500.0
    assert asked["scene"]["initial_torque"] is not None


def test_what_leaves_the_group_of_a_port_is_ended_too(tmp_path: Path) -> None:
    """Regression test: an orphaned grandchild in its own session outlived the check."""
    script = (
        "import os, sys, time\n"
        "if os.fork() == 0:\n"
        "    os.setsid()\n"
        "    if os.fork():\n"
        "        os._exit(0)\n"
        "    os.execvp('sh', ['sh', '-c', 'read line; echo $$; exec sleep 60'])\n"
        "os.wait(); time.sleep(60)"
    )
    with PortProcess(_python(tmp_path / "port.py", script)) as process:
        child = int(process.ask(b"who?"))
        os.kill(child, 0)
        assert os.getsid(child) != os.getsid(process._process.pid)
    assert _gone(child)


def test_a_port_may_complain_without_end(tmp_path: Path) -> None:
    """Regression test: stderr went to a file that filled the disk; now only its end is kept."""
    script = (
        "import sys\n"
        "for i in range(3000): print('x' * 1000, file=sys.stderr)\n"
        "print(input(), flush=True)\n"
        "print('error: the last word', file=sys.stderr); input(); sys.exit(3)"
    )
    with PortProcess(_python(tmp_path / "port.py", script)) as process:
        assert process.ask(b"who?") == b"who?"
        assert 0 < len(process._told) <= 1 << 16
        with pytest.raises(PortError, match=r"exit code 3 .*: error: the last word"):
            process.ask(b"and?")
