"""The dates of the thesis, with their sources, and the revisions of the edition's text."""

from collections.abc import Mapping
from datetime import date
from typing import NamedTuple

from pyharness.model.facts import facts

CHANGES = {"added": "new entries", "changed": "altered entries", "removed": "removed entries"}
"""Fields of a revision that name apparatus entries, with their headings."""


class Event(NamedTuple):
    """An event in the history of the thesis, with its date and source."""

    id: str
    what: str
    where: str
    # "certain" if a source names the date, "probable" if another event implies it, or "unknown".
    certainty: str
    first: str = ""  # month, as in 1979-01
    last: str = ""
    quote: str = ""
    why: str = ""  # reason for a date that is not certain

    @property
    def date(self) -> str:
        """The date in words, as in ``January 1979 to April 1981``."""
        if not self.first:
            return "not dated"
        if self.first == self.last:
            return _in_words(self.first)
        if self.certainty == "probable":
            return f"between {_in_words(self.first)} and {_in_words(self.last)}"
        first, year = _in_words(self.first).split()
        return f"{first if year in self.last else _in_words(self.first)} to {_in_words(self.last)}"


def timeline() -> tuple[Event, ...]:
    names = {"from": "first", "to": "last"}
    found = []
    for row in facts("timeline")["entry"]:
        fields = {names.get(name, name): text for name, text in row.items()}
        found.append(Event(**{"last": row.get("from", "")} | fields))
    return tuple(found)


def _in_words(month: str) -> str:
    return f"{date.fromisoformat(f'{month}-01'):%B %Y}"


class Revision(NamedTuple):
    """A change of the edition's text (cards and apparatus)."""

    date: str
    what: str
    digest: str = ""  # digest of the text after the change, if cards were data files then
    added: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    cards: Mapping[str, str] = {}  # changed cards by program, as in 750-770, 800


def revisions() -> tuple[Revision, ...]:
    """Return the revisions, newest first."""
    return tuple(
        Revision(**row | {name: tuple(row[name]) for name in CHANGES if name in row})
        for row in facts("revisions")["revision"]
    )
