"""Reports of the command `cards` on the punched cards of the thesis's programs."""

import textwrap
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from typing import Any

from pyharness.history.identifiers import text_digest
from pyharness.history.origins import Disagreement, origins, unexplained_defects
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Column, Field, Line, Report, Section, Table, counted, words
from pyharness.model.report import numbers as columns
from pyharness.thesis.cards import Card, deck, parallels
from pyharness.thesis.cards import numbers as cards_named
from pyharness.thesis.collation import Row, faults

_CLASSES = (
    *words("class"), Column("entries"), Column("flags"), Column("two-term"), Column("four-term"),
    Column("runge-kutta"), Column("places"),
)  # fmt: skip
_STEPS = (
    Column("step", left=True), *words("in decks thesis"), Column("why", left=True, fit="wrap"),
)  # fmt: skip
_DISAGREEMENTS = (
    *words("disagreement in equation origin certainty"), Column("entries", left=True, fit="wrap"),
)  # fmt: skip
_SHORT = dict(zip(PROGRAMS, ("2", "4", "R"), strict=True))
HALF = 48  # width (characters) of each of two texts side by side


def cards_report(
    cards: Sequence[Card], title: str = "cards", only_contents: bool = False
) -> Report:
    """Return the report of `cards`; with `only_contents`, its text is a table of contents."""
    rows = [[x.program, x.number, x.statement, x.scan, " ".join(x.entries)] for x in cards]
    data = columns("program card statement scan entries", rows)
    text = _contents(cards) if only_contents else list(map(_block, cards))
    return Report(title, text, lambda: {"cards": list(map(card_record, cards))}, data)


def _contents(cards: Sequence[Card]) -> list[Section]:
    parts: list[str] = []
    ranges: dict[tuple[str, str], list[int]] = {}
    for program in PROGRAMS:
        part, place = "", -1
        for card in (each for each in cards if each.program == program):
            if card.is_comment and " " in card.statement:
                part = card.statement.partition(" ")[2]
            elif not card.is_comment:
                if part not in parts:
                    parts.insert(place + 1, part)
                place = parts.index(part)
                ranges.setdefault((part, program), []).append(card.number)
    rows = []
    for part in parts:
        row = [ranges.get((part, program)) for program in PROGRAMS]
        ends = ["-".join(map(str, dict.fromkeys((x[0], x[-1])))) if x else None for x in row]
        rows.append([part or "(declarations)", *ends])
    return [
        ["Cards of each part of the programs, under the comment card that begins it:"],
        [Table([*words("part"), *words(" ".join(PROGRAMS))], rows)],
        ["`cards two-term:1660` shows a card, `cards 1040-1090` a range, `cards two-term` all."],
    ]


def card_record(card: Card) -> dict[str, Any]:
    """Return a card as a JSON record."""
    found = deck(card.program)
    # None if the scan agrees with our text, "" if it lacks the card.
    scan = (card.scan or "") if card.deviates else None
    differences = [each._asdict() for each in card.differences]
    port, twin = ([x._asdict() for x in of.get(card.number, [])] for of in (found.port, found.twin))
    about = {"program": card.program, "card": card.number, "statement": card.statement}
    text = {"scan": scan, "differences": differences, "entries": list(card.entries)}
    versions = {"fortran": port, "twin": twin, "absent": found.absent.get(card.number)}
    return about | text | versions | {"parallels": [each.name for each in parallels(card)]}


def scan_report(
    faults: Sequence[str], undeclared: Sequence[str], lines: int, digest: str
) -> Report:
    """Return a report on the unexplained lines of a scan with the SHA-256 `digest`.

    `faults` and `undeclared` are sentences from `collation`.
    """
    cards = [card for program in PROGRAMS for card in deck(program).cards.values()]
    deviating = sum(bool(each.differences or each.lost) for each in cards)
    pairs = sum(len(each.differences) for each in cards)
    lost = sum(each.lost is not None for each in cards)
    (read,) = (each["sha256"] for each in facts("cards/scan")["witness"])
    which = "the text that was read" if digest == read else "another text"
    told = (
        f"{counted(len(cards), 'card')}, {lost} of them lost; {deviating} deviate in their text, "
        f"in {pairs} places, {sum(each.printed is not None for each in cards)} in their number; "
        f"the scan has {counted(lines, 'line')}; it is {which} (SHA-256)"
    )
    unexplained = [*faults, *undeclared]
    end = f"{len(unexplained)} unexplained" if unexplained else "nothing is unexplained"
    told_of: dict[str, Any] = {"lines": lines, "cards": len(cards), "lost": lost}
    told_of |= {"deviating": deviating, "differences": pairs, "sha256": digest}
    record = told_of | {"unexplained": unexplained}
    data = columns("unexplained", [[each] for each in unexplained])
    return Report("cards", [[told], unexplained, [end]], lambda: record, data)


