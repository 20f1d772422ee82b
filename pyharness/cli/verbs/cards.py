"""`cards`: the text of the edition, card by card, beside the scan, the port and the twin."""

import argparse
from hashlib import sha256

from pyharness.cli import options as shared
from pyharness.history.cards_report import cards_report, classes_report, scan_report
from pyharness.model.errors import InputError
from pyharness.model.pipes import read_input
from pyharness.original.cards import chosen
from pyharness.original.collation import expected_lines, undeclared, unexplained

_LARGEST_SCAN = 1 << 24  # bytes
FORMATS = (*shared.FORMATS, "tei")
OPTIONS = {
    "cards CARDS": "two-term, 1660, 1040-1090, two-term:1660; all where nothing is named",
    "--classes": "count the alterations by class",
    "--scan FILE": "hold the cards against a scan of the thesis, character by character",
    **shared.outputs(FORMATS, plot=""),
}


def run(options: argparse.Namespace) -> int:
    """Show the cards; with a scan, what they do not explain, and 1 where there is any."""
    if options.format == "tei":
        from pyharness.history.tei import tei_document

        # Only the whole edition has a header and an apparatus.
        shared.refuse(options, "--format tei", ("classes", "scan"))
        _no_card(options, "--format tei")
        shared.check_outputs(options)
        shared.emit(tei_document(), options.out)
        return 0
    if options.classes:
        shared.refuse(options, "--classes", ("scan",))
        _no_card(options, "--classes")
        shared.check_outputs(options)
        shared.show(classes_report(), options)
        return 0
    if options.scan is None:
        found = chosen(shared.names(options.cards))
        shared.check_outputs(options)
        shared.show(cards_report(found), options)
        return 0
    _no_card(options, "--scan")
    text = _text(options.scan)
    faults, undeclared_ = unexplained(text), undeclared()
    digest = sha256(text.encode()).hexdigest()
    shared.check_outputs(options)
    shared.show(scan_report(faults, undeclared_, len(expected_lines()), digest), options)
    return 1 if faults or undeclared_ else 0


def _text(path: str) -> str:
    where = f"--scan '{path}'"
    content = read_input(path, where, _LARGEST_SCAN, "the text of a scan")
    try:
        return content.decode()
    except ValueError:
        raise InputError(f"{where}: is no text; give the text of a scan") from None


def _no_card(options: argparse.Namespace, chosen: str) -> None:
    if options.cards is not None:
        raise InputError(f"cards {options.cards!r} has no meaning with {chosen}; give one of them")
