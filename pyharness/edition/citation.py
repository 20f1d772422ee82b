"""Citations of the edition and the thesis, and the RO-Crate 1.1 of the data."""

import json
import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from pyharness.history.identifiers import content_identifier, data_identifier, text_digest
from pyharness.model.errors import InputError
from pyharness.model.facts import facts, shipped

_NO_NUMBER = "The number of the report is unknown to us"
# Words in CITATION.cff that an editor must replace.
_PLACEHOLDERS = ("SURNAME", "GIVEN NAMES", "YYYY-MM-DD", "ADDRESS OF THE REPOSITORY", "DOI OF THE")
PUBLISH = (
    "These pages have no address of their own yet, so that a citation names the page in the "
    "edition. Whoever publishes them sets address in pyharness/data/edition.toml, fills in "
    "CITATION.cff, and builds them again."
)
"""Text for pages without an address."""

# Properties that schema.org defines for source code.
_OF_SOURCE_CODE = (
    "name", "description", "version", "license", "author", "copyrightHolder", "copyrightYear",
    "keywords", "programmingLanguage", "runtimePlatform", "codeRepository", "datePublished",
)  # fmt: skip


@cache
def codemeta() -> dict[str, Any]:
    """Return the content of `codemeta.json`; callers must not change it."""
    described: dict[str, Any] = json.loads(shipped("codemeta.json").read_text(encoding="utf-8"))
    return described


def release_date() -> str:
    described = codemeta()
    return str(described.get("datePublished", described["copyrightYear"]))


def address() -> str:
    """Return the published pages' address, which ends with a slash, or "" before publication."""
    return str(facts("edition")["address"])


def check_publishable() -> None:
    """Raise InputError if the pages have an address but CITATION.cff has placeholders."""
    lines = shipped("CITATION.cff").read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, 1):
        found = [each for each in _PLACEHOLDERS if each in line]
        if address() and found:
            raise InputError(
                f"CITATION.cff:{number}: {found[0]} is a placeholder; fill it in, or delete the "
                f"line, before the pages are published at {address()}"
            )


def bibtex(place: str = "", path: str = "") -> str:
    """Return BibTeX entries of the thesis and of the edition, or a `place` in the edition.

    `path` is appended to the pages' address.
    """
    described = codemeta()
    version, thesis = described["version"], described["referencePublication"]
    year, _, month = thesis["datePublished"].partition("-")
    where = {"url" if address() else "howpublished": address() + path} if address() or path else {}
    authors = " and ".join(f"{{{each['name']}}}" for each in described["author"])
    about = {"title": f"{{{_title(place)}}}", "year": release_date()[:4], "version": version}
    note = f"Version {version}; text {text_digest()}; data {data_identifier()}"
    edition = {"author": authors, **about, **where, "note": note}
    printed = {"author": _authors(thesis), "title": f"{{{thesis['name']}}}"}
    printed |= {"institution": thesis["publisher"]["name"], "year": year, "month": str(int(month))}
    printed["note"] = f"{thesis['description']}. {_NO_NUMBER}"
    entries = (("misc", f"pyharness-{version}", edition), ("techreport", "jacobs-1982", printed))
    return "\n".join(_entry(kind, key, fields) for kind, key, fields in entries)


def csl(place: str = "", path: str = "") -> list[dict[str, Any]]:
    """Return the records of `bibtex` in the Citation Style Language."""
    described = codemeta()
    version, thesis = described["version"], described["referencePublication"]
    dates = (release_date(), thesis["datePublished"])
    issued, printed = ({"date-parts": [[int(part) for part in x.split("-")]]} for x in dates)
    authors = [{"literal": each["name"]} for each in described["author"]]
    where = {"URL": address() + path} if address() else {"section": path} if path else {}
    edition: dict[str, Any] = {"id": f"pyharness-{version}", "type": "webpage"}
    edition |= {"title": _title(place), "author": authors, "issued": issued, "version": version}
    edition |= {**where, "note": f"text {text_digest()}; data {data_identifier()}"}
    names = [{"family": x["familyName"], "given": x["givenName"]} for x in thesis["author"]]
    report: dict[str, Any] = {"id": "jacobs-1982", "type": "report", "title": thesis["name"]}
    report |= {"author": names, "publisher": thesis["publisher"]["name"], "issued": printed}
    report["note"] = f"{thesis['description']}. {_NO_NUMBER}"
    return [edition, report]


def cite_data() -> dict[str, Any]:
    """Return the data from which the pages' script cites a part of the edition."""
    # Placeholders that the script replaces by the part's name and path.
    place = "@PLACE@", "@PATH@"
    return {
        "address": address(), "publish": PUBLISH, "digest": text_digest(),
        "bibtex": bibtex(*place), "csl": csl(*place),
    }  # fmt: skip


