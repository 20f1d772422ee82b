"""The data of a report as CSV, with all digits of the numbers."""

import csv
import io

from pyharness.model.report import Report, Table


def write(report: Report) -> str:
    """Return the table of data of a report as CSV text.

    A report has the results of a command. Numbers have all digits, so that they can be read back
    exactly.
    """
    assert report.data is not None
    return csv_text(report.data)


def csv_text(table: Table) -> str:
    """Return a table as CSV text: a line with the names of the columns, and a line for each row.

    Numbers have all digits, so that they can be read back exactly.
    """
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(table.in_full())
    return buffer.getvalue()
