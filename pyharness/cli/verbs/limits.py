"""The verb `limits`."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.limits import invisible, limit, limits_report
from pyharness.model.listing import PROGRAMS

OPTIONS = {
    **shared.SCENE,
    "--step-size H": "First step size in s, above 0 (default: the scene's).",
    "--steps N": "Number of steps of the first size, at least 1 (default: the scene's).",
    "--program P": f"Run only this program: {', '.join(PROGRAMS)} (default: all three).",
    "--halvings K": "Number of times that the step size is halved, 1 to 12 (default 6).",
    **shared.EFFORT_OF_PROGRAMS,
    **shared.outputs(plot=""),
}
USAGE = shared.ONE_SCENE
EXAMPLE = "limits --case 5 --program runge-kutta"


def run(options: argparse.Namespace) -> int:
    scene = shared.chosen_scene(options)
    programs = shared.chosen_programs(options)
    halvings = shared.whole_up_to(12, options.halvings, "--halvings", 6)
    shared.check_outputs(options)
    effort = shared.chosen_effort(options)
    found = [limit(program, scene, halvings, effort) for program in programs]
    return shared.show(limits_report(scene, found, invisible(scene)), options)
