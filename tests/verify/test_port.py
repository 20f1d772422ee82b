"""`verify --port`: ports that are right, wrong by a bit, silent, dead; the one in JavaScript."""

import json
import math
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpmath import mp

from pyharness import case_scene, run_program
from pyharness.cli.main import main
from pyharness.compare.checks import Check
from pyharness.compare.random_scenes import draw
from pyharness.model.listing import PROGRAMS, corrected, original
from pyharness.model.scene_file import case_numbers
from pyharness.original.cells import all_cells
from pyharness.verify.port import Cell, differences, port, port_cells
from pyharness.verify.port_process import PortError, PortProcess
from pyharness.verify.port_protocol import ENDINGS, Answer, read_answer, request

ROOT = Path(__file__).parent.parent.parent
WEB = ROOT / "web"
Capture = pytest.CaptureFixture[str]
# Ten cells: every program, every ending, a reading, the conjecture of Case 7.
SAMPLE = (
    "two-term/case-2/original", "two-term/case-6/original", "two-term/case-7/initial-torque",
    "two-term/case-3/corrected:c1-for-c", "four-term/case-5/original", "four-term/case-7/corrected",
    "runge-kutta/case-2/original", "runge-kutta/case-3/stage-base",
    "runge-kutta/case-6/corrected:do-variable", "runge-kutta/case-7/original",
)  # fmt: skip


def _cells(names: Sequence[str] = SAMPLE) -> list[Cell]:
    return port_cells(PROGRAMS, case_numbers(), names)


def _example() -> str:
    """Return the port that the documentation shows."""
    (text,) = re.findall(r"```py\n(.*?)```", (ROOT / "docs/ports.md").read_text(), re.DOTALL)
    return str(text)


def _python(path: Path, text: str) -> str:
    path.write_text(text)
    return shlex.join([sys.executable, str(path)])


def _answering(path: Path, change: str) -> str:
    """Return the command of the documented port, whose `rows` a line of Python changes."""
    before, place, after = _example().partition("    ier = ")
    return _python(path, f"{before}    {change}\n{place}{after}")


