"""`claims`: every statement of the thesis about results, judged."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.claims.ledger import assignments, claim, claims, judge
from pyharness.history.claims.report import (
    assignments_table,
    claims_record,
    claims_rows,
    claims_table,
    explanation,
)
from pyharness.views.text import csv_text, markdown_text


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    parser.add_argument("--explain", metavar="ID", help="one claim, with its numbers")
    parser.add_argument(
        "--assignments", action="store_true", help="which initial conditions let all claims hold"
    )
    parser.add_argument("--format", metavar="F", help=", ".join(shared.FORMATS))
    parser.add_argument("--out", metavar="FILE", help="write to this file, not to the terminal")


def run(options: argparse.Namespace) -> int:
    """Judge and show."""
    form = shared.chosen_format(options, shared.FORMATS)
    if options.assignments:
        shared.refuse(options, "--assignments", ("explain",))
        form = shared.chosen_format(options, ("table", "json"))
    chosen = claims() if options.explain is None else [claim(options.explain)]
    shared.check_outputs(options)
    if options.assignments:
        from dataclasses import asdict

        from pyharness.views.records import SCHEMA, json_text

        found = assignments()
        record = {"schema": SCHEMA, "assignments": [asdict(each) for each in found]}
        text = json_text(record) if form == "json" else assignments_table(found)
        shared.emit(text, options.out)
        return 0

    judgements = []
    for number, entry in enumerate(chosen, 1):
        shared.progress(f"{number} of {len(chosen)}: {entry['id']}")
        judgements.append(judge(entry))
    shared.progress("")
    if form == "json":
        from pyharness.views.records import SCHEMA, json_text

        text = json_text({"schema": SCHEMA, "claims": claims_record(judgements)})
    elif form == "table":
        shown = claims_table if options.explain is None else lambda found: explanation(found[0])
        text = shown(judgements)
    else:
        head, rows = claims_rows(judgements)
        text = (csv_text if form == "csv" else markdown_text)(head, rows)
    shared.emit(text, options.out)
    return 0
