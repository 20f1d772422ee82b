"""The pages of the web site: templates filled with data and reports.

Pages work from a server or a file, under any path and without JavaScript, and load nothing from
other sites.
"""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pyharness.edition import api, body, decks, documents, laboratory, ledger, parallel_decks, story
from pyharness.edition.bundle import bundle
from pyharness.edition.citation import (
    PUBLISH,
    address,
    bibtex,
    check_publishable,
    cite_data,
    linked_data,
)
from pyharness.edition.data_package import archive, data_package
from pyharness.edition.markdown import inline, slug
from pyharness.edition.report import MARK, listed
from pyharness.history.ablation import entries
from pyharness.history.claims.ledger import judgements, written
from pyharness.history.claims.stories import prose
from pyharness.history.figures import FigureFinding, findings
from pyharness.history.identifiers import DATA, data_identifier, text_digest
from pyharness.history.origins import disagreements
from pyharness.history.tei import tei_document
from pyharness.history.timeline import timeline
from pyharness.model.assumptions import ASSUMED
from pyharness.model.facts import facts, shipped
from pyharness.model.progress import Progress, no_progress
from pyharness.model.records import build_record
from pyharness.model.schema import SCHEMAS
from pyharness.thesis.cards import deck, parallels
from pyharness.views.render import json_text

# Paths of pages by section of the menu and title.
MENU = tomllib.loads(Path(__file__).with_name("menu.toml").read_text(encoding="utf-8"))


class Found(NamedTuple):
    """A place in a page that the search finds, of a `kind` such as ``claim``."""

    href: str
    title: str
    kind: str
    text: str


class Page(NamedTuple):
    """A page before rendering, with the places that the search finds."""

    path: str
    title: str
    template: str
    context: Mapping[str, Any] = {}
    found: Sequence[Found] = ()
    menu: str = ""  # path of the highlighted menu entry, by default the page's


def build_site(progress: Progress = no_progress, docs: Path | None = None) -> dict[str, bytes]:
    """Return the contents of all files of the site by path.

    The default of `docs` is as in `documents_folder`.
    """
    check_publishable()
    docs = docs or documents.documents_folder()
    progress(0, 5, "figures")
    drawn = {each.plan.stem: each for each in findings()}
    content = {f"figures/{name}": file for name, file in ledger.draw_figures(drawn).items()}
    places: list[Found] = []
    for page in _pages(drawn, docs, progress):
        content[page.path] = _rendered(page)
        places += page.found
        if page.path in ("index.html", "about.html"):
            places += _sections(page.path, content[page.path].decode())
    content |= _assets(places) | documents.files(docs) | documents.notebooks(docs)
    content["data.zip"] = archive(data_package(), "jacobs-1982-data")
    content[MARK] = json_text({"schema": SCHEMAS["edition"], **listed(content)}).encode()
    return content


def _pages(drawn: Mapping[str, FigureFinding], docs: Path, progress: Progress) -> Iterator[Page]:
    progress(1, 5, "claims")
    judged = judgements()
    context = {
        "counts": ledger.counts(judged), "counted": ledger.counted(judged),
        "account": ledger.account(), "story": story.context(),
        "work": facts("account")["work"], "mechanism": facts("account")["mechanism"],
        "timeline": timeline(),
    }  # fmt: skip
    step = facts("account")["mechanism"]["stopped"]["step"]
    title = f"The program that stopped at step {step}"
    yield Page("index.html", title, "index.html", context)
    cited = {
        "bibtex": bibtex(), "linked_data": linked_data(), "data_identifier": data_identifier(),
        "data_folder": DATA, "editors": facts("edition"),
    }  # fmt: skip
    yield Page("about.html", "About this edition", "about.html", {**context, **cited})
    progress(2, 5, "listing")
    yield from _listing()
    yield Page("laboratory.html", "Laboratory", "laboratory.html", laboratory.context())
    yield Page("body.html", "A body that tumbles", "body.html", body.context())
    told = ledger.thesis(judged)
    found: list[Found] = []
    for each in told:
        claimed = " ".join(judgement.claim["statement"] for judgement in each.judged)
        text = f"{each.sentence.text}: {each.sentence.why or claimed}"
        href = f"thesis.html#{each.anchor}"
        found.append(Found(href, each.sentence.where, "sentence", text))
    context = ledger.thesis_context(told)
    yield Page("thesis.html", "The thesis, executable", "thesis.html", context, found)
    found = [
        Found(f"figures.html#{stem}", f"{plan.title}, {plan.set}", "figure", plan.caption)
        for stem, plan in ((stem, each.plan) for stem, each in drawn.items())
    ]
    context = {"figures": ledger.printed_figures(drawn, told)}
    yield Page("figures.html", "Figures", "figures.html", context, found)
    found = []
    for claim in (judgement.claim for judgement in judged):
        text = f"{claim['quote']}: {claim['statement']}"
        found.append(Found(f"claims.html#{claim['id']}", claim["id"], "claim", text))
    context = ledger.claims_context(judged, told)
    yield Page("claims.html", "Claims", "claims.html", context, found)
    progress(3, 5, "apparatus")
    groups = ledger.apparatus()
    found = []
    for entry, _ in chain.from_iterable(groups.values()):
        text = ". ".join(entry[name] for name in ("summary", "evidence", "why") if name in entry)
        found.append(Found(f"apparatus.html#{entry['id']}", entry["id"], entry["kind"], text))
    context = {"groups": groups, "programs": decks.TITLES, "disagreements": disagreements()}
    yield Page("apparatus.html", "Apparatus", "apparatus.html", context, found)
    progress(4, 5, "documents")
    yield from _documents(docs)
    offered = api.entries()
    found = [Found(f"api.html#{each.name}", each.name, "API", each.summary) for each in offered]
    yield Page("api.html", "API", "api.html", {"entries": offered}, found)
    yield Page("search.html", "Search", "search.html")


