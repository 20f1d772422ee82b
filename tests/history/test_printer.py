"""The printer page: widths, columns and asterisks, held against a Fortran compiler."""

import math
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import case_scene
from pyharness.cli.main import main
from pyharness.history.fortran_format import write
from pyharness.history.printer import formats_of, page
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, original
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.original import compiled

Capture = pytest.CaptureFixture[str]
# Only gfortran can be told that zero has no sign and that a tie goes away from it.
COMPILER = os.environ.get("FC", "") if "gfortran" in os.environ.get("FC", "") else "gfortran"
PRINTER = ["run", "--case", "2", "--format", "printer", "--program"]


def _page(program: str, case: int, capsys: Capture, *options: str) -> list[str]:
    arguments = ["run", "--case", str(case), "--format", "printer", "--program", program]
    assert main([*arguments, *options]) == 0
    return capsys.readouterr().out.splitlines()


def _row(
    omega: list[float], velocity: list[float], ier: int | None = 0, steps: int = 1
) -> Trajectory:
    return Trajectory(
        time=np.zeros(steps),
        recorded_time=np.zeros(steps),
        omega=np.array([omega] * steps),
        velocity=np.array([velocity] * steps),
        steps=steps,
        evaluations=0,
        ier=None if ier is None else np.full(steps, ier, dtype=np.int32),
    )


def test_page_of_the_two_term_program(capsys: Capture) -> None:
    lines = _page("two-term", 5, capsys)
    assert lines[:3] == ["  40.00     100.00", "  30.00     200.00", "  20.00     150.00"]
    heads = {6: "U1", 26: "U2", 46: "U3", 64: "I", 81: "V1", 103: "V2", 125: "V3"}
    # Columns of the records count from 1, and the first is the carriage control.
    assert {column: lines[3][column - 1 :].split()[0] for column in heads} == heads
    assert lines[3].split() == list(heads.values())
    assert len(lines) == 4 + 100
    row = compiled.run(case_scene(5), original("two-term"))
    u, v = row.omega[41], row.velocity[41]  # type: ignore[index]
    assert lines[45] == (
        f" {u[0]:10.4f}          {u[1]:10.4f}          {u[2]:10.4f}      42    0         "
        f"{v[0]:10.4f}          {v[1]:10.4f}          {v[2]:10.4f}"
    )


def test_first_rows_are_those_of_the_known_solution(capsys: Capture) -> None:
    """Case 2 to four decimals, from sin 5t, cos 5t and 10 and nothing else."""
    lines = _page("four-term", 2, capsys)
    for step in (1, 2, 100):
        u1, u2, u3, number, ier, *_ = lines[3 + step].split()
        assert (u3, number, ier) == ("10.0000", str(step), "0")
        assert abs(float(u1) - math.sin(0.05 * step)) < 3e-3
        assert abs(float(u2) - math.cos(0.05 * step)) < 3e-3


def test_each_program_has_formats_of_its_own(capsys: Capture) -> None:
    starts = {"two-term": 74, "four-term": 70, "runge-kutta": 72}
    for program, start in starts.items():
        line = _page(program, 5, capsys)[-1]
        velocity = line[start - 1 : start + 9]
        assert len(velocity) == 10
        assert float(velocity) == float(line.split()[-3])
        assert line[start - 2] == line[start + 9] == " "


def test_page_of_the_runge_kutta_program(capsys: Capture) -> None:
    """Four places for six values leave an empty line; no IER; the last row is that of the stop."""
    lines = _page("runge-kutta", 2, capsys)
    assert lines[:4] == [*["  40.00       0.00"] * 2, "  20.00       0.00", ""]
    assert [lines[4].index(name) for name in ("U1", "U2", "U3", "I", "V1", "V2", "V3")] == [
        0, 20, 40, 60, 71, 91, 111,
    ]  # fmt: skip
    assert len(lines) == 5 + 25
    assert lines[-1].split()[3] == "25"
    assert [len(line.split()) for line in lines[5:]] == [7] * 25


def test_header_shows_the_torques_that_the_cards_set(capsys: Capture) -> None:
    assert _page("two-term", 7, capsys)[:3] == [
        "  40.00     100.00", "  30.00     200.00", "  20.00     150.00",
    ]  # fmt: skip
    assert _page("two-term", 6, capsys)[0] == " 200.00     100.00"


def test_what_does_not_fit_is_asterisks() -> None:
    scene = replace(case_scene(5), moments=(1234.5, 0.004, 999.996))
    stars = "*" * 10
    large = _row([99999.99994, 99999.99996, -9999.99994], [-9999.99996, math.nan, -math.inf], 129)
    lines = page(scene, "two-term", large).splitlines()
    assert lines[:3] == [" ******     100.00", "   0.00     200.00", " ******     150.00"]
    assert lines[4] == (
        f" 99999.9999          {stars}          -9999.9999       1   **         "
        f"{stars}          {stars}          {stars}"
    )


def test_step_above_999_is_asterisks(capsys: Capture) -> None:
    lines = _page("four-term", 2, capsys, "--steps", "1001")
    assert [line.split()[3] for line in lines[-3:]] == ["999", "***", "***"]


