"""The report of `figures`: what was drawn."""

from collections.abc import Sequence

from pyharness.history.figure_pictures import label
from pyharness.history.figures import ENDINGS, FigureFinding
from pyharness.model.records import build_record
from pyharness.model.report import Report, Table, words


def figures_report(findings: Sequence[FigureFinding]) -> Report:
    """Report the files, a line for each figure."""
    rows = [
        [
            f"{finding.plan.stem}.{{{','.join(ENDINGS)}}}",
            finding.plan.case,
            ", ".join(map(label, finding.curves)),
        ]
        for finding in findings
    ]
    return Report(
        "figures",
        text=[[Table(words("files case curves"), rows)]],
        record=lambda: {
            "figures": [
                {
                    "figure": finding.plan.title,
                    "case": finding.plan.case,
                    "set": finding.plan.set,
                    "caption": finding.plan.caption,
                    "source": finding.plan.source,
                    "curves": [
                        {
                            "program": each.listing.program,
                            "listing": each.listing.label,
                            "steps": each.trajectory.steps,
                            "ended": each.trajectory.ended,
                        }
                        for each in finding.curves
                    ],
                    "files": finding.plan.files,
                }
                for finding in findings
            ],
            "build": build_record(),
        },
    )
