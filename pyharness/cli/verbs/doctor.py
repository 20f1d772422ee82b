"""`doctor`: what is built, with what, and what is missing."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.build import OPTIONAL, build, missing
from pyharness.model.build_report import doctor_report


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    shared.add_output_options(parser, ("table", "json"), plot="")


def run(options: argparse.Namespace) -> int:
    """Show; 3 where the extension is not built."""
    shared.check_outputs(options)
    found = build()
    shared.show(doctor_report(found, OPTIONAL, missing()), options)
    return 0 if found.extension else 3
