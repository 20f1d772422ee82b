"""The data of a report as CSV, with all digits."""

import csv
import io

from pyharness.model.report import Report, Table


def write(report: Report) -> str:
    """Return a report's data as CSV."""
    assert report.data is not None
    return csv_text(report.data)


def csv_text(table: Table) -> str:
    """Return a table as CSV with heads."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(table.in_full())
    return buffer.getvalue()
