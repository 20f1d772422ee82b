"""The verb `cards`: show the programs card by card, with the scan and our versions."""

import argparse
from hashlib import sha256

from pyharness.cli import options as shared
from pyharness.history.cards_report import cards_report, classes_report, scan_report
from pyharness.history.collation_report import collation_report
from pyharness.history.origins import disagreements, mistakes
from pyharness.history.origins_report import origins_report
from pyharness.history.second_reading import second_reading_report
from pyharness.model.errors import InputError
from pyharness.model.pipes import read_input
from pyharness.thesis.cards import chosen
from pyharness.thesis.collation import expected_lines, undeclared, unexplained
from pyharness.thesis.deck_collation import faults, rows

_LARGEST_SCAN = 1 << 24  # bytes
FORMATS = (*shared.FORMATS, "tei")
OPTIONS = {
    "cards CARDS": "Show these cards (lines of the programs), by program, number or range, as in "
    "two-term, 1660, 1040-1090 or two-term:1660 (default: all).",
    "--classes": "Count the notes of each kind (defect, doubtful reading, ...), the cards that "
    "they name, and the differences from the scan that they explain.",
    "--collate": "Compare the three programs, operation by operation, with each other and with "
    "sections II to V of the thesis.",
    "--origins": "Show where the programs and the thesis disagree, and what each disagreement "
    "suggests about the origin of a fault.",
    "--second-reading": "Compare our text of a random sample of cards with a second reading of "
    "the scan, and estimate how many misreadings remain.",
    "--scan FILE": "Compare our text of the cards, character by character, with the text in this "
    "file, which character recognition (OCR) made from a scan of the thesis.",
    **shared.outputs(FORMATS, plot=""),
    "--format F": f"Output format: {', '.join(FORMATS)} (default {FORMATS[0]}). tei: all cards "
    "and notes in TEI, the XML format of text editions.",
}
EXAMPLE = "cards runge-kutta:860"


def run(options: argparse.Namespace) -> int:
    """Print cards, or the comparison that an option requests.

    Return 1 if --scan or --collate finds a difference that the apparatus does not explain, or
    --origins a mistake in its table.
    """
    if options.format == "tei":
        from pyharness.history.tei import tei_document

        # Only the whole edition has the header and apparatus of a TEI document.
        shared.refuse(
            options, "--format tei", ("classes", "collate", "origins", "second_reading", "scan")
        )
        _no_card(options, "--format tei")
        shared.check_outputs(options)
        shared.emit(tei_document(), options.out)
        return 0
    if options.classes:
        shared.refuse(options, "--classes", ("collate", "origins", "second_reading", "scan"))
        _no_card(options, "--classes")
        shared.check_outputs(options)
        shared.show(classes_report(), options)
        return 0
    if options.collate:
        shared.refuse(options, "--collate", ("origins", "second_reading", "scan"))
        _no_card(options, "--collate")
        shared.check_outputs(options)
        found = rows()
        shared.show(collation_report(found), options)
        return 1 if faults(found) else 0
    if options.origins:
        shared.refuse(options, "--origins", ("second_reading", "scan"))
        _no_card(options, "--origins")
        shared.check_outputs(options)
        told = mistakes()
        shared.show(origins_report(disagreements(), told), options)
        return 1 if told else 0
    if options.second_reading:
        shared.refuse(options, "--second-reading", ("scan",))
        _no_card(options, "--second-reading")
        shared.check_outputs(options)
        shared.show(second_reading_report(), options)
        return 0
    if options.scan is None:
        cards = chosen(shared.names(options.cards))
        shared.check_outputs(options)
        shared.show(cards_report(cards), options)
        return 0
    _no_card(options, "--scan")
    text = _text(options.scan)
    lines, undeclared_ = unexplained(text), undeclared()
    digest = sha256(text.encode()).hexdigest()
    shared.check_outputs(options)
    shared.show(scan_report(lines, undeclared_, len(expected_lines()), digest), options)
    return 1 if lines or undeclared_ else 0


def _text(path: str) -> str:
    where = f"--scan '{path}'"
    content = read_input(path, where, _LARGEST_SCAN, "the text of a scan")
    try:
        return content.decode()
    except ValueError:
        raise InputError(f"{where}: is not text; give the text of a scan") from None


def _no_card(options: argparse.Namespace, chosen: str) -> None:
    if options.cards is not None:
        raise InputError(f"cards {options.cards!r} has no meaning with {chosen}; give one of them")
