"""`doctor`: what is built, with what, and what is missing."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.build import OPTIONAL, build, missing


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    parser.add_argument("--format", metavar="F", help="table (default) or json")
    parser.add_argument("--out", metavar="FILE", help="write to this file")


def run(options: argparse.Namespace) -> int:
    """Show; 3 where the extension is not built."""
    form = shared.chosen_format(options, ("table", "json"))
    shared.check_outputs(options)
    found, absent = build(), missing()
    if form == "json":
        from pyharness.views.records import doctor_record, json_text

        shared.emit(json_text(doctor_record(found, absent)), options.out)
    else:
        from pyharness.views.text import doctor_table

        shared.emit(doctor_table(found, OPTIONAL, absent), options.out)
    return 0 if found.extension else 3
