"""Docstrings of the public API are complete, by numpydoc's own validation."""

import inspect

import pytest
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate

import pyharness

# No section of related functions, of examples or of more text is required.
_NOT_REQUIRED = ("SA01", "EX01", "ES01", "SA04")


@pytest.mark.parametrize("name", pyharness.__all__)
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
    "name", [name for name in pyharness.__all__ if inspect.isclass(getattr(pyharness, name))]
)
def test_public_method_has_a_docstring(name: str) -> None:
    found = getattr(pyharness, name)
    fields = " ".join(part.name for part in get_doc_object(found)["Attributes"])
    without = [
        each
        for each, value in vars(found).items()
        if not each.startswith("_") and (inspect.isfunction(value) or isinstance(value, property))
        if not value.__doc__ and each not in fields.replace(",", " ").split()
    ]
    assert without == []
