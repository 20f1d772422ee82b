"""Test vectors for the arithmetic of CDC machines, and our results.

`data/words/cdc.json` follows from the CYBER 170 hardware reference, CDC 60463560; a public emulator
agrees. A file is a JSON object with `schema` and `vectors`: objects with `name`, `op` (as in
`octal.operated`), and `x`, `y` and `result` in octal.
"""

import json
import re
from pathlib import Path
from typing import Any, NamedTuple

from pyharness.model.errors import InputError, kind_of
from pyharness.model.pipes import read_input
from pyharness.model.schema import check_schema
from pyharness.thesis.octal import operated

OURS = Path(__file__).parent.parent / "data" / "words" / "cdc.json"
_LARGEST = 1 << 24  # bytes of a file
_FIELDS = ("name", "op", "x", "y", "result")


class Vector(NamedTuple):
    """An instruction with two operands and the expected result, in octal."""

    name: str
    op: str
    x: str
    y: str
    result: str


class Answer(NamedTuple):
    """A test vector, and `found`, our own result (octal)."""

    vector: Vector
    found: str

    @property
    def agrees(self) -> bool:
        """Return whether our result equals the expected one; blanks are ignored."""
        return "".join(self.vector.result.split()) == "".join(self.found.split())


def answers(path: str | Path = OURS) -> list[Answer]:
    """Return the vectors of a JSON file with our results; raise InputError if it is invalid."""
    content = read_input(path, f"vectors '{path}'", _LARGEST, "a JSON file")
    try:
        data = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise InputError(f"vectors '{path}': not JSON: {error}; give a JSON file") from None
    allowed = 'allowed: {"schema": 1, "vectors": [...]}'
    if not isinstance(data, dict):
        raise InputError(f"vectors '{path}': {kind_of(data)}; {allowed}")
    check_schema(f"vectors '{path}'", "vector file", data.get("schema"), allowed)
    entries = data.get("vectors")
    if not isinstance(entries, list) or not entries:
        raise InputError(f"vectors '{path}': vectors is {kind_of(entries)}; {allowed}")
    return [_answer(f"vectors '{path}', entry {n}", each) for n, each in enumerate(entries, 1)]


def _answer(where: str, entry: Any) -> Answer:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: {kind_of(entry)}; allowed: a table of {', '.join(_FIELDS)}")
    for field in _FIELDS:
        if not isinstance(entry.get(field), str):
            raise InputError(f"{where}: {field} is {kind_of(entry.get(field))}; it must be text")
    vector = Vector(*(entry[field] for field in _FIELDS))
    if not re.fullmatch("[0-7]{20}", "".join(vector.result.split())):
        raise InputError(f"{where}: result {vector.result!r}: not 20 octal digits")
    try:
        return Answer(vector, operated(vector.op, vector.x, vector.y))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
