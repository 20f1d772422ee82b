"""The verb `doctor`: report how this installation was built, and which packages it lacks."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.build import build, doctor_report

FORMATS = ("table", "json")
OPTIONS = {
    **shared.outputs(FORMATS, plot=""),
}
EXAMPLE = "doctor"


def run(options: argparse.Namespace) -> int:
    """Print how this installation was built, and which packages it lacks.

    Return exit status 3 if the extension, which is the compiled Fortran code, is not built, else 0.
    """
    shared.check_outputs(options)
    found = build()
    shared.show(doctor_report(found), options)
    return 0 if found.extension else 3
