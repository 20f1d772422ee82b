"""Docstrings of the public API are complete, by numpydoc's own validation."""

import inspect
from functools import partial
from typing import Any

import pytest
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate

import pyharness

# No section of related functions, of examples or of more text is required.
_NOT_REQUIRED = ("SA01", "EX01", "ES01", "SA04")


NAMES = [*pyharness.__all__, "Taylor"]


@pytest.mark.parametrize("name", NAMES)
def test_public_docstring_is_complete(name: str) -> None:
    errors = validate(f"pyharness.{name}")["errors"]
    found = [each for each in errors if each[0] not in _NOT_REQUIRED]
    sections = get_doc_object(getattr(pyharness, name))
    attributes = {part for each in sections["Attributes"] for part in each.name.split(", ")}
    if attributes and not sections["Parameters"]:
        # Users read the fields of a result and do not construct it.
        found = [each for each in found if each[0] != "PR01"]
        assert attributes >= set(getattr(getattr(pyharness, name), "__dataclass_fields__", ()))
    assert found == []


@pytest.mark.parametrize(
    "found",
    [pyharness.events, pyharness.torques]
    + [x for x in map(partial(getattr, pyharness), NAMES) if inspect.isclass(x)],
)
def test_public_method_has_a_docstring(found: Any) -> None:
    attributes = get_doc_object(found)["Attributes"] if inspect.isclass(found) else []
    fields = {each for part in attributes for each in part.name.split(", ")}
    without = [
        name
        for name, value in inspect.getmembers(
            found, lambda x: callable(x) or isinstance(x, property)
        )
        if not name.startswith("_") and name not in fields and not value.__doc__
    ]
    assert without == []
