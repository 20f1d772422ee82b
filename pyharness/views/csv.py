"""The data of a report as CSV, with numbers in full."""

import csv
import io

from pyharness.model.report import Report, Table


def write(report: Report) -> str:
    """Return the data of a report, which is one table, as CSV."""
    assert report.data is not None
    return csv_text(report.data)


def csv_text(table: Table) -> str:
    """Return the heads and the rows of a table as CSV, with numbers in full."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(table.in_full())
    return buffer.getvalue()
