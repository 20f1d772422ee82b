"""`figures`: Figures 6 to 12 of the thesis, from the programs as punched and as mended."""

import argparse

from pyharness.cli import options as shared
from pyharness.history import figures as room
from pyharness.model.errors import InputError


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    parser.add_argument("--out", metavar="DIR", help="folder for SVG, PNG and CSV; made if missing")
    parser.add_argument("--format", metavar="F", help="table (default) or json: of what was drawn")


def run(options: argparse.Namespace) -> int:
    """Compute and draw everything, then write everything."""
    from pyharness.cli.output import check_folder, write_folder
    from pyharness.history import figure_pictures as views

    form = shared.chosen_format(options, ("table", "json"))
    if options.out is None:
        raise InputError("figures: give --out DIR, a folder for the files")
    plans = room.plans()
    names = [f"{plan.stem}.{ending}" for plan in plans for ending in views.ENDINGS]
    check_folder(options.out, names, "--out")
    views.check_matplotlib()

    content: dict[str, bytes] = {}
    drawn = []
    for number, finding in enumerate(room.findings(), 1):
        shared.progress(f"figures: {number} of {len(plans)}")
        content.update(views.files(finding))
        drawn.append(finding)
    shared.progress("")
    write_folder(options.out, content, "--out")

    if form == "json":
        from pyharness.model.build import build
        from pyharness.views.records import json_text

        shared.emit(json_text(views.figures_record(drawn, build())), None)
    else:
        shared.emit(views.figures_table(drawn), None)
    return 0
