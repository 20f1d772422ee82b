"""The document `docs/explanation/about-the-text.md`, made from the edition's tables.

Its text is in the template `about-the-text.md.in`.
"""

from collections import Counter
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path

from docs.article.build import rendered, wrapped
from pyharness.edition.made_pages import table
from pyharness.history.ablation import entries
from pyharness.history.origins import disagreements, origins, unexplained_defects
from pyharness.history.second_reading import second_reading_report
from pyharness.history.tei import CERTAINTY, KINDS
from pyharness.history.timeline import CHANGES, Revision, revisions, timeline
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.thesis.cards import deck, tight
from pyharness.thesis.collation import rows

HERE = Path(__file__).parent
PAGE = "explanation/about-the-text.md"
"""The path of the document in the folder `docs`."""


def text_page() -> str:
    """Return the document as Markdown, with lines of at most 120 characters."""
    scan, edition = facts("cards/scan"), facts("edition")
    (witness,) = scan["witness"]
    reading = second_reading_report().record()
    found = {
        "cards": str(sum(len(deck(program).cards) for program in PROGRAMS)),
        "witness": witness | edition["witness"],
        "rights": edition["rights"],
        "editors": ", ".join(edition["editors"]),
        "principles": table("principle | what it covers", [
            [name, f"{text[0].upper()}{text[1:]}."] for name, text in scan["principles"].items()
        ]),
        "kinds": _counted("kind of entry | meaning | entries", "kind", KINDS),
        "certainty": _counted("certainty | `cert` in TEI | entries", "certainty", CERTAINTY),
        "grounds": table(
            "ground | meaning", [[each["siglum"], each["what"]] for each in scan["ground"]]
        ),
        "sample": reading["sample"],
        "uncorrected": str(max(each["uncorrected"] for each in reading["recaptures"])),
        "recaptures": table(
            "unit | corrected by our text | by the second reading | by both | estimate | "
            "95 % interval | uncorrected",
            [
                [
                    *(str(each[name]) for name in ("unit", "first", "second", "both", "estimate")),
                    f"{each['lower']} to {each['upper']}", str(each["uncorrected"]),
                ]
                for each in reading["recaptures"]
            ],
        ),
        "steps": str(len(rows())),
        "shared": _shared_table(),
        "origins": _origins_table(),
        "disagreements": _disagreements_table(),
        "unexplained": _items(f"`{name}`: {why}" for name, why in unexplained_defects().items()),
        "events": _events_table(),
        "gaps": table("question | what we know", [
            [each["question"], each["answer"]] for each in facts("timeline")["gap"]
        ]),
        "revision": _revision(revisions()[0]),
        "earlier": str(len(revisions()) - 1),
        "works": _items(
            f"{each['author']}: *{each['title']}*. {each['imprint']}. Used for: {each['use']}."
            for each in edition["work"]
        ),
    }  # fmt: skip
    return wrapped(rendered((HERE / "about-the-text.md.in").read_text(encoding="utf-8"), found))


def _counted(head: str, field: str, meanings: dict[str, str]) -> str:
    counts = [entry[field] for entry in entries()]
    return table(
        head, [[f"`{name}`", text, str(counts.count(name))] for name, text in meanings.items()]
    )


def shared_statements(scanned_names: bool = False) -> dict[tuple[str, str], int]:
    """Return the number of statements that each pair of decks shares, with our or scanned names."""
    found = {program: Counter(statements(program, scanned_names)) for program in PROGRAMS}
    return {(a, b): (found[a] & found[b]).total() for a, b in combinations(PROGRAMS, 2)}


def statements(program: str, scanned_names: bool = False) -> list[str]:
    """Return the statements of a program, without comments, labels and blanks."""
    cards = (card for card in deck(program).cards.values() if not card.is_comment)
    texts = (card.text_with_scanned_names if scanned_names else card.text for card in cards)
    return [tight(text[6:]) for text in texts]


def _shared_table() -> str:
    in_scan = shared_statements(scanned_names=True)
    counts = [
        [
            f"{one} and {other}", str(count), str(count - in_scan[one, other]),
            f"{len(statements(one))} and {len(statements(other))}",
        ]
        for (one, other), count in shared_statements().items()
    ]  # fmt: skip
    heads = "decks | shared statements | of these, shared only with our names of the torques"
    return table(f"{heads} | statements in each deck", counts)


def _origins_table() -> str:
    found = [each.origin for each in disagreements()]
    kinds = [[name, text, str(found.count(name))] for name, text in origins().items()]
    return table("origin | meaning | disagreements", kinds)


def _disagreements_table() -> str:
    inferred = [
        [
            each.title, each.suggests, f"{each.origin}; {each.certainty}",
            ", ".join(f"`{name}`" for name in each.entries),
        ]
        for each in disagreements()
    ]  # fmt: skip
    return table("disagreement | what we infer | origin; certainty | apparatus", inferred)


def _events_table() -> str:
    events = [[each.date, each.what, each.where, each.certainty] for each in timeline()]
    return table("date | event | source in the thesis | certainty of the date", events)


def _revision(revision: Revision) -> str:
    parts = [f"- **{revision.date}**, digest `{revision.digest}`. {revision.what}"]
    for name, heading in CHANGES.items():
        if names := getattr(revision, name):
            parts.append(f"{heading.capitalize()}: {', '.join(f'`{each}`' for each in names)}.")
    return " ".join(parts)


def _items(texts: Iterable[str]) -> str:
    return "\n".join(f"- {each}" for each in texts)
