"""The verb `figures`."""

import argparse

from pyharness.cli import options as shared
from pyharness.history import figures as history
from pyharness.model.errors import InputError

FORMATS = ("table", "json")
OPTIONS = {
    "--out DIR": "Write the figures to this folder (created if missing), as SVG, PNG and CSV "
    "files.",
    "--format F": "Output format of the list of drawn figures: table (default) or json.",
}
USAGE = "--out DIR"
EXAMPLE = "figures --out figures"


def run(options: argparse.Namespace) -> int:
    from pyharness.cli.output import check_folder, write_folder
    from pyharness.views.pictures import check_matplotlib, saved

    if options.out is None:
        raise InputError("figures: give --out DIR, a folder for the files")
    plans = history.plans()
    check_folder(options.out, [name for plan in plans for name in plan.files], "--out")
    check_matplotlib("figures")

    content: dict[str, bytes] = {}
    drawn = []
    for number, finding in enumerate(history.findings(), 1):
        shared.progress(number - 1, len(plans), finding.plan.title)
        svg, png, _ = finding.plan.files
        content |= saved(history.figure_picture(finding), svg, png)
        drawn.append(finding)
    shared.end_progress()
    write_folder(options.out, content, "--out")
    return shared.show(history.figures_report(drawn), shared.without_out(options))
