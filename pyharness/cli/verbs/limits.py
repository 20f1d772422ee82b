"""`limits`: what the programs as punched tend to as the step goes to zero."""

import argparse
from collections.abc import Callable, Sequence

from pyharness.cli import options as shared
from pyharness.history.limits import Limit, invisible, limit
from pyharness.model.errors import InputError, unknown
from pyharness.model.listing import PROGRAMS
from pyharness.views.text import aligned, csv_text, heading, markdown_text, short, wrapped

_HEAD = ("program", "step", "from the limit", "from the truth")


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    shared.add_scene_options(parser)
    parser.add_argument("--program", metavar="P", help="this program only")
    parser.add_argument("--halvings", metavar="K", help="how often the step is halved (default 6)")
    shared.add_effort_option(parser)
    parser.add_argument("--format", metavar="F", help=", ".join(shared.FORMATS))
    parser.add_argument("--out", metavar="FILE", help="write to this file, not to the terminal")


def run(options: argparse.Namespace) -> int:
    """Hold the programs as punched against their limits and against the truth."""
    scene = shared.chosen_scene(options)
    form = shared.chosen_format(options, shared.FORMATS)
    if options.program is not None and options.program not in PROGRAMS:
        raise unknown("program", options.program, PROGRAMS, "--program")
    programs = PROGRAMS if options.program is None else (options.program,)
    halvings = 6 if options.halvings is None else shared.whole(options.halvings, "--halvings")
    if not 1 <= halvings <= 12:
        raise InputError(f"--halvings: {halvings}; allowed: 1 to 12")
    shared.check_outputs(options)
    effort = shared.chosen_effort(options)
    found = [limit(program, scene, halvings, effort) for program in programs]
    if form == "json":
        from dataclasses import asdict

        from pyharness.views.records import SCHEMA, json_text, scene_record

        record = {
            "schema": SCHEMA,
            "scene": scene_record(scene),
            "limits": [asdict(each) for each in found],
            "invisible": {name: list(each) for name, each in invisible(scene).items()},
        }
        text = json_text(record)
    elif form == "table":
        lines = heading(scene)
        for each in found:
            lines += ["", *wrapped(f"{each.program} as punched tends to {each.tends_to}")]
            lines += aligned(_HEAD[1:], [row[1:] for row in _rows(each, short)], left=0)
            lines.append(f"order {each.order:.2f} toward the limit")
        hidden = invisible(scene)
        lines += ["", "defects that change no omega here, mended alone:"]
        lines += wrapped("; ".join(f"{p}: {', '.join(hidden[p]) or 'none'}" for p in programs))
        text = "\n".join(lines) + "\n"
    else:
        rows = [row for each in found for row in _rows(each, repr)]
        text = (csv_text if form == "csv" else markdown_text)(_HEAD, rows)
    shared.emit(text, options.out)
    return 0


def _rows(found: Limit, write: Callable[[float], str]) -> Sequence[list[str]]:
    return [
        [found.program, f"{h.step_size:g}", write(h.from_limit), write(h.from_truth)]
        for h in found.halvings
    ]
