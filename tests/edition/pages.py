"""The pages of a site as a reader of HTML sees them: names, links, what they load."""

import posixpath
from collections.abc import Iterator
from html.parser import HTMLParser
from typing import NamedTuple
from urllib.parse import unquote

# By element, what names another file.
_TARGETS = {"a": "href", "link": "href", "script": "src", "img": "src"}


class Target(NamedTuple):
    """What an element names: a path from the page's folder, and an anchor."""

    element: str
    path: str
    anchor: str


class Read(HTMLParser):
    """What a page has: its anchors, its targets, its headings, its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: list[str] = []
        self.targets: list[Target] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep an element."""
        found = dict(attrs)
        self.elements.append((tag, found))
        if found.get("id") is not None:
            self.anchors.append(str(found["id"]))
        if tag in _TARGETS and found.get(_TARGETS[tag]) is not None:
            path, _, anchor = str(found[_TARGETS[tag]]).partition("#")
            self.targets.append(Target(tag, unquote(path), unquote(anchor)))

    def handle_data(self, data: str) -> None:
        """Keep a text."""
        self.text.append(data)


def pages(site: dict[str, bytes]) -> dict[str, Read]:
    """Read every page of a site."""
    return {name: Read(each.decode()) for name, each in site.items() if name.endswith(".html")}


def dead(site: dict[str, bytes]) -> Iterator[str]:
    """Give every link and every source that leads nowhere."""
    read = pages(site)
    for name, page in read.items():
        for element, path, anchor in page.targets:
            if "://" in path:
                continue
            target = posixpath.normpath(posixpath.join(posixpath.dirname(name), path))
            target = target if path else name
            if target not in site:
                yield f"{name}: {element} {path}"
            # The laboratory's anchor is a state.
            elif (
                anchor
                and target in read
                and target != "laboratory.html"
                and anchor not in read[target].anchors
            ):
                yield f"{name}: {element} {path}#{anchor}"
