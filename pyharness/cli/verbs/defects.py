"""`defects`: the apparatus, and what each entry does."""

import argparse

from pyharness.cli import options as shared
from pyharness.history import apparatus_report as views
from pyharness.history.ablation import effects_of, entries, entry


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="an entry, with its effect")
    parser.add_argument("--kind", metavar="K", help="only the entries of one kind")
    parser.add_argument("--format", metavar="F", help="table (default) or json")
    parser.add_argument("--out", metavar="FILE", help="write to this file, not to the terminal")


def run(options: argparse.Namespace) -> int:
    """Show the list, or one entry with its effect in every case."""
    form = shared.chosen_format(options, ("table", "json"))
    listed = entries(options.kind)
    if options.name is None:
        shared.check_outputs(options)
        if form == "json":
            from pyharness.views.records import SCHEMA, json_text

            shared.emit(json_text({"schema": SCHEMA, "entries": listed}), options.out)
        else:
            shared.emit(views.apparatus_table(listed), options.out)
        return 0

    shared.refuse(options, "a name", ("kind",))
    chosen = entry(options.name)
    shared.check_outputs(options)
    effects = list(effects_of(options.name)) if "flag" in chosen else []
    if form == "json":
        from pyharness.views.records import SCHEMA, effects_record, json_text

        record = {"schema": SCHEMA, "entry": chosen, "effects": effects_record(effects)}
        shared.emit(json_text(record), options.out)
    else:
        text = views.entry_text(chosen)
        if effects:
            text += "\n" + views.effects_table(effects, chosen["kind"] == "reading")
        shared.emit(text, options.out)
    return 0
