"""A report as plain text, with paragraphs wrapped at 100 columns and with aligned tables."""

import textwrap

from pyharness.model.report import Field, Line, Report, Section, Table

_WIDTH = 100
_NARROWEST = 12  # least width to which a last column is wrapped
_MOST_ROWS = 200
_END_ROWS = 10


def write(report: Report) -> str:
    """Return a command's report as plain text, with a blank line between its sections."""
    sections = ["\n".join(_lines(section)) for section in report.text if section]
    return "\n\n".join(sections) + "\n"


def _lines(section: Section) -> list[str]:
    lines = []
    for each in section:
        lines += _aligned(each) if isinstance(each, Table) else paragraph(each)
    return lines


def paragraph(told: str | Field) -> list[str]:
    """Return the lines of a paragraph of a report, wrapped at 100 columns; at least one line.

    `told` is the paragraph. If its type is Line, it is not wrapped. If its type is Field, the first
    line begins with its label.
    """
    if isinstance(told, Line):
        return [told]
    if isinstance(told, Field):
        indent = " " * len(told.label)
        return textwrap.wrap(told.text, _WIDTH, initial_indent=told.label, subsequent_indent=indent)
    # A name with a hyphen is not broken, because users may copy or type it.
    lines = textwrap.wrap(told, _WIDTH, subsequent_indent="  ", break_on_hyphens=False)
    return lines or [""]


def _aligned(table: Table) -> list[str]:
    """Return the lines of a table as plain text, with aligned columns.

    If the table has more than 200 rows, only the first ten and the last ten are shown.
    """
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
