"""Reports as text, CSV, Markdown, JSON, JUnit XML and HTML."""

import io
import math
import textwrap
from collections.abc import Sequence
from typing import Any

from pyharness.model.report import Column, Field, Line, Report, Section, Table

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
    """Return a table's lines: in parts if too wide, without middle rows if too long."""
    n = len(table.rows)
    if n > _MOST_ROWS:
        table = table._replace(rows=[*table.rows[:_END_ROWS], *table.rows[-_END_ROWS:]])
    cells = table.written()
    lines: list[str] = []
    for part in _parts(table.columns, _widths(cells)):
        columns = [table.columns[k] for k in part]
        block = _block(columns, [[row[k] for k in part] for row in cells])
        if n > _MOST_ROWS:
            left_out = f"... {n - 2 * _END_ROWS} rows left out; --format csv gives all ..."
            block.insert(len(block) - _END_ROWS, left_out)
        lines += ["", *block] if lines else block
    return lines


def _widths(cells: Sequence[Sequence[str]]) -> list[int]:
    return [max(map(len, column)) for column in zip(*cells, strict=True)]


def _parts(columns: Sequence[Column], widths: Sequence[int]) -> list[list[int]]:
    others = sum(widths) - max(widths) + len(widths) - 1
    if columns[-1].fit or others <= _WIDTH // 2:
        return [[*range(len(widths))]]  # its last or its widest column is wrapped or cut
    parts = [[0]]
    for k in range(1, len(widths)):
        if len(parts[-1]) > 1 and sum(widths[i] + 1 for i in parts[-1]) + widths[k] > _WIDTH:
            parts.append([0])
        parts[-1].append(k)
    return parts


def _block(columns: Sequence[Column], cells: Sequence[Sequence[str]]) -> list[str]:
    widths = _widths(cells)
    fit = columns[-1].fit
    wrapped = len(widths) - 1 if fit else widths.index(max(widths))
    if fit != "cut":
        room = _WIDTH - sum(widths) + widths[wrapped] - 2 * (len(widths) - 1)
        if fit or room + len(widths) - 1 < widths[wrapped]:
            widths[wrapped] = min(widths[wrapped], max(_NARROWEST, room))
    gap = "  " if sum(widths) + 2 * (len(widths) - 1) <= _WIDTH else " "
    lines = []
    for row in cells:
        text = row[wrapped]
        for part in [text] if fit == "cut" else textwrap.wrap(text, widths[wrapped]) or [text]:
            texts = [*row[:wrapped], part, *row[wrapped + 1 :]]
            line = gap.join(
                cell.ljust(width) if column.left else cell.rjust(width)
                for column, cell, width in zip(columns, texts, widths, strict=True)
            )
            lines.append((line[:_WIDTH] if fit == "cut" else line).rstrip())
            row = [""] * len(row)
    return lines


def csv_text(table: Table) -> str:
    import csv

    buffer = io.StringIO()
    cells = table.in_full()
    assert len(set(cells[0])) == len(cells[0])  # readers find columns by their heads
    csv.writer(buffer, lineterminator="\n").writerows(cells)
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
    head, *rows = cells
    lines = [head, ["---"] * len(head), *rows]
    escaped = ([cell.replace("|", r"\|") for cell in line] for line in lines)
    return "".join("| " + " | ".join(line) + " |\n" for line in escaped)


def json_text(record: dict[str, Any], indent: int | None = None) -> str:
    """Return strict JSON; floats can be read back exactly, but NaN and infinity become null."""
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
    from xml.etree import ElementTree as xml

    failures = sum(bool(why) for _, _, why, _, _ in report.cases)
    counts = {"tests": len(report.cases), "failures": failures, "errors": 0, "skipped": 0}
    texts = {name: str(count) for name, count in counts.items()}
    known = [seconds for *_, seconds in report.cases if seconds is not None]
    if known:
        texts["time"] = f"{sum(known):.6f}"
    suite = xml.Element("testsuite", {"name": report.title} | texts)
    if report.properties:
        parent = xml.SubElement(suite, "properties")
        for name, value in report.properties.items():
            xml.SubElement(parent, "property", {"name": name, "value": value})
    for kind, id, why, replay, seconds in report.cases:
        named = {"classname": f"{report.title}.{kind}", "name": id}
        took = {} if seconds is None else {"time": f"{seconds:.6f}"}
        case = xml.SubElement(suite, "testcase", named | took)
        if why:
            xml.SubElement(case, "failure", message=why).text = f"{why}\n{replay}"
    xml.indent(suite)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + xml.tostring(suite, "unicode") + "\n"
