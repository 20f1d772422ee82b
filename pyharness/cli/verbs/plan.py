"""`plan`: what a scene needs, what is therefore not computed, and why."""

import argparse

from pyharness.cli import options as shared
from pyharness.methods.plan import plan
from pyharness.methods.prepared import PREPARED
from pyharness.methods.report import plan_report
from pyharness.model.errors import unknown


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    shared.add_scene_options(parser)
    parser.add_argument("--method", metavar="M", help="auto (default), or a name")
    parser.add_argument("--tolerance", metavar="E", help="relative (default 1e-12)")
    parser.add_argument("--velocity", action="store_true", help="the velocity is wanted too")
    parser.add_argument(
        "--rows", action="store_true", help="results on the way are wanted too, as in run"
    )
    shared.add_output_options(parser, plot="")


def run(options: argparse.Namespace) -> int:
    """Show the decisions for a scene."""
    scene = shared.chosen_scene(options)
    method = options.method or "auto"
    if method not in PREPARED:
        raise unknown("method", method, PREPARED, "--method")
    tolerance = shared.positive(options.tolerance, "--tolerance", 1e-12)
    shared.check_outputs(options)
    found = plan(scene, method, tolerance, options.velocity, options.rows)
    shared.show(plan_report(scene, found), options)
    return 0
