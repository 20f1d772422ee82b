"""Every form of a report has the same values."""

import csv
import json
from xml.etree import ElementTree as xml

import numpy as np
import pytest

from pyharness.model import report
from pyharness.model.report import Column, Field, Line, Report, Section, Table, digits, short, words
from pyharness.views.render import csv_text, render

NAME = "a-name-with-hyphens"
COLUMNS = [
    *words("name"),
    Column("error", short, unit="rad/s", name="error_w"),
    Column("ms", digits(".1f", 1e3), unit="s", full=digits(".3f")),
]
TABLE = Table(COLUMNS, [["first", 1.23e-3, 0.0123], ["second", None, None]])
REPORT = Report(
    "verify",
    text=[[], [f"{'word ' * 18}{NAME} end", TABLE], [Line("x" * 120)], [Field("why  ", "y " * 60)]],
    record=lambda: {"values": [1.5, float("nan")]},
    data=TABLE,
    cases=[
        ("cells", "cells/a", "", "again a", None),
        ("cells", "cells/b", "2, limit 1", "again b", 1.5),
    ],
)


def test_text_has_sections_paragraphs_and_tables() -> None:
    lines = render(REPORT, "table").splitlines()
    assert lines == [
        "word " * 17 + "word", f"  {NAME} end", "name     error    ms", "first   1.2e-3  12.3",
        "second       -     -", "", "x" * 120, "", "why  " + "y " * 47 + "y",
        "     " + "y " * 11 + "y",
    ]  # fmt: skip


def test_numbers_are_given_in_full() -> None:
    head, *rows = csv.reader(render(REPORT, "csv").splitlines())
    assert head == ["name", "error_w", "ms"]
    assert rows == [["first", "0.00123", "0.012"], ["second", "", "-"]]
    markdown = "| name | error_w | ms |\n| --- | --- | --- |\n| first | 0.00123 | 0.012 |\n"
    assert render(REPORT, "markdown").startswith(markdown)
    array = Table(words("a b"), np.array([[0.1, 1e22], [5e-324, -0.0]]))
    found = render(REPORT._replace(data=array), "csv").splitlines()
    assert found == ["a,b", "0.1,1e+22", "5e-324,-0.0"]
    assert [report.exact(x) for x in (None, True, 3, "x")] == ["", "true", "3", "x"]
    # A page is written for people.
    page: list[Section] = [["title", TABLE], [Line("- " + "note " * 30)]]
    found = render(REPORT._replace(page=page), "markdown").split("\n\n")
    assert found[0] == "title"
    assert found[1].splitlines()[2] == "| first | 1.2e-3 | 12.3 |"
    assert found[2] == "- " + "note " * 30 + "\n"


@pytest.mark.parametrize(("fit", "lines_of_it", "letters"), [("wrap", 3, 29), ("cut", 1, 30)])
def test_last_column_fits(fit: str, lines_of_it: int, letters: int) -> None:
    columns = [*words("name"), Column("what", left=True, fit=fit)]
    table = Table(columns, [["n" * 40, "w " * 60], ["short", "v"]])
    lines = render(REPORT._replace(text=[[table]]), "table").splitlines()
    assert max(map(len, lines)) <= 100
    assert len(lines) == 1 + lines_of_it + 1
    assert lines[-1].split() == ["short", "v"]
    assert lines[1].count("w") == letters


def test_record_and_cases() -> None:
    assert json.loads(render(REPORT, "json")) == {"schema": 1, "values": [1.5, None]}
    suite = xml.fromstring(render(REPORT, "junit").encode())
    assert suite.attrib["name"] == "verify"
    assert (suite.attrib["tests"], suite.attrib["failures"]) == ("2", "1")
    (failure,) = suite.iter("failure")
    assert failure.text == "2, limit 1\nagain b"
    assert [each.attrib["classname"] for each in suite.iter("testcase")] == ["verify.cells"] * 2
    times = [each.get("time") for each in (suite, *suite.iter("testcase"))]
    assert times == ["1.500000", None, "1.500000"]
    untimed = REPORT._replace(cases=[("cells", "cells/a", "", "again a", None)])
    assert "time" not in xml.fromstring(render(untimed, "junit").encode()).attrib


def test_wide_table_has_parts_or_wrapped_values() -> None:
    """Regression test: `run --attitude matrix` and `prove --digits 200` wrote 246 columns."""
    numbers = Table([Column(f"n{i}") for i in range(30)], [[10**9 + i for i in range(30)]] * 2)
    value = "12345" * 50
    long = Table([Column("n"), *words("value"), Column("radius")], [[1, value, 3], [2, "x", 4]])
    lines = render(Report("run", text=[[numbers], [long]], record=dict), "table").splitlines()
    assert max(map(len, lines)) <= 100
    first, *others = "\n".join(lines).split("\n\n")
    tables = [each.splitlines() for each in (first, *others[:-1])]
    assert all(len(each) == 3 and each[0].split()[0] == "n0" for each in tables)
    assert [head for each in tables for head in each[0].split()[1:]] == [
        f"n{i}" for i in range(1, 30)
    ]
    rows = [line.split() for line in others[-1].splitlines()]
    assert "".join(row[1 if len(row) == 3 else 0] for row in rows[1:-1]) == value
    assert (rows[1][0], rows[1][2], rows[-1]) == ("1", "3", ["2", "x", "4"])


def test_a_bar_in_a_cell_is_no_column_of_markdown() -> None:
    table = Table([*words("quantity"), Column("|x|")], [["|L|, relative", 1]])
    head, _, row = render(Report("t", [[table]], dict, page=[[table]]), "markdown").splitlines()
    assert head == r"| quantity | \|x\| |"
    assert row == r"| \|L\|, relative | 1 |"


def test_properties_are_in_junit() -> None:
    report = REPORT._replace(properties={"covered": "|omega| < 2 rad/s"})
    first, *_ = xml.fromstring(render(report, "junit").encode())
    assert (first.tag, first[0].attrib) == (
        "properties", {"name": "covered", "value": "|omega| < 2 rad/s"}
    )  # fmt: skip


def test_a_table_with_two_equal_heads_is_no_csv() -> None:
    with pytest.raises(AssertionError):
        csv_text(Table([Column("error"), Column("error")], [[1.0, 2.0]]))
