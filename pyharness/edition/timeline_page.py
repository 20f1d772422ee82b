"""The document `docs/explanation/timeline.md`, made from the table of dates."""

from pyharness.edition.made_pages import paragraphs, table
from pyharness.history.timeline import CERTAINTIES, gaps, timeline

PAGE = "explanation/timeline.md"
"""The path of the document in the folder `docs`."""

_HEAD = """\
This page lists the events in the history of the thesis with their dates and sources. A date is here
only if the text of the thesis supports it. The last column says how certain the date of an event
is; the event itself is reported by its source:
"""


def timeline_page() -> str:
    """Return the document with the events in the history of the thesis as Markdown."""
    meanings = "".join(f"- *{name}*: {meaning}.\n" for name, meaning in CERTAINTIES.items())
    events = [
        [
            each.date, each.what, each.where,
            f"{each.certainty}: {each.why}" if each.why else each.certainty,
        ]
        for each in timeline()
    ]  # fmt: skip
    parts = [
        "# Timeline\n",
        paragraphs(_HEAD),
        meanings,
        table("date | event | source in the thesis | certainty of the date", events),
        "## What the sources do not say\n",
        table("question | what we know", [[each.question, each.answer] for each in gaps()]),
    ]
    return "\n".join(parts)
