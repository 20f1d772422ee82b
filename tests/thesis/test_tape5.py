"""TAPE5: the records of a run, read back by SciPy, bit for bit."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import FortranFile

from pyharness import case_scene
from pyharness.cli.main import main
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis import compiled
from pyharness.thesis.printer import tape5


@pytest.mark.parametrize("program", PROGRAMS)
def test_tape_is_read_back_bit_for_bit(program: str, tmp_path: Path) -> None:
    out = tmp_path / "tape"
    assert main(f"run --case 5 --format tape5 --program {program} --out {out}".split()) == 0
    run = compiled.run(case_scene(5), Listing.original(program))
    assert run.velocity is not None
    wanted = np.hstack([run.recorded_time[:, None], run.omega, run.velocity])
    with FortranFile(out, "r", header_dtype="<u4") as tape:
        rows = [tape.read_reals("<f8") for _ in wanted]
    assert np.array(rows).tobytes() == wanted.tobytes()
    assert out.stat().st_size == len(wanted) * (7 * 8 + 2 * 4)
    if program == "two-term":  # TIME of the collocation programs differs more and more from n h
        assert rows[9][0] == pytest.approx(0.01 * 55)


def test_tape_goes_through_a_pipe_and_not_to_a_terminal(
    capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["run", "--case", "3", "--program", "runge-kutta", "--format", "tape5"]
    assert main(arguments) == 0
    wanted = tape5(compiled.run(case_scene(3), Listing.original("runge-kutta")))
    assert capsysbinary.readouterr().out == wanted
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert main(arguments) == 2
    assert b"--out" in capsysbinary.readouterr().err
