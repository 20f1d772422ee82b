"""The JSON Schema of the output of every verb, which documents its fields."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent.parent / "docs" / "reference"
SCHEMA: dict[str, Any] = json.loads((FOLDER / "output.schema.json").read_text())


def schema_of(verb: str) -> dict[str, Any]:
    """Return the schema of a verb's output, with the definitions that it uses."""
    return {"$ref": f"#/$defs/verb-{verb}", "$defs": SCHEMA["$defs"]}


def fields(schema: dict[str, Any], path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the path and the schema of each field."""
    for name, each in schema.get("properties", {}).items():
        yield f"{path}.{name}", each
        yield from fields(each, f"{path}.{name}")
    for key in ("items", "additionalProperties"):
        if isinstance(inner := schema.get(key), dict):
            yield from fields(inner, f"{path}[]")


def meaning(schema: dict[str, Any]) -> str:
    """Return the description of a field, its own or that of the definition it refers to."""
    if "description" in schema:
        return str(schema["description"])
    return str(SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]]["description"])
