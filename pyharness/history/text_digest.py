"""The name of the edition's text in a citation: a digest of its cards and its apparatus."""

import json
from collections.abc import Callable, Mapping
from hashlib import sha256
from typing import Any

from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS

TABLES = (*(f"cards/{program}" for program in PROGRAMS), "apparatus")
"""The tables of `data` that are the text: what each card reads, what the scan shows, and why."""


def text_digest(table: Callable[[str], Mapping[str, Any]] = facts) -> str:
    """Return the first 12 digits of the SHA-256 of the text.

    Port, twins and version of the project have no part in it, nor have comments in the tables.

    Parameters
    ----------
    table : callable, optional
        Returns each of `TABLES` by its name.
    """
    told = {name: table(name) for name in TABLES}
    text = json.dumps(told, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:12]
