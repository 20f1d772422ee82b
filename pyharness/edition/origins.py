"""The document `docs/explanation/origins.md`, made from the table of disagreements.

A disagreement is one of the card decks with each other, or with the text of the thesis. Other pages
of the edition link to the parts of this document.
"""

from collections.abc import Iterator, Sequence

from pyharness.edition.made_pages import paragraphs, table
from pyharness.edition.markdown import slug
from pyharness.history.origins import (
    Disagreement,
    disagreements,
    origins,
    shared_statements,
    statement_count,
    unexplained_defects,
)

PAGE = "explanation/origins.md"
"""The path of the document in the folder `docs`."""

_HEAD = """\
The three programs of the thesis were not written independently of each other. Where their decks of
cards disagree with each other, or with sections II to V of the thesis, the disagreement may show
how a fault arose. This page is for historians of computing.

The page lists each disagreement once. *Known* is what the cards or the thesis say, and anyone can
read it there. *Inferred* is what we conclude from it, and the certainty in parentheses is the
certainty of this inference. The quoted cards have our text. The command `pyharness cards
--origins` prints the list, and `pyharness cards --collate` compares the decks step by step. The
page is made from the file `pyharness/data/disagreements.toml`.
"""
_SHARED = """\
A *shared* statement has the same characters in two decks, without its statement number and blanks.
If decks had been written separately, only their simplest statements would be the same.
"""
_UNNOTICED = """\
The thesis tests its programs in two cases whose solution is known, Cases 1 and 2. In Case 1 the
three products of Euler's equations vanish, because A, B and C are 0. In Case 2 the product in the
third equation vanishes, because C is 0. A fault in the points at which products are evaluated has
therefore no effect on omega in Case 1.
"""


def origins_page() -> str:
    """Return the document on the origins of the faults as Markdown, with lines of 120 characters.

    It has a table of all disagreements, and a part for each of them.
    """
    found = disagreements()
    parts = ["# Where the faults came from\n", paragraphs(_HEAD)]
    parts += ["## Statements that decks share\n", paragraphs(_SHARED)]
    heads = "decks | shared statements | of these, shared by our names of the torques alone"
    parts.append(table(f"{heads} | statements in each deck", _shared_rows()))
    parts += ["## Why the tests of the thesis did not show the faults\n"]
    parts.append(paragraphs(_UNNOTICED))
    parts.append("## Kinds of origin\n")
    rows = [
        [name, text, str(sum(each.origin == name for each in found))]
        for name, text in origins().items()
    ]
    parts.append(table("origin | meaning | disagreements", rows))
    parts.append("## All disagreements\n")
    rows = [
        [f"[{each.title}](#{slug(each.title)})", each.origin, each.certainty, _codes(each.entries)]
        for each in found
    ]
    parts.append(table("disagreement | inferred origin | certainty | apparatus", rows))
    parts += [_part(each) for each in found]
    parts += ["## Defects without an explanation\n", *_unexplained()]
    return "\n".join(parts)


def origins_of(entry: str) -> list[tuple[str, str]]:
    """Return title and link of each disagreement that concerns an entry of the apparatus.

    The links are relative to the root of the web site.
    """
    return [_linked(each) for each in disagreements() if entry in each.entries]


def origins_of_step(what: str) -> list[tuple[str, str]]:
    """Return title and link of each disagreement in a step of the comparison of the decks.

    `what` is the description of the step. The links are relative to the root of the web site.
    """
    return [_linked(each) for each in disagreements() if what in each.steps]


def _linked(each: Disagreement) -> tuple[str, str]:
    return each.title, f"docs/{PAGE.removesuffix('.md')}.html#{slug(each.title)}"


def _shared_rows() -> list[list[str]]:
    in_scan = shared_statements(scanned_names=True)
    return [
        [
            f"{one} and {other}", str(count), str(count - in_scan[one, other]),
            f"{statement_count(one)} and {statement_count(other)}",
        ]
        for (one, other), count in shared_statements().items()
    ]  # fmt: skip


def _part(each: Disagreement) -> str:
    parts = [f"## {each.title}\n"]
    rows = [
        [program, str(number), f"`{' '.join(text.split())}`"]
        for program, quotes in each.cards.items()
        for number, text in quotes.items()
    ]
    if rows:
        parts.append(table("program | card | text", rows))
    given = ", ".join(each.equations)
    noun = "equations" if "," in given or "-" in given else "equation"
    numbers = f"{noun} {given}" if given else ""
    thesis = "; ".join(text for text in (numbers, each.where) if text)
    if each.says:
        thesis += f": *{_escaped(each.says)}*"
    entries = _codes(each.entries) or "none"
    items = [
        f"Thesis: {thesis or 'silent'}.", f"Differs: {each.differs}", f"Known: {each.known}",
        f"Inferred ({each.origin}; {each.certainty}): {each.suggests}",
    ]  # fmt: skip
    items += [f"Unnoticed: {each.unnoticed}"] if each.unnoticed else []
    items.append(f"Apparatus: {entries}.")
    return "\n".join([*parts, *(_item(item) for item in items)]) + "\n"


def _unexplained() -> Iterator[str]:
    yield "".join(f"{_item(f'`{name}`: {why}')}\n" for name, why in unexplained_defects().items())


def _item(text: str) -> str:
    label, colon, rest = text.partition(":")
    bold = text if label.startswith("`") else f"**{label}{colon}**{rest}"
    return paragraphs(f"- {bold}", "  ").rstrip()


def _codes(names: Sequence[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _escaped(text: str) -> str:
    """Return a quotation in which the characters of Markdown have no meaning."""
    return "".join(f"\\{each}" if each in "_*`[]" else each for each in text)
