"""The printer page: widths, columns and asterisks, compared with a Fortran compiler."""

import math
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pyharness import Scene, Trajectory, case_scene
from pyharness.cli.main import main
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis import compiled
from pyharness.thesis.printer import formats_of, page, write

Capture = pytest.CaptureFixture[str]
# Only gfortran has options for a zero without sign and for rounding ties away from zero.
COMPILER = os.environ.get("FC", "") if "gfortran" in os.environ.get("FC", "") else "gfortran"


def _page(program: str, case: int, capsys: Capture, *options: str) -> list[str]:
    arguments = ["run", "--case", str(case), "--format", "printer", "--program", program]
    assert main([*arguments, *options]) == 0
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(("program", "heads", "columns"), [
    ("two-term", [5, 25, 45, 63, 80, 102, 124], [1, 21, 41, 56, 73, 93, 113]),
    ("four-term", [5, 25, 45, 63, 80, 102, 124], [1, 21, 41, 56, 69, 89, 109]),
    ("runge-kutta", [0, 20, 40, 60, 71, 91, 111], [0, 20, 40, 60, 71, 91, 111]),
])  # fmt: skip
def test_page(program: str, heads: list[int], columns: list[int], capsys: Capture) -> None:
    """Each program has its own formats; in one, four places for six values leave an empty line."""
    lines = _page(program, 5, capsys)
    collocation = program != "runge-kutta"
    above = 4 if collocation else 5
    assert lines[:3] == ["  40.00     100.00", "  30.00     200.00", "  20.00     150.00"]
    assert [word.start() for word in re.finditer(r"\w+", lines[above - 1])] == heads
    run = compiled.run(case_scene(5), Listing.original(program))
    assert run.velocity is not None
    assert len(lines) == above + run.steps  # the last row is the step of the stop
    row = lines[above + 24]
    assert len(row.split()) == 7 + collocation
    for column, value in zip(columns, (*run.omega[24], 25, *run.velocity[24]), strict=True):
        text = f"{value:3d}" if value == 25 else f"{value:10.4f}"
        assert row[column : column + len(text)] == text


def test_what_does_not_fit_is_asterisks() -> None:
    scene = replace(case_scene(5), moments=(1234.5, 0.004, 999.996))
    stars, nothing, ier = "*" * 10, np.zeros(1), np.array([129], np.int32)
    omega = np.array([[99999.99994, 99999.99996, -9999.99994]])
    velocity = np.array([[-9999.99996, math.nan, -math.inf]])
    run = Trajectory(nothing, nothing, omega, velocity, 1, 0, ier=ier)
    lines = page(scene, "two-term", run).splitlines()
    assert lines[:3] == [" ******     100.00", "   0.00     200.00", " ******     150.00"]
    row = f" 99999.9999          {stars}          -9999.9999       1   **         "
    assert lines[4] == row + "          ".join([stars] * 3)


def test_long_runs_and_overflow_end_in_asterisks(capsys: Capture) -> None:
    lines = _page("four-term", 2, capsys, "--steps", "1001")
    assert [line.split()[3] for line in lines[-3:]] == ["999", "***", "***"]
    lines = _page("two-term", 6, capsys)
    assert len(lines) == 4 + 56
    assert lines[-1].count("*") == 60
    # A case shows the torques of its cards, and a scene of the user those of its law.
    assert _page("two-term", 6, capsys)[0] == " 200.00     100.00"
    mine = Scene("mine", (1.0, 2.0, 3.0), moments=(3.0, 2.0, 1.5), steps=1)
    run = compiled.run(mine, Listing.original("four-term"))
    assert page(mine, "four-term", run).splitlines()[0] == "   3.00       0.00"


@pytest.mark.parametrize(("value", "width", "decimals", "wanted"), [
    (0.00005, 10, 4, "0.0001"),  # binary64 holds a little more than the tie
    (0.00015, 10, 4, "0.0001"),  # and a little less here
    (0.03125, 10, 4, "0.0313"),  # an exact tie is rounded away from zero
    (-0.03125, 10, 4, "-0.0313"), (-0.00001, 10, 4, "0.0000"), (-0.0, 10, 4, "0.0000"),
    (0.25, 3, 2, ".25"), (-0.25, 4, 2, "-.25"), (2.5, 4, 0, "3."),
    (1e22, 40, 4, "10000000000000000000000.0000"),
])  # fmt: skip
def test_rounding(value: float, width: int, decimals: int, wanted: str) -> None:
    assert write(f"(F{width}.{decimals})", [value]) == [wanted.rjust(width)]