def _listing() -> Iterator[Page]:
    counts = {}
    for program, title in decks.TITLES.items():
        pages = decks.sheets(program)
        views = [each for page in pages for each in page.cards]
        counts[program] = title, len(views), len(pages)
        path = f"listing/{program}.html"
        context = {
            "program": program, "programs": decks.TITLES, "sheets": pages, "cards": views,
            "kinds": decks.kinds_of(views), "notes": decks.notes(program), "deck": deck(program),
            "parallels": parallels, "entry_kinds": {x["id"]: x["kind"] for x in entries()},
        }  # fmt: skip
        found = []
        for each in views:
            text = "".join(run.text for run in each.card).strip()
            found.append(Found(f"{path}#{each.number}", f"{program} {each.number}", "card", text))
        yield Page(path, f"{title}: the program as printed", "deck.html", context, found)
    yield Page("listing/collation.html", "The three decks compared", "collation.html",
               {"programs": decks.TITLES, "operations": parallel_decks.operations(),
                "disagreements": disagreements(),
                "thesis_on": parallel_decks.thesis_on})  # fmt: skip
    context = {"decks": counts, "scan": facts("cards/scan")}
    yield Page("listing/index.html", "The three programs", "listing.html", context)


def _documents(docs: Path) -> Iterator[Page]:
    with_notebooks = documents.with_notebooks(docs)
    notebooks = {documents.page_of(f.relative_to(docs).as_posix()): f.stem for f in with_notebooks}
    listed_pages = {path for section in MENU.values() for path in section.values()}
    for path, each in documents.documents(docs):
        found = [
            Found(f"{path}#{part.anchor}", part.title, "document", part.text) for part in each.parts
        ]
        context = {"document": each, "notebook": notebooks.get(path)}
        yield Page(path, each.title, "document.html", context, found,
                   menu=path if path in listed_pages else "docs/index.html")  # fmt: skip


def _sections(path: str, html: str) -> Iterator[Found]:
    heads = r'<h[12](?: id="(?:h-)?([\w-]+)")?>(.*?)</h[12]>'
    _, *parts = re.split(heads, html.partition("</main>")[0])
    for anchor, title, text in zip(*(parts[n::3] for n in range(3)), strict=True):
        words = Markup(re.sub(r"<(svg|math)\b.*?</\1>", "", text, flags=re.DOTALL)).striptags()
        yield Found(f"{path}#{anchor or 'main'}", Markup(title).striptags(), "page", words)


def _rendered(page: Page) -> bytes:
    here = page.menu or page.path
    section = next(name for name, of in MENU.items() if here in of.values())
    # Relative links, so that the site works under any path.
    root = "../" * page.path.count("/")
    html = _templates().get_template(page.template).render(
        {"page": page, "root": root, "menu": MENU, "here": here, "section": section,
         "build": build_record(), "digest": text_digest(), "edition": facts("account")["edition"],
         "address": address(), "publish": PUBLISH,
         **page.context}
    )  # fmt: skip
    return html.encode()


def _assets(places: Sequence[Found]) -> dict[str, bytes]:
    web = shipped("web")
    folders = [web / "vendor" / package["name"] for package in vendor()]
    files = [file for each in folders for file in sorted(each.iterdir())]
    files = [file for file in files if file.suffix in (".js", ".css")]
    content = {f"assets/{file.name}": file.read_bytes() for file in files}
    content |= {f"assets/{x.name}-LICENSE.txt": (x / "LICENSE").read_bytes() for x in folders}
    for file in sorted((web / "site").iterdir()):
        content[f"assets/{file.name}"] = file.read_bytes()
    scripts = {"story": story.data(), "laboratory": laboratory.data(), "about": None}
    for name, data in (scripts | {"cite": cite_data(), "body": body.data()}).items():
        content[f"assets/{name}.js"] = bundle(web / name / f"{name}.js").encode()
        if data is not None:
            content[f"assets/{name}-data.js"] = script(f"{name}Data", data)
    content |= {f"figures/{name}": file for name, file in body.files().items()}
    content["assets/search-data.js"] = script("searchData", [each._asdict() for each in places])
    content["listing/edition.xml"] = tei_document()
    return content


def script(name: str, value: Any) -> bytes:
    """Return JavaScript that sets `name` to `value`; pages opened from files cannot load JSON."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"))
    return f"window.{name}={text};\n".encode()


def vendor() -> list[dict[str, Any]]:
    text = (shipped("web") / "vendor" / "vendor.toml").read_text(encoding="utf-8")
    return list(tomllib.loads(text)["package"])


@cache
def _templates() -> Environment:
    loader = FileSystemLoader(Path(__file__).parent / "templates")
    blocks: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True}
    templates = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, **blocks)
    templates.filters |= {"number": written, "prose": prose, "slug": slug}
    templates.globals |= {
        "inline": inline, "verdicts": ledger.verdicts, "assumption": ledger.assumption,
        "ASSUMED": ASSUMED, "supplied": ledger.account()["supplied"],
    }  # fmt: skip
    return templates
