"""Reports in every output format: text, CSV, Markdown, JSON, JUnit XML, and HTML."""

import io
import math
import textwrap
from collections.abc import Sequence
from typing import Any

from pyharness.model.report import Field, Line, Report, Section, Table

SCHEMA = 1  # version of the JSON output
_WIDTH = 100
_NARROWEST = 12  # least width to which a last column is wrapped
_MOST_ROWS = 200
_END_ROWS = 10


def render(report: Report, form: str) -> str:
    """Return a report as ``table``, ``csv``, ``markdown``, ``json``, ``junit`` or ``html``."""
    if form in (writers := {"table": _text, "markdown": _markdown, "junit": _junit}):
        return writers[form](report)
    if form == "json":
        return json_text({"schema": SCHEMA, **report.record()})
    if form == "csv":
        assert report.data is not None
        return csv_text(report.data)
    from pyharness.views.html import sections

    return sections(report.text)


def _text(report: Report) -> str:
    sections = (
        [line for each in section for line in _lines(each)] for section in filter(None, report.text)
    )
    return "\n\n".join(map("\n".join, sections)) + "\n"


def _lines(told: str | Field | Table) -> list[str]:
    """Return the lines of a part: a Line is not wrapped, a Field begins with its label."""
    if isinstance(told, Line):
        return [told]
    if isinstance(told, Table):
        return _aligned(told)
    if isinstance(told, Field):
        indent = " " * len(told.label)
        return textwrap.wrap(told.text, _WIDTH, initial_indent=told.label, subsequent_indent=indent)
    # Users may copy names with hyphens, which must not be broken.
    lines = textwrap.wrap(told, _WIDTH, subsequent_indent="  ", break_on_hyphens=False)
    return lines or [""]


def _aligned(table: Table) -> list[str]:
    """Return a table's aligned lines; of more than 200 rows, only the first and the last ten."""
    n = len(table.rows)
    if n > _MOST_ROWS:
        table = table._replace(rows=[*table.rows[:_END_ROWS], *table.rows[-_END_ROWS:]])
    cells = table.written()
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    fit = table.columns[-1].fit
    if fit == "wrap":
        room = _WIDTH - sum(widths[:-1]) - 2 * (len(widths) - 1)
        widths[-1] = min(widths[-1], max(_NARROWEST, room))
    gap = "  " if sum(widths) + 2 * (len(widths) - 1) <= _WIDTH else " "
    lines = []
    for *row, last in cells:
        for part in textwrap.wrap(last, widths[-1]) if fit == "wrap" else [last]:
            columns = zip(table.columns, [*row, part], widths, strict=True)
            line = gap.join(
                cell.ljust(width) if column.left else cell.rjust(width)
                for column, cell, width in columns
            )
            lines.append((line[:_WIDTH] if fit == "cut" else line).rstrip())
            row = [""] * len(row)
    if n > _MOST_ROWS:
        left_out = f"... {n - 2 * _END_ROWS} rows left out; --format csv gives all ..."
        lines.insert(len(lines) - _END_ROWS, left_out)
    return lines


def csv_text(table: Table) -> str:
    """Return a table as CSV; the first line has the heads."""
    import csv

    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(table.in_full())
    return buffer.getvalue()


def _markdown(report: Report) -> str:
    if report.page is not None:
        return "\n".join(map(_markdown_section, report.page))
    assert report.data is not None
    return markdown_table(report.data.in_full())


def _markdown_section(section: Section) -> str:
    parts: list[str] = []
    for each in section:
        if isinstance(each, Table):
            # Markdown recognises a table only after a blank line.
            parts += ["\n"] if parts else []
            parts.append(markdown_table(each.written()))
        else:
            parts += [f"{line}\n" for line in _lines(each)]
    return "".join(parts)


def markdown_table(cells: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table, whose heads are the first row."""
    head, *rows = cells
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def json_text(record: dict[str, Any], indent: int | None = None) -> str:
    """Return strict JSON, in one line or indented.

    Floats can be read back exactly; NaN and infinity become null.
    """
    import json

    try:
        return json.dumps(record, allow_nan=False, indent=indent) + "\n"
    except ValueError:
        return json.dumps(_finite(record), allow_nan=False, indent=indent) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return value


def _junit(report: Report) -> str:
    """Return a report as JUnit XML: a test suite with a test case for each check.

    A failed test case contains the reason, and the command that repeats the check.
    """
    from xml.etree import ElementTree as xml

    failures = sum(bool(why) for _, _, why, _ in report.cases)
    counts = {"tests": len(report.cases), "failures": failures, "errors": 0, "skipped": 0}
    texts = {name: str(count) for name, count in counts.items()}
    suite = xml.Element("testsuite", {"name": report.title} | texts)
    for kind, id, why, replay in report.cases:
        named = {"classname": f"{report.title}.{kind}", "name": id}
        case = xml.SubElement(suite, "testcase", named)
        if why:
            xml.SubElement(case, "failure", message=why).text = f"{why}\n{replay}"
    xml.indent(suite)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + xml.tostring(suite, "unicode") + "\n"