@pytest.fixture(params=["documented", "JavaScript"])
def right(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Return the command of a port that has the twins' bits."""
    if request.param == "JavaScript":
        return _node(WEB)
    return _python(tmp_path / "port.py", _example())


def _node(web: Path) -> str:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node on the PATH: the JavaScript is not held against the twins")
    return shlex.join([node, str(web / "port.js")])


def test_a_right_port_has_the_twins_bits(right: str) -> None:
    cells = _cells()
    assert len(cells) == len(SAMPLE)
    checks = list(port(right, cells))
    assert [check.id for check in checks] == [f"port/{name}" for name, _, _ in cells]
    assert [check.note for check in checks if not check.passed] == []
    assert {check.value for check in checks} == {0.0}


def test_the_javascript_has_the_twins_bits_in_random_scenes() -> None:
    """Orders of operations that no cell shows, velocity tested before omega among them."""
    seen = set()
    with PortProcess(_node(WEB)) as process:
        for number in range(200):
            drawn = draw("port", number)
            if drawn.scene.torque.sines or drawn.scene.torque.cosines:
                continue
            options = drawn.lipschitz, drawn.may_stop
            line = process.ask(request(drawn.scene, drawn.listing, *options))
            answer = read_answer(line, drawn.scene.steps)
            twin = run_program(drawn.scene, drawn.listing, "python", *options)
            assert differences(twin, answer) == [], number
            seen.add((drawn.listing.program, twin.ended))
    assert {ended for program, ended in seen if program == "runge-kutta"} == set(ENDINGS)
    assert {program for program, _ in seen} == set(PROGRAMS)


def test_all_cells_are_asked_for_but_where_fewer_are_named() -> None:
    assert len(port_cells(PROGRAMS, case_numbers(), ())) == len(list(all_cells()))
    assert {(listing.program, case) for _, listing, case in port_cells(["four-term"], [3], ())} == {
        ("four-term", 3)
    }
    assert [name for name, _, _ in _cells(["two-term/case-2/original"])] == [
        "two-term/case-2/original"
    ]


def test_one_bit_is_found_where_it_is(tmp_path: Path, capsys: Capture) -> None:
    cell = "two-term/case-2/original"
    bit = "rows[6][2] = math.nextafter(float.fromhex(rows[6][2]), math.inf).hex()"
    command = _answering(tmp_path / "port.py", f"import math; {bit}")
    assert main(["verify", "--port", command, "--cell", cell, "--format", "json"]) == 1
    (check,) = json.loads(capsys.readouterr().out)["checks"]
    assert check["note"].startswith("first at step 7, U2: 1 ulp (0x")
    assert check["value"] == 1.0
    assert check["limit"] == 0.0
    words = shlex.split(check["replay"])
    assert words[:3] == ["python", "-m", "pyharness"]
    assert words[3:] == ["verify", "--port", command, "--cell", cell]
    assert main(words[3:]) == 1
    assert "step 7, U2" in " ".join(capsys.readouterr().out.split())


def _found(change: dict[str, Any], program: str = "runge-kutta", case: int = 3) -> list[str]:
    twin = run_program(case_scene(case), original(program), "python")
    assert twin.velocity is not None
    rows = np.column_stack([twin.recorded_time, twin.omega, twin.velocity])
    ier = None if twin.ier is None else twin.ier.tolist()
    return differences(twin, replace(Answer(rows, twin.ended, twin.stop, ier), **change))


def test_endings_count_as_rows_do() -> None:
    twin = run_program(case_scene(3), original("runge-kutta"), "python")
    assert twin.stop is not None
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
    answer = read_answer(json.dumps(FINE).encode(), 2)
    first = answer.rows[0]
    assert first[:3].tolist() == [0.01, 1.0, 3.0]
    assert math.copysign(1.0, first[3]) == -1.0
    assert math.isinf(first[4])
    assert math.isnan(first[5])
    stopped = read_answer(json.dumps({**FINE, "ended": "stopped", "stop": STOP}).encode(), 9)
    assert stopped.stop is not None
    assert stopped.stop.quotient == math.inf


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rows": [ROW]}, "1 rows of a run of 2 steps that ended 'complete'"),
        ({"rows": [ROW] * 3}, "3 rows of a run of 2 steps"),
        ({"rows": None}, "rows: nothing where a list belongs"),
        ({"rows": [ROW, 3]}, "row 2: a whole number where a list belongs"),
        ({"rows": [ROW, ROW[:6]]}, "row 2 has 6 numbers; it takes 7: TIME U1"),
        ({"rows": [ROW, [*ROW[:6], None]]}, "row 2: nothing where a number belongs"),
        ({"rows": [ROW, [*ROW[:6], True]]}, "row 2: true or false where a number belongs"),
        ({"rows": [ROW, [*ROW[:6], "one"]]}, 'row 2: "one" is no number'),
        ({"rows": [ROW, [*ROW[:6], "0xgg"]]}, 'row 2: "0xgg" is no number'),
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
    ],
)
def test_what_is_no_answer_is_told_in_a_line(change: dict[str, Any], words: str) -> None:
    with pytest.raises(PortError, match=re.escape(words)):
        read_answer(json.dumps({**FINE, **change}).encode(), 2)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"step 1", "no JSON: 'step 1'"), (b"", "no JSON: ''"), (b"\xff\x00", "no JSON: "),
        (b"[" * 100_000, "no JSON: "), (b"3", "a whole number where an object belongs"),
        (b"9" * 5000, "no JSON: "), (b'{"rows": []}', "no 'ended'; an answer has rows"),
    ],
)  # fmt: skip
def test_what_is_no_object_is_told_in_a_line(line: bytes, words: str) -> None:
    with pytest.raises(PortError, match=re.escape(words)) as caught:
        read_answer(line, 2)
    assert len(str(caught.value)) < 250


def _answers_wrongly(command: str) -> Check:
    checks = list(port(command, _cells(), patience=2.0))
    assert not checks[-1].passed
    assert checks[-1].value is None
    return checks[-1]


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("input(); print('hello', flush=True); input()", "no JSON: 'hello'"),
        ("input(); print('{}\\n{}', flush=True); input()", "more than one line for one run"),
        ("import time; time.sleep(60)", "no answer within 2 s"),
        (
            "input(); raise ValueError('lost')",
            "exit code 1 before it had answered: ValueError: lost",
        ),
        ("raise SystemExit(0)", "it ended with exit code 0 before it had answered"),
        ("import os; os.kill(os.getpid(), 9)", "it ended by signal 9 before it had answered"),
        ("import os, time; os.close(1); time.sleep(60)", "it closed its input or output"),
        ("while True: print('x' * 4096, end='')", "more than 64 MB for one run"),
    ],
)
def test_a_port_that_does_not_answer(script: str, words: str, tmp_path: Path) -> None:
    check = _answers_wrongly(_python(tmp_path / "port.py", script))
    assert words in check.note
    assert check.id == f"port/{_cells()[0][0]}"


