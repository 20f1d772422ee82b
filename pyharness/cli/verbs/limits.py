"""`limits`: what the original programs tend to as the step goes to zero."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.limits import invisible, limit, limits_report
from pyharness.model.errors import InputError, unknown
from pyharness.model.listing import PROGRAMS


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    shared.add_scene_options(parser)
    parser.add_argument("--program", metavar="P", help="this program only")
    parser.add_argument("--halvings", metavar="K", help="how often the step is halved (default 6)")
    shared.add_effort_option(parser)
    shared.add_output_options(parser, plot="")


def run(options: argparse.Namespace) -> int:
    """Hold the original programs against their limits and against the truth."""
    scene = shared.chosen_scene(options)
    if options.program is not None and options.program not in PROGRAMS:
        raise unknown("program", options.program, PROGRAMS, "--program")
    programs = PROGRAMS if options.program is None else (options.program,)
    halvings = 6 if options.halvings is None else shared.whole(options.halvings, "--halvings")
    if not 1 <= halvings <= 12:
        raise InputError(f"--halvings: {halvings}; allowed: 1 to 12")
    shared.check_outputs(options)
    effort = shared.chosen_effort(options)
    found = [limit(program, scene, halvings, effort) for program in programs]
    shared.show(limits_report(scene, found, invisible(scene)), options)
    return 0