def _title(place: str) -> str:
    return f"{place}{', in ' if place else ''}{codemeta()['name']}"


def thesis_record() -> dict[str, Any]:
    return {**codemeta()["referencePublication"], "@type": "Report"}


def linked_data() -> dict[str, Any]:
    """Return records of software and data as JSON-LD."""
    described = codemeta()
    software = {name: described[name] for name in _OF_SOURCE_CODE if name in described}
    names = {name: described[name] for name in ("version", "license", "copyrightYear")}
    code = {"@type": "SoftwareSourceCode", "@id": "#software", **software}
    data: dict[str, Any] = {"@type": "Dataset", "@id": "#data", "name": data_name()}
    data |= {"description": data_description(), "creator": described["author"], **names}
    data |= {"identifier": [data_identifier(), f"text {text_digest()}"]}
    data |= {"isBasedOn": thesis_record(), "isPartOf": {"@id": "#software"}}
    graph = [{**code, "citation": thesis_record()}, data]
    return {"@context": "https://schema.org", "@graph": graph}


def data_name() -> str:
    return f"{facts('account')['edition']['name']}: data"


def data_description() -> str:
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


class Part(NamedTuple):
    """A file of the data package; `path` is relative to the package.

    `content` is empty for files that describe other files.
    """

    path: str
    title: str
    description: str
    media_type: str
    content: bytes = b""


def described(name: str, content: bytes = b"", /, **values: Any) -> Part:
    """Return the file that table `name` of `package.toml` describes, with `values` filled in."""
    texts = (text.format(**values) for text in _descriptions()[name].values())
    path, title, description, media_type = texts
    return Part(path, title, description, media_type, content)


@cache
def _descriptions() -> dict[str, dict[str, str]]:
    return tomllib.loads(Path(__file__).with_name("package.toml").read_text(encoding="utf-8"))


KEPT = tuple(map(described, ("crate", "mark", "manifest")))
"""Files of the package that describe its other files."""
CRATE, PACKAGE_MARK, MANIFEST = (each.path for each in KEPT)
"""Paths of `KEPT`. `PACKAGE_MARK` marks a folder as a data package, and lists its files."""
_VERSION = "https://w3id.org/ro/crate/1.1"
_LICENCE = "The licence of the edition; the file LICENSE has its text."
_DATA = "Software Heritage identifier of the edition's data"


def crate_record(parts: Sequence[Part]) -> dict[str, Any]:
    software, thesis = codemeta(), thesis_record()
    files = [_file(each) for each in (*parts, *KEPT) if each.path != CRATE]
    people = [{"@id": f"#author-{n}", **each} for n, each in enumerate(software["author"], 1)]
    for n, each in enumerate(thesis["author"], 1):
        name = f"{each['givenName']} {each['familyName']}"
        people.append({"@id": f"#thesis-author-{n}", **each, "name": name})
    licence, authors = software["license"], _references(people, "#thesis-author-")
    ours, source = _references(people, "#author-"), {"@id": "#thesis"}
    root = _entity("./", "Dataset", name=data_name(), description=data_description())
    root |= {"version": software["version"], "datePublished": release_date()}
    root |= {"license": {"@id": licence}, "author": ours, "publisher": ours}
    root |= {"keywords": software["keywords"], "citation": source, "isBasedOn": source}
    root["identifier"] = [{"@id": "#text"}, {"@id": "#data"}]
    root["hasPart"] = [{"@id": each["@id"]} for each in files]
    graph: list[dict[str, Any]] = [
        _entity(CRATE, "CreativeWork", about={"@id": "./"}, conformsTo={"@id": _VERSION}),
        root,
        *files,
        *people,
        {"@id": "#thesis-publisher", **thesis["publisher"]},
        {"@id": "#thesis", **thesis, "author": authors, "publisher": {"@id": "#thesis-publisher"}},
        _entity(licence, "CreativeWork", name="MIT License", description=_LICENCE),
        _entity("#text", "PropertyValue", name="digest of the text", value=text_digest()),
        _entity("#data", "PropertyValue", name=_DATA, value=data_identifier()),
    ]
    return {"@context": f"{_VERSION}/context", "@graph": graph}


def _file(part: Part) -> dict[str, Any]:
    form = {"encodingFormat": part.media_type}
    if part not in KEPT:
        size, identifier = str(len(part.content)), content_identifier(part.content)
        form = {"description": part.description, **form, "contentSize": size}
        form["identifier"] = identifier
    return _entity(part.path, "File", name=part.title, **form)


def _references(entities: Sequence[dict[str, Any]], prefix: str) -> Any:
    found = [{"@id": each["@id"]} for each in entities if each["@id"].startswith(prefix)]
    return found[0] if len(found) == 1 else found


def _entity(identifier: str, kind: str, /, **fields: Any) -> dict[str, Any]:
    return {"@id": identifier, "@type": kind, **fields}
