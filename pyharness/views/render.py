"""A report in the form asked for: CSV, Markdown, JSON and JUnit here, text in its own file."""

import math
from collections.abc import Callable
from typing import Any

from pyharness.model.report import Report, Section, Table
from pyharness.views.text import paragraph, text

SCHEMA = 1


def render(report: Report, form: str) -> str:
    """Return a report as ``table`` (text), ``csv``, ``markdown``, ``json`` or ``junit``."""
    return _FORMS[form](report)


def csv_text(table: Table) -> str:
    """Return a table as CSV, its numbers in full."""
    import csv
    import io

    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerows(table.in_full())
    return buffer.getvalue()


def _csv(report: Report) -> str:
    assert report.data is not None
    return csv_text(report.data)


def _markdown(report: Report) -> str:
    if report.page is not None:
        return "\n".join(map(_markdown_section, report.page))
    assert report.data is not None
    return _markdown_table(report.data.in_full())


def _markdown_section(section: Section) -> str:
    parts: list[str] = []
    for each in section:
        if isinstance(each, Table):
            # Without a blank line before it, it would be none.
            parts += ["\n"] if parts else []
            parts.append(_markdown_table(each.written()))
        else:
            parts += [f"{line}\n" for line in paragraph(each)]
    return "".join(parts)


def _markdown_table(cells: list[list[str]]) -> str:
    head, *rows = cells
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _json(report: Report) -> str:
    return json_text({"schema": SCHEMA, **report.record()})


def json_text(record: dict[str, Any]) -> str:
    """Return strict JSON in one line; floats round-trip, a non-finite number is null."""
    import json

    try:
        return json.dumps(record, allow_nan=False) + "\n"
    except ValueError:
        return json.dumps(_finite(record), allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return value


def _junit(report: Report) -> str:
    """Return the XML that services for continuous integration read."""
    from xml.etree import ElementTree as xml

    suite = xml.Element(
        "testsuite",
        name=report.title,
        tests=str(len(report.cases)),
        failures=str(sum(bool(each.failure) for each in report.cases)),
        errors="0",
        skipped="0",
    )
    for each in report.cases:
        named = {"classname": f"{report.title}.{each.kind}", "name": each.id}
        case = xml.SubElement(suite, "testcase", named)
        if each.failure:
            failure = xml.SubElement(case, "failure", message=each.failure)
            failure.text = f"{each.failure}\n{each.replay}"
    xml.indent(suite)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + xml.tostring(suite, "unicode") + "\n"


_FORMS: dict[str, Callable[[Report], str]] = {
    "table": text,
    "csv": _csv,
    "markdown": _markdown,
    "json": _json,
    "junit": _junit,
}
