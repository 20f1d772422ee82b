"""`defects`: the apparatus, and what each entry does."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.ablation import effects_of, entries, entry
from pyharness.history.apparatus_report import apparatus_report, entry_report

FORMATS = ("table", "json")
OPTIONS = {
    "name NAME": "an entry, with its effect",
    "--kind K": "only the entries of one kind",
    **shared.outputs(FORMATS, plot=""),
}


def run(options: argparse.Namespace) -> int:
    """Show the list, or one entry with its effect in every case."""
    listed = entries(options.kind)
    if options.name is None:
        shared.check_outputs(options)
        shared.show(apparatus_report(listed), options)
        return 0
    shared.refuse(options, "a name", ("kind",))
    chosen = entry(options.name)
    shared.check_outputs(options)
    effects = list(effects_of(options.name)) if "flag" in chosen else []
    shared.show(entry_report(chosen, effects), options)
    return 0
