"""The JSON Schema of the output of every verb, which documents its fields."""

from typing import Any

from pyharness.cli.json_help import schema

SCHEMA = schema()


def schema_of(verb: str) -> dict[str, Any]:
    """Return the schema of a verb's output, with the definitions that it uses."""
    return {"$ref": f"#/$defs/verb-{verb}", "$defs": SCHEMA["$defs"]}
