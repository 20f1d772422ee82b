"""TAPE5: the records of a run, read back by SciPy, bit for bit."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from pyharness import case_scene
from pyharness.cli.main import main
from pyharness.history.tape5 import records
from pyharness.model.listing import PROGRAMS, original
from pyharness.original import compiled


def _read_tape(content: bytes, tmp_path: Path) -> np.ndarray:
    from scipy.io import FortranFile

    path = tmp_path / "TAPE5"
    path.write_bytes(content)
    with FortranFile(path, "r", header_dtype="<u4") as tape:
        return np.array([tape.read_reals("<f8") for _ in range(len(content) // 64)])


@pytest.mark.parametrize("program", PROGRAMS)
def test_tape_is_read_back_bit_for_bit(program: str, tmp_path: Path) -> None:
    out = tmp_path / "tape"
    arguments = ["run", "--case", "5", "--format", "tape5", "--program", program]
    assert main([*arguments, "--out", str(out)]) == 0
    run = compiled.run(case_scene(5), original(program))
    assert run.velocity is not None
    wanted = np.hstack([run.recorded_time[:, None], run.omega, run.velocity])
    assert _read_tape(out.read_bytes(), tmp_path).tobytes() == wanted.tobytes()
    assert out.stat().st_size == len(wanted) * (7 * 8 + 2 * 4)


def test_tape_records_what_the_program_called_time(tmp_path: Path) -> None:
    """TIME of the collocation programs runs away from n h, and the tape has it."""
    run = compiled.run(case_scene(2), original("two-term"))
    time = _read_tape(records(run), tmp_path)[:, 0]
    assert time[9] == pytest.approx(0.01 * 55)


def test_tape_goes_through_a_pipe_and_not_to_a_terminal(
    capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["run", "--case", "3", "--program", "runge-kutta", "--format", "tape5"]
    assert main(arguments) == 0
    wanted = records(compiled.run(case_scene(3), original("runge-kutta")))
    assert capsysbinary.readouterr().out == wanted

    class Terminal(BytesIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr("sys.stdout", Terminal())
    assert main(arguments) == 2
    captured = capsysbinary.readouterr()
    assert captured.err.count(b"\n") == 1
    assert b"give --out FILE" in captured.err
