"""A report as Markdown: its page, or else its data."""

from pyharness.model.report import Report, Section, Table
from pyharness.views.table import paragraph


def write(report: Report) -> str:
    """Return a report as Markdown: its page, or else its data with all digits."""
    if report.page is not None:
        return "\n".join(map(_section, report.page))
    assert report.data is not None
    return _table(report.data.in_full())


def _section(section: Section) -> str:
    parts: list[str] = []
    for each in section:
        if isinstance(each, Table):
            # Markdown recognises a table only after a blank line.
            parts += ["\n"] if parts else []
            parts.append(_table(each.written()))
        else:
            parts += [f"{line}\n" for line in paragraph(each)]
    return "".join(parts)


def _table(cells: list[list[str]]) -> str:
    head, *rows = cells
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)
