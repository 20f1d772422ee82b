"""The history of the edition's text: the dates and contents of its changes.

The data are in `data/revisions.toml`.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from pyharness.model.facts import facts

CHANGES = {
    "added": "new entries",
    "changed": "altered entries",
    "removed": "removed entries",
}
"""The fields of a revision that name entries of the apparatus, each with its heading."""


class Revision(NamedTuple):
    """A change of the edition's text, which consists of the cards and the apparatus.

    Attributes
    ----------
    date : str
        The date of the change, as in ``2026-11-20``.
    what : str
        Sentences that say what changed in our reading.
    digest : str
        The digest of the text after the change, or nothing if the cards were not yet data.
    added, changed, removed : tuple of str
        The identifiers of the apparatus entries that the revision added, altered or removed.
    cards : mapping
        By program, the numbers of the cards whose text or differences from the scan changed, as in
        ``750-770, 800``.
    """

    date: str
    what: str
    digest: str = ""
    added: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    cards: Mapping[str, str] = {}


def revisions() -> tuple[Revision, ...]:
    """Return the revisions of the edition's text, newest first."""
    return tuple(_revision(row) for row in facts("revisions")["revision"])


def _revision(row: dict[str, Any]) -> Revision:
    entries = {name: tuple(row[name]) for name in CHANGES if name in row}
    return Revision(**{**row, **entries})
