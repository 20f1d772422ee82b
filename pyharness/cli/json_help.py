"""The fields of a command's JSON output, from their JSON Schema."""

import json
import textwrap
from collections.abc import Iterator
from typing import Any

from pyharness.model.facts import facts_folder


def schema() -> dict[str, Any]:
    """Return the JSON Schema of all commands' output; `$defs` has `verb-NAME` for each command."""
    found: dict[str, Any] = json.loads((facts_folder() / "output.schema.json").read_text())
    return found


def fields(whole: dict[str, Any], part: dict[str, Any], path: str) -> Iterator[tuple[str, str]]:
    """Yield path (which begins with `path`) and meaning of each field in `part` of a schema."""
    for name, each in part.get("properties", {}).items():
        own = each
        if "description" not in each:
            own = whole["$defs"][each["$ref"].rpartition("/")[2]]
        yield f"{path}{name}", own["description"]
        yield from fields(whole, each, f"{path}{name}.")
    for key in ("items", "additionalProperties"):
        if isinstance(inner := part.get(key), dict):
            yield from fields(whole, inner, f"{path.removesuffix('.')}[].")


def json_help(verb: str) -> str:
    whole = schema()
    lines = [f"fields of pyharness {verb} --format json:", ""]
    for path, meaning in fields(whole, whole["$defs"][f"verb-{verb}"], ""):
        lines += [f"  {path}", *textwrap.wrap(meaning, 94, initial_indent=" " * 6,
                                             subsequent_indent=" " * 6)]  # fmt: skip
    return "\n".join(lines) + "\n"