def classes_report() -> Report:
    """Report for each kind of apparatus entry the number of entries, and of cards with entries."""
    entries = facts("apparatus")["entry"]
    cards = [card for program in PROGRAMS for card in deck(program).cards.values()]
    entries_of = Counter(each.entry for card in cards for each in card.differences)
    rows = []
    for kind in dict.fromkeys(each["kind"] for each in entries):
        of_kind = [each for each in entries if each["kind"] == kind]
        named = [
            len({n for each in of_kind for n in cards_named(each["cards"].get(program, ""))})
            for program in PROGRAMS
        ]
        places = sum(entries_of[each["id"]] for each in of_kind)
        rows.append([kind, len(of_kind), sum("flag" in each for each in of_kind), *named, places])
    sure = Counter(each["certainty"] for each in entries)
    table = Table(_CLASSES, rows)
    edition = facts("cards/scan")
    head = [Field(f"{each['siglum']}  ", each["what"]) for each in edition["witness"]]
    grounds = [Field(f"{each['siglum']}  ", each["what"]) for each in edition["ground"]]
    principles = [Field(f"{name:12s}", f"{text}") for name, text in edition["principles"].items()]
    told = ", ".join(f"{number} {certainty}" for certainty, number in sure.items())
    text: list[Section] = [["witness:", *head], ["grounds of the entries:", *grounds], principles]
    text += [[table], [f"{len(entries)} entries: {told}; text {text_digest()}"]]
    classes = [dict(zip(table.in_full()[0], row, strict=True)) for row in rows]
    record = {"classes": classes, "certainty": dict(sure), "witnesses": edition["witness"]}
    record |= {"grounds": edition["ground"], "principles": edition["principles"]}
    return Report("cards", text, lambda: record | {"text": text_digest()}, table)


def _block(card: Card) -> Section:
    found = deck(card.program)
    ours, scan = card.text[5 if card.continues else 0 :].strip(), card.scan
    shown = "lost" if scan is None else scan if card.deviates else "as the card"
    absent = found.absent.get(card.number)
    missing = "-" if absent is None else f"none: {absent}"
    left = [*_named("card", [ours]), *_named("scan", [shown])]
    right = []
    for name, places in (("port", found.port), ("twin", found.twin)):
        texts = [f"{file}:{line} {text}" for file, line, text in places.get(card.number, ())]
        right += _named(name, texts or [missing])
    about = [each for each in facts("apparatus")["entry"] if each["id"] in card.entries]
    told = [Field(f"  {x['id']}: ", f"{x['kind']}, {x['certainty']}: {x['why']}") for x in about]
    alike = ", ".join(each.name for each in parallels(card))
    head = f"{card.program} {card.number}" + (f"   (parallel: {alike})" if alike else "")
    return [Line(head), *beside(left, right), *told]


def beside(left: Iterable[str], right: Iterable[str]) -> list[Line]:
    """Return two texts side by side; left lines must have at most `HALF` characters."""
    pairs = zip_longest(left, right, fillvalue="")
    return [Line(f"{a.ljust(HALF)}   {b}".rstrip()) for a, b in pairs]


def _named(name: str, texts: Iterable[str]) -> list[str]:
    lines = [line for text in texts for line in textwrap.wrap(text, HALF - 6)]
    return [f"{name if not k else '':6s}{line}" for k, line in enumerate(lines)]


def collation_report(found: Sequence[Row]) -> Report:
    told = faults([*found])
    rows, full = [], []
    for row in found:
        having = "".join(_SHORT[program] for program in row.cards) or "-"
        why = "; ".join(filter(None, (", ".join(row.entries), row.reason))) or "-"
        rows.append([row.what, having, row.decks, row.thesis, why])
        cards, entries = (row.cards.get(each, "") for each in PROGRAMS), " ".join(row.entries)
        verdicts = (row.decks, row.text, row.says, row.thesis)
        full.append([row.what, *cards, *verdicts, entries, row.reason])
    legend = (
        "in: the decks that have the step, 2 two-term, 4 four-term, R runge-kutta. decks: whether "
        "their statements agree, differ in names or in order alone, or differ. thesis: whether "
        "sections II to V agree with the decks, differ, or are silent. why: entries of the "
        "apparatus (`defects NAME`), and what else explains it."
    )
    end = "nothing is unexplained" if not told else f"{len(told)} unexplained"
    names = "step two-term four-term runge-kutta decks text says thesis entries reason"
    text: list[Section] = [[legend], [Table(_STEPS, rows)], told]
    text.append([f"{counted(len(found), 'step')}: {end}"])
    record = {"steps": [row._asdict() for row in found], "unexplained": told}
    return Report("cards", text, lambda: record, columns(names, full))


def origins_report(found: Sequence[Disagreement], mistakes: Sequence[str]) -> Report:
    rows, full = [], []
    for each in found:
        having = "".join(_SHORT[program] for program in each.cards) or "-"
        lists = [", ".join(names) or "-" for names in (each.equations, each.entries)]
        rows.append([each.id, having, lists[0], each.origin, each.certainty, lists[1]])
        head = [each.id, each.title, " ".join(each.equations), each.where, each.says]
        cards = (" ".join(map(str, each.cards.get(program, ()))) for program in PROGRAMS)
        ours = (each.differs, each.known, each.suggests, each.origin, each.certainty)
        full.append([*head, *cards, *ours, " ".join(each.entries), each.unnoticed])
    legend = (
        "in: the decks whose cards are quoted, 2 two-term, 4 four-term, R runge-kutta. equation: "
        "numbers of the formulas of the thesis. origin: kind of origin that we infer, as listed "
        "below. certainty: of this inference. entries: of the apparatus (`defects NAME`)."
    )
    names = (
        "disagreement title equations where says two-term four-term runge-kutta differs known "
        "suggests origin certainty entries unnoticed"
    )
    kinds = [Field(f"{name:16s}", text) for name, text in origins().items()]
    left = [f"not explained: {name}" for name in unexplained_defects()]
    end = [*left, *mistakes, counted(len(found), "disagreement")]
    text: list[Section] = [[legend], [Table(_DISAGREEMENTS, rows)], kinds, end]
    told = [each._asdict() for each in found]
    record = {"disagreements": told, "unexplained": [*unexplained_defects(), *mistakes]}
    return Report("cards", text, lambda: record, columns(names, full))