def test_overflow_ends_the_page_and_its_last_rows_are_asterisks(capsys: Capture) -> None:
    lines = _page("two-term", 6, capsys)
    assert len(lines) == 4 + 56
    assert lines[-1].count("*") == 60


@pytest.mark.parametrize(
    ("value", "width", "decimals", "wanted"),
    [
        (0.00005, 10, 4, "0.0001"),  # binary64 holds a little more than the tie
        (0.00015, 10, 4, "0.0001"),  # and a little less here
        (0.03125, 10, 4, "0.0313"),  # an exact tie goes away from zero
        (-0.03125, 10, 4, "-0.0313"),
        (-0.00001, 10, 4, "0.0000"),
        (-0.0, 10, 4, "0.0000"),
        (0.25, 3, 2, ".25"),
        (-0.25, 4, 2, "-.25"),
        (2.5, 4, 0, "3."),
        (1e22, 40, 4, "10000000000000000000000.0000"),
    ],
)
def test_rounding(value: float, width: int, decimals: int, wanted: str) -> None:
    assert write(f"(F{width}.{decimals})", [value]) == [wanted.rjust(width)]


def test_format_is_read_as_fortran_reads_it() -> None:
    assert write("(1X,3HA,B,1X,2F4.1)", [1, 2]) == [" A,B  1.0 2.0"]
    assert write("(I2,/,I3)", [1, 2, 3]) == [" 1", "  2", " 3", ""]
    assert write("(4HTIME)", []) == ["TIME"]


def test_the_character_taken_off_is_always_a_blank() -> None:
    for entry in facts("printer")["program"]:
        for name in ("header", "heads", "rows"):
            assert re.match(r"\(\d+X,", entry[name])
            assert all(record[:1] in ("", " ") for record in write(entry[name], []))


def _punched(number: int, text: str) -> str:
    """Return a FORMAT as the cards have it, 66 columns a card."""
    statement = f"FORMAT{text}"
    parts = [statement[i : i + 66] for i in range(0, len(statement), 66)]
    return f"{number:5d} {parts[0]}\n" + "".join(f"     C{part}\n" for part in parts[1:])


@pytest.mark.external
@pytest.mark.skipif(shutil.which(COMPILER) is None, reason="no compiler")
@pytest.mark.parametrize("program", PROGRAMS)
def test_page_is_what_a_fortran_compiler_writes(program: str, tmp_path: Path) -> None:
    """The same FORMATs on cards, compiled; F77 has no negative zero, and ties go away from 0."""
    generator = np.random.default_rng(1982)
    n = 400
    omega, velocity = generator.normal(size=(2, n, 3)) * 10.0 ** generator.uniform(
        -6, 6, size=(2, n, 3)
    )
    omega[0], omega[1] = (0.03125, -0.03125, 99999.99995), (-1e-9, 0.99996, -0.5)
    collocation = program != "runge-kutta"
    ier = generator.choice([0, 129], size=n).astype(np.int32) if collocation else None
    run = Trajectory(np.zeros(n), np.zeros(n), omega, velocity, n, 0, ier=ier)
    scene = replace(case_scene(5), moments=(12345.0, 0.125, 20.0))
    (tmp_path / "numbers").write_bytes(np.hstack([omega, velocity]).tobytes())
    (tmp_path / "ier").write_bytes(
        np.zeros(n, np.int32).tobytes() if ier is None else ier.tobytes()
    )
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


@pytest.mark.parametrize("form", ["printer", "tape5"])
def test_formats_of_programs_are_refused_elsewhere(
    form: str, capsys: Capture, tmp_path: Path
) -> None:
    for arguments, words in (
        (["run", "--case", "3", "--method", "dop853"], "no meaning with --method; allowed: table"),
        (["compare", "--case", "3"], f"unknown format '{form}'"),
        (["doctor"], f"unknown format '{form}'"),
    ):
        assert main([*arguments, "--format", form, "--out", str(tmp_path / "x")]) == 2
        error = capsys.readouterr().err
        assert words in error
        assert "table" in error
        assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_scene_without_moments_has_no_header(capsys: Capture, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text("[body]\ncoefficients=[0.5,-0.5,0]\n[initial]\nomega=[0,1,10]\n")
    arguments = ["run", "--scene", str(path), "--program", "two-term", "--format"]
    assert main([*arguments, "printer"]) == 2
    assert "give moments" in capsys.readouterr().err
    assert main([*arguments, "tape5", "--out", str(tmp_path / "tape")]) == 0


def test_page_goes_to_a_file_and_both_implementations_print_the_same(
    capsys: Capture, tmp_path: Path
) -> None:
    texts: list[Any] = []
    for implementation in ("fortran", "python"):
        out = tmp_path / implementation
        assert (
            main([*PRINTER, "four-term", "--implementation", implementation, "--out", str(out)])
            == 0
        )
        texts.append(out.read_text())
    assert texts[0] == texts[1]
    assert capsys.readouterr().out == ""


def test_own_scene_prints_its_own_torques() -> None:
    scene = Scene("mine", (1.0, 2.0, 3.0), moments=(3.0, 2.0, 1.5))
    lines = page(scene, "four-term", _row([1.0, 2.0, 3.0], [0.0, 0.0, 0.0])).splitlines()
    assert lines[0] == "   3.00       0.00"
