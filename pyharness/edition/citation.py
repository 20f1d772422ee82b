"""The citation of edition and thesis, from `codemeta.json`."""

import json
from functools import cache
from typing import Any

from pyharness.history.identifiers import data_identifier, text_digest
from pyharness.model.errors import InputError
from pyharness.model.facts import facts, shipped

_NO_NUMBER = "The number of the report is unknown to us"
# The words of CITATION.cff that an editor replaces.
_PLACEHOLDERS = ("SURNAME", "GIVEN NAMES", "YYYY-MM-DD", "ADDRESS OF THE REPOSITORY", "DOI OF THE")
PUBLISH = (
    "These pages have no address of their own yet, so that a citation names the page in the "
    "edition. Whoever publishes them sets address in pyharness/data/edition.toml, fills in "
    "CITATION.cff, and builds them again."
)
"""The text for pages without an address."""

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


def address() -> str:
    """Return the address of the published pages, with a slash at its end; empty without one."""
    return str(facts("edition")["address"])


def check_publishable() -> None:
    """Raise InputError if the pages have an address and CITATION.cff has placeholders."""
    lines = shipped("CITATION.cff").read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, 1):
        found = [each for each in _PLACEHOLDERS if each in line]
        if address() and found:
            raise InputError(
                f"CITATION.cff:{number}: {found[0]} is a placeholder; fill it in, or delete the "
                f"line, before the pages are published at {address()}"
            )


def bibtex(place: str = "", path: str = "") -> str:
    """Return the BibTeX entries of the edition, or of a `place` at a `path` in it, and the thesis.

    Without an address of the pages, the path takes its place.
    """
    described = codemeta()
    version, thesis = described["version"], described["referencePublication"]
    year, _, month = thesis["datePublished"].partition("-")
    where = {"url" if address() else "howpublished": address() + path} if address() or path else {}
    edition = {
        "author": " and ".join(f"{{{each['name']}}}" for each in described["author"]),
        "title": f"{{{_title(place)}}}",
        "year": release_date()[:4],
        "version": version,
        **where,
        "note": f"Version {version}; text {text_digest()}; data {data_identifier()}",
    }
    printed = {
        "author": _authors(thesis),
        "title": f"{{{thesis['name']}}}",
        "institution": thesis["publisher"]["name"],
        "year": year,
        "month": str(int(month)),
        "note": f"{thesis['description']}. {_NO_NUMBER}",
    }
    entries = (("misc", f"pyharness-{version}", edition), ("techreport", "jacobs-1982", printed))
    return "\n".join(_entry(kind, key, fields) for kind, key, fields in entries)


def csl(place: str = "", path: str = "") -> list[dict[str, Any]]:
    """Return the records of `bibtex` in the Citation Style Language (CSL-JSON)."""
    described = codemeta()
    version, thesis = described["version"], described["referencePublication"]
    issued = [[int(part) for part in release_date().split("-")]]
    printed = [[int(part) for part in thesis["datePublished"].split("-")]]
    edition = {
        "id": f"pyharness-{version}",
        "type": "webpage",
        "title": _title(place),
        "author": [{"literal": each["name"]} for each in described["author"]],
        "issued": {"date-parts": issued},
        "version": version,
        **({"URL": address() + path} if address() else {"section": path} if path else {}),
        "note": f"text {text_digest()}; data {data_identifier()}",
    }
    names = [
        {"family": each["familyName"], "given": each["givenName"]} for each in thesis["author"]
    ]
    report = {
        "id": "jacobs-1982",
        "type": "report",
        "title": thesis["name"],
        "author": names,
        "publisher": thesis["publisher"]["name"],
        "issued": {"date-parts": printed},
        "note": f"{thesis['description']}. {_NO_NUMBER}",
    }
    return [edition, report]


def cite_data() -> dict[str, Any]:
    """Return what the script of the citations needs; it fills in the place and the path."""
    place = "@PLACE@", "@PATH@"
    return {
        "address": address(), "publish": PUBLISH, "digest": text_digest(),
        "bibtex": bibtex(*place), "csl": csl(*place),
    }  # fmt: skip


def _title(place: str) -> str:
    return f"{place}{', in ' if place else ''}{codemeta()['name']}"


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
