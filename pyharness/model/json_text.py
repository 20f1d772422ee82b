"""JSON of other programs and of users' files, read without silent choices."""

import json
from collections.abc import Hashable, Iterable
from typing import Any, NoReturn, TypeVar

_Key = TypeVar("_Key", bound=Hashable)
_Value = TypeVar("_Value")
_LONGEST = 60  # most characters of a key in a message


def parse_json(text: str | bytes, *, only_finite: bool = True) -> Any:
    """Return the value of a JSON text, or raise ValueError.

    No object may have a key twice. NaN and Infinity, which JSON lacks, are accepted unless
    `only_finite`.
    """
    refusal: dict[str, Any] = {"parse_constant": _refuse_constant} if only_finite else {}
    try:
        return json.loads(text, object_pairs_hook=unique, **refusal)
    except RecursionError:
        raise ValueError("it has too many levels") from None


def unique(pairs: Iterable[tuple[_Key, _Value]]) -> dict[_Key, _Value]:
    """Return a dictionary; raise ValueError if a key occurs twice."""
    found: dict[_Key, _Value] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {json.dumps(key)[:_LONGEST]} occurs twice")
        found[key] = value
    return found


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f'{name} is not JSON; write text, as in "nan"')
