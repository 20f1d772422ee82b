"""`doctor`: what is built, with what, and what is missing."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.build import OPTIONAL, build, missing
from pyharness.model.build_report import doctor_report


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    parser.add_argument("--format", metavar="F", help="table (default) or json")
    parser.add_argument("--out", metavar="FILE", help="write to this file")


def run(options: argparse.Namespace) -> int:
    """Show; 3 where the extension is not built."""
    shared.chosen_format(options, ("table", "json"))
    shared.check_outputs(options)
    found = build()
    shared.show(doctor_report(found, OPTIONAL, missing()), options)
    return 0 if found.extension else 3
