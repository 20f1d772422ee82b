"""Effects of word length on pages, stops, errors and IER, by bits and rounding rule."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from jsonschema import Draft202012Validator

from pyharness import Listing, case_scene, run_program
from pyharness.cli import options
from pyharness.history.words import (
    WordCell,
    WordRun,
    cells,
    machine_cells,
    machine_report,
    words_report,
)
from pyharness.thesis.printer import page
from pyharness.thesis.vectors import OURS
from pyharness.thesis.word import RULES
from pyharness.views.render import csv_text, render
from tests.conftest import Printed, ResultOf
from tests.json_reference import schema_of

ROOT = Path(__file__).parents[2]
LENGTHS = (16, 20, 24, 28, 48, 53)


@contextmanager
def few_steps(steps: int) -> Iterator[None]:
    """Shorten every case, because arithmetic in words of any length is slow."""
    with patch(
        f"{cells.__module__}.case_scene", lambda case: replace(case_scene(case), steps=steps)
    ):
        yield


@pytest.fixture(scope="module")
def found() -> dict[tuple[int, str, str], WordCell]:
    each = [*cells([2], ["runge-kutta"], LENGTHS), *cells([6], ["two-term"], (24, 113))]
    with few_steps(20):
        each += cells([2], ["four-term"], (24, 28))
    return {(c.double.case, c.double.program, c.double.listing): c for c in each}


Found = dict[tuple[int, str, str], WordCell]


@pytest.mark.campaign
def test_double_is_the_run_in_53_bits(found: Found) -> None:
    for cell in found.values():
        if (run := cell.find_run(53, "nearest-even")) is not None:
            assert run == cell.double
            assert run.different == 0
    cell = found[2, "runge-kutta", "corrected"]
    assert cell.find_run(54, "chop") is None
    words = [(p, rule) for rule in RULES for p in LENGTHS]
    assert [(run.p, run.rule) for run in cell.runs] == words


def test_rounding_takes_over_where_words_are_short(found: Found) -> None:
    """The corrected Runge-Kutta program has an error of 2.5e-7; 16 bits cost 1000 times more."""
    cell: Any = found[2, "runge-kutta", "corrected"]
    floor = cell.widest.error
    assert floor == pytest.approx(2.5e-7, rel=0.05)
    for rule in RULES:
        run = cell.find_run(16, rule)
        assert run is not None
        assert run.error > 100.0 * floor
        least = 24 if rule == "nearest-even" else 28
        assert cell.settled(rule, [run for run in cell.runs if run.error <= 2.0 * floor]) == least
        assert cell.settled(rule, [run for run in cell.runs if run.p != 28]) == 48
        assert cell.settled(rule, [run for run in cell.runs if run.p != 53]) is None


def test_stops_and_singular_matrices(found: Found) -> None:
    for run in found[2, "runge-kutta", "original"].runs:
        assert (run.stop, run.fields) == ("V2 at 25", 25 * 7)
    for run in found[2, "four-term", "corrected"].runs:
        singular = 20 if run.p == 24 else 0
        assert (run.singular, run.stop, run.fields) == (singular, "", 160)
        assert (run.different > 20) == (singular > 0)


def test_pages_of_another_length_differ_in_every_number_that_is_missing(found: Found) -> None:
    """Two-term Case 6 overflows at a step that depends on the exponent range of a word."""

    def rows(run: WordRun) -> int:
        return int(run.stop.split()[-1]) - 1 if run.stop else 100

    cell = found[6, "two-term", "original"]
    assert cell.double.stop.startswith("overflow at ")
    double = rows(cell.double)
    assert {rows(run) for run in cell.runs if run.stop} - {double}
    for run in cell.runs:
        assert run.fields == 8 * max(rows(run), double)
        assert run.different >= 7 * abs(rows(run) - double)


def test_report_has_every_run(found: Found) -> None:
    cell = found[2, "runge-kutta", "original"]
    report: Any = words_report([cell])
    assert report.record()["runs"] == [run._asdict() for run in cell.runs]
    assert len(csv_text(report.data).splitlines()) == 1 + len(cell.runs)
    assert str(report.text[-1][0]).startswith("* assumed: 100 steps")
    # Without 48 bits the report has no section on the machine's own words.
    assert len(report.text) == 4
    assert len(words_report([*cells([2], ["runge-kutta"], (24,))]).text) == 3


def test_verdict_on_the_machine_has_four_lines(printed: Printed) -> None:
    lines = printed("words --case 2").splitlines()
    assert len(lines) == 4
    assert lines[0].startswith("No result of the original programs depends on the CDC's 48 bits")
    assert lines[1].startswith("cdc48: 2 of 1775 printed numbers differ")
    (cell,) = machine_cells([2], ["runge-kutta"])
    assert (cell.double.stop, cell.widest) == ("V2 at 25", None)
    double = cell.double
    worse, later = double._replace(error=2.0 * double.error), double._replace(stop="")
    for other in (worse, later):
        told = render(machine_report([WordCell(double, None, (other, double))]), "table")
        assert told.startswith("Some result of the original programs depends")


@pytest.mark.campaign
def test_verb(printed: Printed, tmp_path: Path) -> None:
    picture = tmp_path / "words.png"
    with few_steps(10), patch.object(options, "progress") as progress:
        text = printed(f"words --case 1 --program runge-kutta --format json --plot {picture}")
    assert progress.call_count > 1
    record = json.loads(text)
    Draft202012Validator(schema_of("words")).validate(record)
    runs = record["runs"]
    assert len(runs) == 2 * 16 * 4
    assert {run["p"] for run in runs} >= {16, 48, 113}
    assert picture.stat().st_size > 1000
    assert len(picture.with_suffix(".csv").read_text().splitlines()) == 1 + len(runs)


def test_vectors_that_differ_end_with_1(tmp_path: Path, result_of: ResultOf) -> None:
    assert "24 of 24 vectors agree" in result_of(["words", "--vectors", str(OURS)]).out
    bad = tmp_path / "bad.json"
    bad.write_text(OURS.read_text().replace("1716 5252 5252 5252 5253", "1716 5252 5252 5252 5252"))
    out = result_of(["words", "--vectors", str(bad)], 1).out
    assert "23 of 24 vectors agree" in out
    assert "1/3 (RX/)" in out
    assert "ours   1716 5252 5252 5252 5253" in out


def test_one_value_changes_on_two_printed_pages() -> None:
    """The page about the text says so; words.md counts the corrected programs too."""
    scene, changed = case_scene(2), set()
    for program in ("two-term", "four-term"):
        listing = Listing.original(program)
        pages = [
            page(scene, program, run_program(scene, listing, "python", word=word)).split()
            for word in ("binary64", "cdc48-rounded", "cdc48")
        ]
        assert pages[0] == pages[1]
        pairs = enumerate(zip(pages[0], pages[2], strict=True))
        (change,) = ((n, *pair) for n, pair in pairs if pair[0] != pair[1])
        changed.add(change)
    assert len(changed) == 1
    text = " ".join((ROOT / "docs/explanation/about-the-text.md").read_text().split())
    assert "one value differs, on two printed pages" in text
