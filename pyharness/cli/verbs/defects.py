"""The verb `defects`."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.ablation import apparatus_report, effects_of, entries, entry, entry_report
from pyharness.model.report import Report

FORMATS = ("table", "json")
OPTIONS = {
    "name NAME": "Show the effect of this defect or doubtful line in every case of the thesis. "
    "NAME is a name or card (line number), as in stage-base, 1660 or two-term:1660. Default: list "
    "the defects that change results.",
    "--all": "List all entries (JSON always has all); not with NAME.",
    "--kind K": "List only entries of this kind: defect (the author's fault), "
    "reading (line that can be read in two ways), conjecture (assumption about a missing line), "
    "misreading (character wrongly recognized in the scan), 'missing text' (lost cards or pages), "
    "normalization (name made uniform), dialect (peculiar to the machine's FORTRAN), redundant, "
    "unread (value never used) or unreachable (never executed). Not with NAME.",
    **shared.outputs(FORMATS, plot=""),
}
EXAMPLE = "defects stage-base"


def run(options: argparse.Namespace) -> int:
    listed = entries(options.kind)
    if options.name is None:
        shared.check_outputs(options)
        are_all_shown = options.all or options.kind is not None
        return shared.show(apparatus_report(listed, are_all_shown), options)
    shared.refuse(options, "a name", ("kind", "all"))
    if options.name.rpartition(":")[2].isdigit():
        return _card(options)
    entry(options.name)  # refuses an unknown name
    shared.check_outputs(options)
    return shared.show(_report(options.name), options)


def _card(options: argparse.Namespace) -> int:
    from pyharness.history.cards_report import cards_report
    from pyharness.thesis.cards import chosen

    cards = chosen([options.name])
    shared.check_outputs(options)
    names = list(dict.fromkeys(name for card in cards for name in card.entries))
    reports = [cards_report(cards, "defects"), *map(_report, names)]
    records = [each.record() for each in reports[1:]]
    whole = reports[0]._replace(
        text=[section for each in reports for section in each.text],
        record=lambda: {**reports[0].record(), "entries": records},
    )
    return shared.show(whole, options)


def _report(name: str) -> Report:
    known = entry(name)
    return entry_report(known, list(effects_of(name)) if "flag" in known else [])
