"""`claims`: every statement of the thesis about results, judged."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.claims.ledger import assignments, claim, claims, judge
from pyharness.history.claims.report import assignments_report, claims_report, explanation

OPTIONS = {
    "--explain ID": "one claim, with its numbers",
    "--assignments": "which initial conditions let all claims hold",
    **shared.outputs(plot=""),
}


def run(options: argparse.Namespace) -> int:
    """Judge and show."""
    if options.assignments:
        shared.refuse(options, "--assignments", ("explain",))
        shared.check_known("format", options.format, ("table", "json"))
    chosen = claims() if options.explain is None else [claim(options.explain)]
    shared.check_outputs(options)
    if options.assignments:
        shared.show(assignments_report(assignments()), options)
        return 0

    judgements = []
    for number, entry in enumerate(chosen, 1):
        shared.progress(f"{number} of {len(chosen)}: {entry['id']}")
        judgements.append(judge(entry))
    one = options.explain is not None
    shared.show(explanation(judgements[0]) if one else claims_report(judgements), options)
    return 0