def test_format_is_read_as_fortran_reads_it() -> None:
    """The carriage-control character, which is taken off, is always a blank."""
    assert write("(1X,3HA,B,1X,2F4.1)", [1, 2]) == [" A,B  1.0 2.0"]
    assert write("(I2,/,I3)", [1, 2, 3]) == [" 1", "  2", " 3", ""]
    assert write("(4HTIME)", []) == ["TIME"]
    for entry in facts("printer")["program"]:
        for name in ("header", "heads", "rows"):
            assert re.match(r"\(\d+X,", entry[name])
            assert all(record[:1] in ("", " ") for record in write(entry[name], []))


def _punched(number: int, text: str) -> str:
    """Return a FORMAT as punched on cards, 66 columns a card."""
    statement = f"FORMAT{text}"
    parts = [statement[i : i + 66] for i in range(0, len(statement), 66)]
    return f"{number:5d} {parts[0]}\n" + "".join(f"     C{part}\n" for part in parts[1:])


@pytest.mark.external
@pytest.mark.skipif(shutil.which(COMPILER) is None, reason="no compiler")
@pytest.mark.parametrize("program", PROGRAMS)
def test_page_is_what_a_fortran_compiler_writes(program: str, tmp_path: Path) -> None:
    """The same FORMATs, compiled from cards: F77 has no negative zero, and ties go away from 0."""
    generator = np.random.default_rng(1982)
    n = 400
    sizes = 10.0 ** generator.uniform(-6, 6, size=(2, n, 3))
    omega, velocity = generator.normal(size=(2, n, 3)) * sizes
    omega[0], omega[1] = (0.03125, -0.03125, 99999.99995), (-1e-9, 0.99996, -0.5)
    ier = generator.choice([0, 129], size=n).astype(np.int32)
    collocation = program != "runge-kutta"
    no_time = np.zeros(n)
    run = Trajectory(no_time, no_time, omega, velocity, n, 0, ier=ier if collocation else None)
    scene = replace(case_scene(5), moments=(12345.0, 0.125, 20.0))
    (tmp_path / "numbers").write_bytes(np.hstack([omega, velocity]).tobytes())
    (tmp_path / "ier").write_bytes(ier.tobytes())
    formats = formats_of(program)
    integers = "L,IER" if collocation else "L"
    source = (
        "      PROGRAM P\n      REAL(8) W(6)\n"
        "      OPEN(5,FILE='numbers',ACCESS='STREAM')\n"
        "      OPEN(7,FILE='ier',ACCESS='STREAM')\n"
        "      OPEN(6,FILE='page',ROUND='COMPATIBLE')\n"
        "      WRITE(6,1)12345.D0,100.D0,.125D0,200.D0,20.D0,150.D0\n"
        "      WRITE(6,4)\n"
        f"      DO 100 L=1,{n},1\n      READ(5)W\n      READ(7)IER\n"
        f"      WRITE(6,5)W(1:3),{integers},W(4:6)\n  100 CONTINUE\n      CLOSE(6)\n"
        + _punched(1, formats["header"])
        + _punched(4, formats["heads"])
        + _punched(5, formats["rows"])
        + "      END\n"
    )
    (tmp_path / "p.f").write_text(source)
    command = [COMPILER, "-std=gnu", "-w", "-fno-sign-zero", "-o", "p", "p.f"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    subprocess.run([tmp_path / "p"], cwd=tmp_path, check=True)
    written = [line[1:].rstrip() for line in (tmp_path / "page").read_text().splitlines()]
    assert page(scene, program, run).splitlines() == written
    assert sum("*" in line for line in written) > 100


def test_page_goes_to_a_file_and_both_languages_print_it(capsys: Capture, tmp_path: Path) -> None:
    fortran = "\n".join(_page("four-term", 2, capsys))
    out = tmp_path / "page"
    assert not _page("four-term", 2, capsys, "--implementation", "python", "--out", str(out))
    assert out.read_text().rstrip("\n") == fortran
