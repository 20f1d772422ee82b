"""The history of the edition's text, from `data/revisions.toml`."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from pyharness.model.facts import facts

CHANGES = {"added": "new entries", "changed": "altered entries", "removed": "removed entries"}
"""The fields of a revision that name apparatus entries, with their headings."""


class Revision(NamedTuple):
    """A change of the edition's text: the cards and the apparatus.

    `digest` identifies the text after the change, and is empty if the cards were not yet data.
    `cards` has numbers by program, as in ``750-770, 800``.
    """

    date: str
    what: str
    digest: str = ""
    added: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    cards: Mapping[str, str] = {}


def revisions() -> tuple[Revision, ...]:
    """Return the revisions, newest first."""
    return tuple(_revision(row) for row in facts("revisions")["revision"])


def _revision(row: dict[str, Any]) -> Revision:
    entries = {name: tuple(row[name]) for name in CHANGES if name in row}
    return Revision(**{**row, **entries})
