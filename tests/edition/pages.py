"""Pages of a site, parsed as HTML: their names, links, and the files that they load."""

import posixpath
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from typing import NamedTuple
from urllib.parse import unquote

# For each element, the attribute that names another file.
_TARGETS = {"a": "href", "link": "href", "script": "src", "img": "src"}


class Target(NamedTuple):
    """The target of an element: a path from the page's folder, and an anchor."""

    element: str
    path: str
    anchor: str


class Read(HTMLParser):
    """The content of a page: its anchors, targets, elements and text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: list[str] = []
        self.targets: list[Target] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record an element."""
        found = dict(attrs)
        self.elements.append((tag, found))
        if found.get("id") is not None:
            self.anchors.append(str(found["id"]))
        if tag in _TARGETS and found.get(_TARGETS[tag]) is not None:
            path, _, anchor = str(found[_TARGETS[tag]]).partition("#")
            self.targets.append(Target(tag, unquote(path), unquote(anchor)))

    def handle_data(self, data: str) -> None:
        """Record a text."""
        self.text.append(data)


def pages(site: dict[str, bytes]) -> dict[str, Read]:
    return {name: _parsed(each) for name, each in site.items() if name.endswith(".html")}


@cache
def _parsed(page: bytes) -> Read:
    """Parse a page once, because many tests read the same large pages."""
    return Read(page.decode())


def dead(site: dict[str, bytes]) -> Iterator[str]:
    """Yield every link and every source that leads nowhere."""
    read = pages(site)
    anchors = {name: set(page.anchors) for name, page in read.items()}
    for name, page in read.items():
        for element, path, anchor in page.targets:
            if "://" in path:
                continue
            target = posixpath.normpath(posixpath.join(posixpath.dirname(name), path))
            target = target if path else name
            if target not in site:
                yield f"{name}: {element} {path}"
            # The anchor of these pages is a state, not an element.
            elif (
                anchor
                and target in anchors
                and target not in ("laboratory.html", "body.html")
                and anchor not in anchors[target]
            ):
                yield f"{name}: {element} {path}#{anchor}"
