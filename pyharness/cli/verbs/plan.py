"""The verb `plan`."""

import argparse

from pyharness.cli import options as shared
from pyharness.engine.plan.plan import plan
from pyharness.engine.plan.registry import PREPARED
from pyharness.engine.plan.report import plan_report
from pyharness.engine.solve import ascending_times

OPTIONS = {
    **shared.BODY,
    "--method M": "Plan a solution by this method: auto (default; chooses closed-form, quick or "
    f"taylor), {', '.join(name for name in PREPARED if name != 'auto')}.",
    "--tolerance E": "Largest allowed error of omega, relative to its largest component, at most "
    "1 (default: the method's own, 1e-9 for auto).",
    "--velocity": "Plan the computation of the translational velocity too.",
    "--times T1,T2,...": "Times of the results, in s (default: the end of the scene's last step).",
    **shared.outputs(plot=""),
}
USAGE = shared.ONE_SCENE
EXAMPLE = "plan --case 5 --tolerance 1e-9"


def run(options: argparse.Namespace) -> int:
    kinds = ("any_torque", "any_state", "changing", "states")
    scene = shared.chosen_scene(options, **dict.fromkeys(kinds, True))
    method = options.method or "auto"
    shared.check_known("method", method, PREPARED)
    tolerance = shared.chosen_tolerance(options)
    given = () if options.times is None else shared.numbers(options.times, "--times")
    rows = bool(given) and len(ascending_times(given)[0]) > 1
    shared.check_outputs(options)
    found = plan(scene, method, tolerance, options.velocity, rows)
    return shared.show(plan_report(scene, found), options)
