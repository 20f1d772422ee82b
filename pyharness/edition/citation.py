"""The citation of edition and thesis, from `codemeta.json`."""

import json
from functools import cache
from typing import Any

from pyharness.history.identifiers import data_identifier, text_digest
from pyharness.model.facts import facts, shipped

# The properties of `codemeta.json` that schema.org defines for source code.
_OF_SOURCE_CODE = (
    "name", "description", "version", "license", "author", "copyrightHolder", "copyrightYear",
    "keywords", "programmingLanguage", "runtimePlatform", "codeRepository", "datePublished",
)  # fmt: skip


@cache
def codemeta() -> dict[str, Any]:
    """Return the content of `codemeta.json`; cached, so callers must not change it."""
    described: dict[str, Any] = json.loads(shipped("codemeta.json").read_text(encoding="utf-8"))
    return described


def release_date() -> str:
    """Return the date of publication or, before publication, the year of the copyright."""
    described = codemeta()
    return str(described.get("datePublished", described["copyrightYear"]))


def bibtex() -> str:
    """Return the BibTeX entries of the edition and of the thesis."""
    described = codemeta()
    version, thesis = described["version"], described["referencePublication"]
    year, _, month = thesis["datePublished"].partition("-")
    edition = {
        "author": " and ".join(f"{{{each['name']}}}" for each in described["author"]),
        "title": f"{{{described['name']}}}",
        "year": release_date()[:4],
        "version": version,
        "note": f"Version {version}; text {text_digest()}; data {data_identifier()}",
    }
    printed = {
        "author": _authors(thesis),
        "title": f"{{{thesis['name']}}}",
        "institution": thesis["publisher"]["name"],
        "year": year,
        "month": str(int(month)),
        "note": thesis["description"],
    }
    entries = (("misc", f"pyharness-{version}", edition), ("techreport", "jacobs-1982", printed))
    return "\n".join(_entry(kind, key, fields) for kind, key, fields in entries)


def thesis_record() -> dict[str, Any]:
    """Return the thesis's record in the terms of schema.org."""
    return {**codemeta()["referencePublication"], "@type": "Report"}


def linked_data() -> dict[str, Any]:
    """Return the software and data records as JSON-LD (schema.org), for search engines."""
    described = codemeta()
    software = {name: described[name] for name in _OF_SOURCE_CODE if name in described}
    names = {name: described[name] for name in ("version", "license", "copyrightYear")}
    return {
        "@context": "https://schema.org",
        "@graph": [
            {
                "@type": "SoftwareSourceCode", "@id": "#software", **software,
                "citation": thesis_record(),
            },
            {
                "@type": "Dataset",
                "@id": "#data",
                "name": data_name(),
                "description": data_description(),
                "creator": described["author"],
                **names,
                "identifier": [data_identifier(), f"text {text_digest()}"],
                "isBasedOn": thesis_record(),
                "isPartOf": {"@id": "#software"},
            },
        ],
    }  # fmt: skip


def data_name() -> str:
    """Return the name of the data, for catalogues."""
    return f"{facts('account')['edition']['name']}: data"


def data_description() -> str:
    """Return the description of the data, for catalogues."""
    thesis = codemeta()["referencePublication"]
    return (
        f"The cards of the three FORTRAN programs in the thesis {thesis['name']} "
        f"({_authors(thesis)}, {thesis['datePublished'][:4]}), the critical apparatus of their "
        "text, and our verdicts on the statements of the thesis."
    )


def _authors(thesis: dict[str, Any]) -> str:
    return " and ".join(f"{each['familyName']}, {each['givenName']}" for each in thesis["author"])


def _entry(kind: str, key: str, fields: dict[str, str]) -> str:
    lines = [f"  {name} = {{{value}}},\n" for name, value in fields.items()]
    return f"@{kind}{{{key},\n{''.join(lines)}}}\n"
