"""The verb `doctor`."""

import argparse

from pyharness.cli import options as shared
from pyharness.engine.system.leaf_cache import about_leaves
from pyharness.model.build import AS_WRITTEN, build, doctor_report, installation

FORMATS = ("table", "json")
OPTIONS = shared.outputs(FORMATS, plot="")
EXAMPLE = "doctor"


def run(options: argparse.Namespace) -> int:
    """Print build, machine, packages and environment.

    Return 3 without the Fortran extension, 1 if its arithmetic is altered.
    """
    shared.check_outputs(options)
    found, here = build(), installation() | {"leaves": about_leaves()}
    shared.show(doctor_report(found, here), options)
    return int(here["arithmetic"] != AS_WRITTEN) if found.extension else 3
