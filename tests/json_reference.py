"""The page `docs/reference/json.md`, made of the JSON Schema beside it."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent.parent / "docs" / "reference"
SCHEMA: dict[str, Any] = json.loads((FOLDER / "output.schema.json").read_text())
_HEAD = """# Fields of JSON

All fields that `pyharness VERB --format json` writes, by verb. The page is made of the
[JSON Schema](output.schema.json), against which the tests validate the output. JSON is strict: a
number that is not finite is `null`, and numbers round-trip. `schema` changes only when a reader
would misunderstand. `[]` marks the items of a list, `*` any name. A field in *italics* is not
always there.
"""


def schema_of(verb: str) -> dict[str, Any]:
    """Return the schema of a verb's output, with the definitions that it uses."""
    return {"$ref": f"#/$defs/verb-{verb}", "$defs": SCHEMA["$defs"]}


def render() -> str:
    """Return the page: a table for each definition that verbs share, and for each verb."""
    parts = [_HEAD]
    names = list(SCHEMA["$defs"])
    for name in sorted(names, key=lambda each: not each.startswith("verb-")):
        own = SCHEMA["$defs"][name]
        title = name.removeprefix("verb-")
        kind = "" if name.startswith("verb-") else "An object that verbs share. "
        parts.append(f"## {title}\n\n{kind}{own['description']}\n")
        rows = "".join(f"| {field} | {type_} | {text} |\n" for field, type_, text in _rows(own, ""))
        parts.append(f"| field | type | meaning |\n| --- | --- | --- |\n{rows}")
    return "\n".join(parts)


def _rows(schema: dict[str, Any], path: str) -> Iterator[tuple[str, str, str]]:
    for name, each in schema.get("properties", {}).items():
        mark = "" if name in schema["required"] else "*"
        field = f"{mark}`{path}{name}`{mark}"
        if name == "schema":
            continue
        yield field, _type(each), _meaning(each)
        yield from _within(each, f"{path}{name}")


def _within(schema: dict[str, Any], path: str) -> Iterator[tuple[str, str, str]]:
    yield from _rows(schema, f"{path}.")
    if isinstance(items := schema.get("items"), dict):
        yield from _within(items, f"{path}[]")
    if isinstance(more := schema.get("additionalProperties"), dict):
        yield from _within(more, f"{path}.*")


def _meaning(schema: dict[str, Any]) -> str:
    if "description" in schema:
        return str(schema["description"])
    return str(SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]]["description"])


def _type(schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name})"
    if "anyOf" in schema:
        return " or ".join(_type(each) for each in schema["anyOf"])
    if "enum" in schema:
        return "string or null" if None in schema["enum"] else "string"
    types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    text = " or ".join(types)
    if isinstance(items := schema.get("items"), dict) and "$ref" in items:
        return f"{text} of {_type(items)}"
    return text
