"""The API page's data: public names and their docstrings."""

import inspect
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from docstring_parser import DocstringStyle, parse
from markupsafe import Markup

import pyharness
from pyharness.edition.markdown import inline


class Item(NamedTuple):
    """A parameter, attribute, result or exception that a docstring describes."""

    name: str
    type: str
    text: Markup


class Entry(NamedTuple):
    """A public name on the API page."""

    name: str
    anchor: str
    kind: str  # "function", "class" or "property"
    signature: str
    summary: Markup  # first line of the docstring
    text: list[Markup]  # other paragraphs of the docstring
    groups: list[tuple[str, list[Item]]]  # sections of the docstring, by title
    methods: "list[Entry]"


def entries() -> list[Entry]:
    return [
        _entry(name, getattr(pyharness, name)) for name in sorted([*pyharness.__all__, "Taylor"])
    ]


def _entry(name: str, of: Any, of_class: str = "") -> Entry:
    told = parse(inspect.getdoc(of) or "", DocstringStyle.NUMPYDOC)
    groups: dict[str, list[Item]] = {}

    def add(title: str, name: str | None, type: str | None, text: str | None) -> None:
        groups.setdefault(title, []).append(Item(name or "", type or "", _line(text)))

    for param in told.params:
        title = "Attributes" if param.args[0] == "attribute" else "Parameters"
        add(title, param.arg_name, param.type_name, param.description)
    for result in told.many_returns:
        add("Returns", result.return_name, result.type_name, result.description)
    for error in told.raises:
        add("Raises", None, error.type_name, error.description)
    anchor = f"{of_class}.{name}" if of_class else name
    summary, is_class = _line(told.short_description), inspect.isclass(of)
    text = [_line(part) for part in (told.long_description or "").split("\n\n") if part]
    kind, methods = ("class", list(_methods(name, of))) if is_class else ("function", [])
    return Entry(name, anchor, kind, _signature(of), summary, text, [*groups.items()], methods)


def _methods(owner: str, of: type) -> Iterator[Entry]:
    # Include methods inherited from base classes of this package.
    named: dict[str, Any] = {}
    for base in of.__mro__:
        if base.__module__.startswith(pyharness.__name__):
            named |= {name: value for name, value in vars(base).items() if name not in named}
    for name, value in named.items():
        told = value.fget if isinstance(value, property) else value
        if not name.startswith("_") and inspect.isfunction(told) and inspect.getdoc(told):
            entry = _entry(name, told, owner)
            yield entry._replace(kind="property", signature="") if told is not value else entry


def _signature(of: Any) -> str:
    try:
        told = str(inspect.signature(of))
        if inspect.isclass(of):
            told = re.sub(r" -> \w+$", "", told)
    except (TypeError, ValueError):
        return ""
    # Write types without their modules, and array types as in the source files.
    told = re.sub(r"<class '(.*?)'>", r"\1", told).replace("NoneType", "None")
    told = re.sub(r"numpy\.ndarray\[tuple\[.*?\], numpy\.dtype\[(.*?)\]\]", _array, told)
    return re.sub(r"\b(?:[a-z_]+\.)+(?=[A-Za-z])", "", told)


def _array(found: re.Match[str]) -> str:
    kind = found[1].rpartition(".")[2]
    return "Array" if kind == "float64" else f"Array[{kind}]"


def _line(text: str | None) -> Markup:
    return inline(" ".join((text or "").split()))