def test_too_few_rows_and_a_crash_later_end_the_checks(tmp_path: Path, capsys: Capture) -> None:
    command = _answering(tmp_path / "port.py", "del rows[50:]")
    assert main(["verify", "--port", command, "--program", "two-term", "--case", "2"]) == 1
    captured = capsys.readouterr()
    assert captured.err == ""
    told = " ".join(captured.out.split())
    assert "50 rows of a run of 100 steps that ended 'complete'" in told
    assert "ended at the first of 16 cells that it did not answer" in told


@pytest.mark.parametrize("command", ["no-such-port-here", "/"])
def test_a_command_that_is_not_there_is_a_line_and_exit_1(command: str, capsys: Capture) -> None:
    assert main(["verify", "--port", command]) == 1
    captured = capsys.readouterr()
    assert captured.err == ""
    assert f"FAILED port/start ('{command}' can't be started: " in captured.out
    assert f"  python -m pyharness verify --port {command}\n" in captured.out


def _gone(pid: int) -> bool:
    end = time.monotonic() + 5.0
    while time.monotonic() < end:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        # One that nobody has waited for has ended, too.
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
        asked = json.loads(request(case_scene(case), corrected("runge-kutta")))
        assert tuple(asked["scene"]["body"]["moments"]) == case_scene(case).moments
        assert asked["scene"]["masses"] == [100.0, 110.0, 120.0]
        assert asked["lipschitz"] == 500.0
    assert asked["scene"]["initial_torque"] is not None


# File, what stands there, the fault, and in which of the programs it shows.
FAULTS = {
    "the control": ("equations.js", "m[0] + a *", "m[0] + a *", ""),
    "a sign": ("equations.js", "m[2] + c * u[0]", "m[2] - c * u[0]", "two-term four-term"),
    "another order": (
        "runge-kutta.js", "2 * (slope[2][i] + slope[3][i])", "2 * slope[2][i] + 2 * slope[3][i]",
        "runge-kutta",
    ),
    "the points of the stop test": (
        "runge-kutta.js", "distances(result, base)", "distances(result, firstPoint)",
        "runge-kutta",
    ),
    "a defect forgotten": ("two-term.js", '"c1-for-c"', '"no-such"', "two-term"),
    "a point of collocation": ("four-term.js", "dt * 0.6", "dt * 0.60000001", "four-term"),
    "a multiplier": (
        "linear-solver.js", "a[i][j] / a[j][j]", "a[i][j] * (1 / a[j][j])", "four-term",
    ),
    "IER": ("linear-solver.js", "b)), 0]", "b)), 1]", "two-term four-term"),
    "sine": (
        "circular.js", "turned(x, 0)", "turned(x, 0) * 1.001", "two-term four-term runge-kutta",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_javascript_is_found(fault: str, tmp_path: Path) -> None:
    name, here, planted, shows = FAULTS[fault]
    web = Path(shutil.copytree(WEB, tmp_path / "web"))
    path = web / "programs" / name
    text = path.read_text()
    assert text.count(here) == 1
    path.write_text(text.replace(here, planted))
    failed = [check for check in port(_node(web), _cells()) if not check.passed]
    assert all("step" in check.note or "stop" in check.note for check in failed)
    assert {check.id.split("/")[1] for check in failed} == set(shows.split())


def test_sine_and_cosine_of_the_javascript_are_the_nearest_floats() -> None:
    node = shlex.split(_node(WEB))[0]
    draw = random.Random(1982)
    angles = [draw.uniform(-1.0, 1.0) * 10.0 ** draw.uniform(-9.0, 8.0) for _ in range(20_000)]
    # Close to a multiple of a quarter turn, where digits cancel.
    angles += [n * (math.pi / 2) for n in range(-500, 500)]
    angles += [0.0, -0.0, 1e-300, 2.0**-27, 29.2, 112.60000000000004, 170.00000000000006]
    script = (
        f"import {{ sine, cosine }} from {json.dumps(str(WEB / 'programs/circular.js'))};"
        'import { readFileSync } from "node:fs";'
        "console.log(JSON.stringify(JSON.parse(readFileSync(0)).map((x) => [sine(x), cosine(x)])));"
    )
    done = subprocess.run(
        [node, "--input-type=module", "--eval", script],
        input=json.dumps(angles), capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = json.loads(done.stdout)
    assert len(found) == len(angles)
    with mp.workprec(300):
        wanted = [[float(mp.sin(x)), float(mp.cos(x))] for x in map(mp.mpf, angles)]
    assert found == wanted
