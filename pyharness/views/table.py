"""A report as plain text: paragraphs wrapped at 100 columns, and aligned tables."""

import textwrap

from pyharness.model.report import Field, Line, Report, Section, Table

_WIDTH = 100
_NARROWEST = 12  # least width to which a last column is wrapped
_MOST_ROWS = 200
_END_ROWS = 10


def write(report: Report) -> str:
    """Return a report as plain text."""
    sections = ["\n".join(_lines(section)) for section in report.text if section]
    return "\n\n".join(sections) + "\n"


def _lines(section: Section) -> list[str]:
    lines = []
    for each in section:
        lines += _aligned(each) if isinstance(each, Table) else paragraph(each)
    return lines


def paragraph(told: str | Field) -> list[str]:
    """Return the lines of a paragraph; a Line is not wrapped, a Field has a label."""
    if isinstance(told, Line):
        return [told]
    if isinstance(told, Field):
        indent = " " * len(told.label)
        return textwrap.wrap(told.text, _WIDTH, initial_indent=told.label, subsequent_indent=indent)
    # Users may copy names with hyphens, which must not be broken.
    lines = textwrap.wrap(told, _WIDTH, subsequent_indent="  ", break_on_hyphens=False)
    return lines or [""]


def _aligned(table: Table) -> list[str]:
    """Return a table's lines, aligned; above 200 rows only the first and last ten."""
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
