"""The verb `cards`."""

import argparse
from hashlib import sha256
from typing import Any

from pyharness.cli import options as shared
from pyharness.history.cards_report import (
    cards_report,
    classes_report,
    collation_report,
    origins_report,
    scan_report,
)
from pyharness.history.origins import disagreements, mistakes
from pyharness.history.second_reading import second_reading_report
from pyharness.model.errors import InputError
from pyharness.model.pipes import read_input
from pyharness.thesis.cards import chosen
from pyharness.thesis.collation import expected_lines, faults, rows, undeclared, unexplained

_LARGEST_SCAN = 1 << 24  # largest size (bytes) of a scan's text
# Outputs instead of selected cards; TEI always has all cards.
_KINDS = ("--format tei", "--classes", "--collate", "--origins", "--second-reading", "--scan")
FORMATS = (*shared.FORMATS, "tei")
OPTIONS = {
    "cards CARDS": "Cards to show, separated by commas: programs, numbers or ranges, as in "
    "two-term, 1660, 1040-1090 or two-term:1660 (default: a table of contents; in JSON, CSV and "
    "Markdown, all cards).",
    "--classes": "For each kind of note (defect, doubtful reading, ...), count notes, annotated "
    "cards, and the differences between our text and the scan that the notes explain.",
    "--collate": "Compare the operations of the three programs with each other and with sections "
    "II to V of the thesis.",
    "--origins": "Show where the programs and the thesis disagree, and what this suggests about "
    "the origin of faults.",
    "--second-reading": "Compare our text of a random sample of cards with a second reading of "
    "the scan, and estimate how many misreadings remain.",
    "--scan FILE": "Compare our text of the cards, character by character, with this file, an OCR "
    "text of the thesis.",
    **shared.outputs(FORMATS, plot=""),
    "--format F": f"Output format: {FORMATS[0]} (default), {', '.join(FORMATS[1:])} (all cards and "
    "notes in TEI, the XML format of text editions).",
}
GROUPS = {"instead of cards": "classes collate origins second-reading scan"}
EXAMPLE = "cards runge-kutta:860"


def run(options: argparse.Namespace) -> int:
    """Print cards with scan, ports and notes, or a requested comparison.

    Return 1 for an unexplained difference or a mistake in the data.
    """
    given = [options.format == "tei", options.classes, options.collate, options.origins]
    given += [options.second_reading, options.scan is not None]
    if not any(given):
        cards = chosen(shared.names(options.cards))
        shared.check_outputs(options)
        return shared.show(cards_report(cards, only_contents=options.cards is None), options)
    kind, *others = _KINDS[given.index(True) :]
    shared.refuse(options, kind, others)
    if options.cards is not None:
        raise InputError(f"cards {options.cards!r} has no meaning with {kind}; give one of them")
    shared.check_outputs(options)
    text, lines = "", []
    if kind == "--scan":
        text = _text(options.scan)
        try:
            lines = unexplained(text)
        except InputError as error:
            raise InputError(f"--scan '{options.scan}': {error}") from None
    failures: Any = None
    match kind:
        case "--format tei":
            from pyharness.history.tei import tei_document

            shared.emit(tei_document(), options.out)
            return 0
        case "--classes":
            report = classes_report()
        case "--collate":
            found = rows()
            report, failures = collation_report(found), faults(found)
        case "--origins":
            failures = mistakes()
            report = origins_report(disagreements(), failures)
        case "--second-reading":
            report = second_reading_report()
        case _:
            undeclared_ = undeclared()
            digest = sha256(text.encode()).hexdigest()
            report = scan_report(lines, undeclared_, len(expected_lines()), digest)
            failures = lines or undeclared_
    return shared.show(report, options, failed=failures)


def _text(path: str) -> str:
    where = f"--scan '{path}'"
    content = read_input(path, where, _LARGEST_SCAN, "the text of a scan")
    try:
        return content.decode()
    except ValueError:
        raise InputError(f"{where}: is not text; give the text of a scan") from None
