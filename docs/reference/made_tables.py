"""Tables of methods, ready torques and ready events, and the schema of scene files."""

import json
import re
from collections import defaultdict
from pathlib import Path
from typing import Any

from pyharness.edition.made_pages import table
from pyharness.engine.events.ready_events import EVENTS
from pyharness.engine.plan.registry import METHODS
from pyharness.engine.torques.ready import VECTOR, Argument, Ready
from pyharness.engine.torques.term_file import KINDS

ROOT = Path(__file__).parent.parent.parent
_PLURAL = {"number": "numbers", "vector": "rows", "matrix": "matrices"}
_WORDS = {
    "vector": "three numbers",
    "matrix": "a matrix",
    "law": "a law",
    "quaternion": "a quaternion",
}


def pages() -> list[tuple[str, str]]:
    """Return the files with tables, by their paths in the project, and their texts made anew."""
    schema = "pyharness/data/scene.schema.json"
    made: dict[str, str] = {schema: _with_kinds((ROOT / schema).read_text())}
    for page, head, rows in (
        ("docs/reference/scene-files.md", "`kind` | keys | units", _kinds()),
        ("docs/how-to/torques.md", "function | torque | arguments", _functions(KINDS)),
        ("docs/how-to/results.md", "function | event | arguments", _functions(EVENTS)),
        ("docs/reference/conventions.md", "torque | convention", _conventions()),
        (
            "docs/reference/methods.md",
            "method | description | order | default tolerance | finest",
            _methods(),
        ),
    ):
        old = rf"^\| {re.escape(head)} \|\n(?:\|.*\n)+"
        parts = re.split(old, (ROOT / page).read_text(), flags=re.MULTILINE)
        assert len(parts) == 2, f"{page}: no table {head}"
        made[page] = table(head, rows).join(parts)
    return list(made.items())


def _with_kinds(schema: str) -> str:
    begin, _, rest = schema.partition('"items": {\n      "oneOf": [\n')
    _, _, end = rest.partition("\n      ]\n")
    kinds = ",\n".join(f"       {json.dumps(each.schema())}" for each in KINDS.values())
    return f'{begin}"items": {{\n      "oneOf": [\n{kinds}\n      ]\n{end}'


def _methods() -> list[list[str]]:
    rows = []
    for name, each in METHODS.items():
        default, finest = f"{each.default:.0e}", f"{each.finest:.0e}"
        if each.is_fixed_step:
            default = finest = "none"
        elif each.scipy:
            finest = "by the scene"
        order = each.orders or (str(each.order) if each.order else "adapted")
        rows.append([f"`{name}`", each.title, order, default, finest])
    return rows


def _kinds() -> list[list[str]]:
    rows = []
    for name, ready in KINDS.items():
        keys = [
            _joined(f"`{key}`", _words(each), each.remark, _default(ready, key))
            for key, each in ready.arguments.items()
        ]
        units = [_markdown(each.unit) for each in ready.arguments.values() if each.unit]
        rows.append([f"`{name}`", "; ".join(keys), "; ".join(units)])
    return rows


def _functions(declared: dict[str, Ready]) -> list[list[str]]:
    rows = []
    for ready in declared.values():
        parts = []
        for key, each in ready.arguments.items():
            remark = "" if each.is_of_body else each.remark
            text = _joined(
                each.symbol, _words(each), _markdown(each.unit), remark, _default(ready, key)
            )
            parts.append(f"`{key}`: {text}" if text else f"`{key}`")
        if ready.note:
            parts.append(ready.note)
        rows.append(
            [
                _call(ready),
                ready.formula or ready.about[0].lower() + ready.about[1:],
                "; ".join(parts),
            ]
        )
    return rows


def _conventions() -> list[list[str]]:
    law = 'components about the axes of the body; with `TorqueLaw(..., frame="space")` about the '
    alike = defaultdict(list)
    for ready in KINDS.values():
        alike[ready.convention].append(ready)
    alike.pop("", None)
    return [
        ["`TorqueLaw`, Python functions, expressions", f"{law}axes of space"],
        *([_names(some), convention] for convention, some in alike.items()),
    ]


def _names(some: list[Ready]) -> str:
    return _call(*some) if len(some) == 1 else ", ".join(f"`{x.function.__name__}`" for x in some)


def _call(ready: Ready) -> str:
    return f"`{ready.function.__name__}({', '.join(ready.arguments)})`"


def _joined(*parts: str) -> str:
    return ", ".join(filter(None, parts))


def _markdown(unit: str) -> str:
    return re.sub(r"\^\(([^)]*)\)", r"$^{\1}$", unit)


def _words(argument: Argument) -> str:
    """Return the form of an argument, unless it is clear: numbers, vectors, true or false."""
    if argument.frame == "space":
        return "a law about the axes of space"
    return "" if argument.form == VECTOR else _words_of(argument.form)


def _words_of(form: dict[str, Any]) -> str:
    if "enum" in form:
        *first, last = map(json.dumps, form["enum"])
        return f"{', '.join(first)} or {last}"
    if "anyOf" in form:
        return " or ".join(map(_words_of, form["anyOf"]))
    if "items" in form:
        items = _PLURAL[_name(form["items"])]
        if "maxItems" not in form:
            return f"a list of {items}"
        return f"{form['minItems']} to {form['maxItems']:,} {items}".replace(",", " ")
    return _WORDS.get(_name(form), "")


def _name(form: dict[str, Any]) -> str:
    return str(form.get("type", form.get("$ref", "").rpartition("/")[2]))


def _default(ready: Ready, key: str) -> str:
    if key not in ready.defaults:
        return ""
    value: Any = ready.defaults[key]
    if value is None or (isinstance(value, tuple) and not any(value)):
        value = 0
    return "by default " + re.sub(r"\.0\b", "", json.dumps(value))
