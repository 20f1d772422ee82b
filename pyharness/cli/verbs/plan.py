"""`plan`: what a scene needs, what is therefore not computed, and why."""

import argparse
from dataclasses import asdict

from pyharness.cli import options as shared
from pyharness.methods.plan import plan
from pyharness.methods.prepared import PREPARED
from pyharness.model.errors import unknown
from pyharness.views.text import aligned, csv_text, heading, markdown_text, wrapped

_HEAD = ("part", "computed", "why")


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    shared.add_scene_options(parser)
    parser.add_argument("--method", metavar="M", help="auto (default), or a name")
    parser.add_argument("--tolerance", metavar="E", help="relative (default 1e-12)")
    parser.add_argument("--velocity", action="store_true", help="the velocity is wanted too")
    parser.add_argument(
        "--rows", action="store_true", help="results on the way are wanted too, as in run"
    )
    parser.add_argument("--format", metavar="F", help=", ".join(shared.FORMATS))
    parser.add_argument("--out", metavar="FILE", help="write to this file, not to the terminal")


def run(options: argparse.Namespace) -> int:
    """Show the decisions for a scene."""
    scene = shared.chosen_scene(options)
    form = shared.chosen_format(options, shared.FORMATS)
    method = options.method or "auto"
    if method not in PREPARED:
        raise unknown("method", method, PREPARED, "--method")
    tolerance = shared.positive(options.tolerance, "--tolerance", 1e-12)
    shared.check_outputs(options)
    found = plan(scene, method, tolerance, options.velocity, options.rows)
    rows = [[each.part, "yes" if each.kept else "no", each.why] for each in found.decisions]
    if form == "json":
        from pyharness.views.records import SCHEMA, json_text, scene_record

        record = {
            "method": found.method,
            "closed_form": found.closed_form,
            "decisions": [asdict(each) for each in found.decisions],
        }
        text = json_text({"schema": SCHEMA, "scene": scene_record(scene), "plan": record})
    elif form == "table":
        lines = [*heading(scene), *wrapped(f"method: {found.method}"), ""]
        text = "\n".join([*lines, *aligned(_HEAD, rows, left=3)]) + "\n"
    else:
        text = (csv_text if form == "csv" else markdown_text)(_HEAD, rows)
    shared.emit(text, options.out)
    return 0
