"""`claims`: every statement of the thesis about results, judged."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.claims.ledger import assignments, claim, claims, judge
from pyharness.history.claims.report import assignments_report, claims_report, explanation

OPTIONS = {
    "--explain ID": "one claim, with its numbers",
    "--assignments": "which initial conditions let all claims hold",
    "--evidence": "score every combination of starts, readings, conjectures and steps",
    **shared.outputs(plot="draw the claims that discriminate (--evidence)"),
}


def run(options: argparse.Namespace) -> int:
    """Judge and show."""
    if options.assignments:
        shared.refuse(options, "--assignments", ("explain", "evidence"))
        shared.check_known("format", options.format, ("table", "json"))
    if options.evidence:
        return _evidence(options)
    shared.refuse(options, "the ledger; give --evidence", ("plot",))
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


def _evidence(options: argparse.Namespace) -> int:
    from pyharness.history.claims.evidence import combinations, evidence
    from pyharness.history.claims.evidence_report import evidence_report

    shared.refuse(options, "--evidence", ("explain",))
    shared.check_outputs(options)
    found, every = [], len(combinations())
    for combination in evidence():
        found.append(combination)
        shared.progress(f"{len(found)} of {every} combinations")
    shared.show(evidence_report(found), options)
    return 0
