"""A digest of the edition's cards and apparatus, which identifies their text in citations."""

import json
from collections.abc import Callable, Mapping
from hashlib import sha256
from typing import Any

from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS

TABLES = (*(f"cards/{program}" for program in PROGRAMS), "apparatus")
"""The tables in `data` that make up the edition's text, without the suffix `.toml`.

They are the cards of each program with the scan's variants, and the apparatus.
"""


def text_digest(table: Callable[[str], Mapping[str, Any]] = facts) -> str:
    """Return 12 hexadecimal digits of the SHA-256 of the tables, without comments."""
    told = {name: table(name) for name in TABLES}
    text = json.dumps(told, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:12]
