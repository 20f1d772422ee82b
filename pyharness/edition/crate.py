"""The RO-Crate 1.1 description of the data package."""

import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from pyharness.edition.citation import (
    codemeta,
    data_description,
    data_name,
    release_date,
    thesis_record,
)
from pyharness.history.identifiers import content_identifier, data_identifier, text_digest


class Part(NamedTuple):
    """A file of the data package.

    `path` is relative to the package, `media_type` is as in ``text/csv``. `content` is empty for
    files that describe the others.
    """

    path: str
    title: str
    description: str
    media_type: str
    content: bytes = b""


def described(name: str, content: bytes = b"", /, **values: Any) -> Part:
    """Return the file that the table `name` of `package.toml` describes, with `values` in it."""
    texts = (text.format(**values) for text in _descriptions()[name].values())
    path, title, description, media_type = texts
    return Part(path, title, description, media_type, content)


@cache
def _descriptions() -> dict[str, dict[str, str]]:
    return tomllib.loads(Path(__file__).with_name("package.toml").read_text(encoding="utf-8"))


KEPT = tuple(map(described, ("crate", "mark", "manifest")))
"""The files of the package that describe its other files."""
CRATE, PACKAGE_MARK, MANIFEST = (each.path for each in KEPT)
"""Their paths. `PACKAGE_MARK` marks a folder as a data package, and lists its files."""


def crate_record(parts: Sequence[Part]) -> dict[str, Any]:
    """Return the RO-Crate record of files other than `KEPT`.

    Entities are items of one list, and refer to each other by identifier.
    """
    software, thesis = codemeta(), thesis_record()
    files = [_file(each) for each in (*parts, *KEPT) if each.path != CRATE]
    people = [
        *({"@id": f"#author-{number}", **each}
          for number, each in enumerate(software["author"], 1)),
        *({"@id": f"#thesis-author-{number}", **each, "name": f"{each['givenName']} "
           f"{each['familyName']}"}
          for number, each in enumerate(thesis["author"], 1)),
    ]  # fmt: skip
    licence = software["license"]
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": data_name(),
        "description": data_description(),
        "version": software["version"],
        "datePublished": release_date(),
        "license": {"@id": licence},
        "author": _references(people, "#author-"),
        "publisher": _references(people, "#author-"),
        "keywords": software["keywords"],
        "citation": {"@id": "#thesis"},
        "isBasedOn": {"@id": "#thesis"},
        "identifier": [{"@id": "#text"}, {"@id": "#data"}],
        "hasPart": [{"@id": each["@id"]} for each in files],
    }
    graph: list[dict[str, Any]] = [
        {
            "@id": CRATE,
            "@type": "CreativeWork",
            "about": {"@id": "./"},
            "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        },
        root,
        *files,
        *people,
        {"@id": "#thesis-publisher", **thesis["publisher"]},
        {
            "@id": "#thesis",
            **thesis,
            "author": _references(people, "#thesis-author-"),
            "publisher": {"@id": "#thesis-publisher"},
        },
        {
            "@id": licence,
            "@type": "CreativeWork",
            "name": "MIT License",
            "description": "The licence of the edition; the file LICENSE has its text.",
        },
        _value("#text", "digest of the text", text_digest()),
        _value("#data", "Software Heritage identifier of the edition's data", data_identifier()),
    ]
    return {"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph}


def _file(part: Part) -> dict[str, str]:
    record = {"@id": part.path, "@type": "File", "name": part.title}
    if part in KEPT:
        return {**record, "encodingFormat": part.media_type}
    return {
        **record,
        "description": part.description,
        "encodingFormat": part.media_type,
        "contentSize": str(len(part.content)),
        "identifier": content_identifier(part.content),
    }


def _references(entities: Sequence[dict[str, Any]], prefix: str) -> Any:
    found = [{"@id": each["@id"]} for each in entities if each["@id"].startswith(prefix)]
    return found[0] if len(found) == 1 else found


def _value(identifier: str, name: str, value: str) -> dict[str, str]:
    return {"@id": identifier, "@type": "PropertyValue", "name": name, "value": value}
