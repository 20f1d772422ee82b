"""The document `docs/explanation/principles.md`, made from the tables of the edition."""

from pyharness.edition.made_pages import paragraphs, table
from pyharness.history.revisions import CHANGES, Revision, revisions
from pyharness.history.tei_header import AUTHOR, CERTAINTY, KINDS
from pyharness.model.facts import facts

PAGE = "explanation/principles.md"
"""The path of the document in the folder `docs`."""

_HEAD = """\
This page states the rules of the edition: what is edited, what is changed, and how each change is
marked. This page is for readers who want to cite the edition or to check it. The page is made from
the files `edition.toml`, `apparatus.toml`, `revisions.toml` and `cards/scan.toml` in
`pyharness/data`.
"""
_WITNESS = """\
The edition has one *witness* (source of the text), the scan, with the siglum {siglum}. The scan is
a machine reading of the report, and its SHA-256 is `{sha256}`. The scan has two parts: {text}; and
{appendix}. {state}
"""
_READINGS = """\
Each place where the scan differs from our text has an entry in the apparatus, our list of
alterations. The entry names the cards, the characters of the scan and our characters. In the TEI
document, `lem` is our reading and `rdg` is the reading of the scan. The text of the scan can be
restored from the document, and a test does so. The faults of the author are no misreadings: our
text keeps them, and each has an entry of the kind `defect`.
"""
_CERTAINTY = """\
Each entry has one of four degrees of certainty. The second column is the value of the attribute
`cert` in the TEI document.
"""
_GROUNDS = """\
A *ground* is a reason for an entry. It is no witness, because it does not transmit the text of a
card. Each entry names its grounds by their letters.
"""
_HISTORY = """\
These are the revisions of the text, newest first. The text consists of the cards and the apparatus.
Each revision has the digest of the text after it, by the present definition of the digest. A
revision has no digest if the cards were not yet data at that time.
"""


def principles_page() -> str:
    """Return the document on the principles of the edition as Markdown.

    Its lines have at most 120 characters, except in tables.
    """
    scan, edition = facts("cards/scan"), facts("edition")
    (witness,) = scan["witness"]
    work = next(each for each in edition["work"] if each["id"] == "thesis")
    rights = edition["rights"]
    counts = [entry["kind"] for entry in facts("apparatus")["entry"]]
    sure = [entry["certainty"] for entry in facts("apparatus")["entry"]]
    principles = {
        name: f"{text[0].upper()}{text[1:]}." for name, text in scan["principles"].items()
    }
    parts = [
        "# Principles of the edition\n",
        paragraphs(_HEAD),
        "## What is edited\n",
        paragraphs(
            f"The edition has the three programs in the appendix of {AUTHOR}, *{work['title']}* "
            f"({work['year']}). Its text is every card of the three programs. "
            "The sentences, claims, formulas and figures of sections I to VI are quoted and "
            "judged, but not edited."
        ),
        paragraphs(_WITNESS.format(**{**edition["witness"], **witness})),
        "## What is kept and what is changed\n",
        table(
            "principle | what it covers", [[name, text] for name, text in principles.items()]
        ),
        "## How readings are marked\n",
        paragraphs(_READINGS),
        table(
            "kind of entry | meaning | entries",
            [[f"`{name}`", text, str(counts.count(name))] for name, text in KINDS.items()],
        ),
        "## Certainty\n",
        paragraphs(_CERTAINTY),
        table(
            "certainty | `cert` | entries",
            [[name, f"`{value}`", str(sure.count(name))] for name, value in CERTAINTY.items()],
        ),
        "## Grounds\n",
        paragraphs(_GROUNDS),
        table("ground | meaning", [[each["siglum"], each["what"]] for each in scan["ground"]]),
        "## Rights\n",
        paragraphs(rights["status"]),
        paragraphs(f"""{rights['where']}: "{rights['says']}"."""),
        paragraphs(f"{rights['edition']} The licence is in the file `LICENSE`."),
        "## Versions\n",
        paragraphs(
            f"The editors are {', '.join(edition['editors'])}. A citation names the version and "
            "the digest of the text, which `pyharness cards --classes` prints. The date of a "
            "version is its date in the file `CHANGELOG.md`, not the date on which a file was made."
        ),
        "## History of the text\n",
        paragraphs(_HISTORY),
        "".join(_revision(each) for each in revisions()),
        "## Bibliography\n",
        "".join(
            paragraphs(f"- {each['author']}: *{each['title']}*. {each['imprint']}. "
                    f"Used for: {each['use']}.", "  ")
            for each in edition["work"]
        ),
    ]  # fmt: skip
    return "\n".join(parts)


def _revision(revision: Revision) -> str:
    """Return a revision of the text as an item of a list."""
    digest = f"digest `{revision.digest}`" if revision.digest else "no digest"
    parts = [f"- **{revision.date}**, {digest}. {revision.what}"]
    for name, heading in CHANGES.items():
        if entries := getattr(revision, name):
            parts.append(f"{heading.capitalize()}: {', '.join(f'`{id}`' for id in entries)}.")
    if revision.cards:
        cards = "; ".join(f"{program} {cards}" for program, cards in revision.cards.items())
        parts.append(f"Cards: {cards}.")
    return paragraphs(" ".join(parts), "  ")
