"""Conversion of the project's Markdown to HTML.

Headings get anchors as on GitHub, formulas become MathML, and links between documents become links
between pages.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

from latex2mathml.converter import convert
from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup, escape
from mdit_py_plugins.dollarmath import dollarmath_plugin


class Part(NamedTuple):
    """Text under a heading, for the search."""

    anchor: str
    title: str
    text: str


class Document(NamedTuple):
    """A rendered document: title, HTML without title, and text by heading."""

    title: str
    html: Markup
    parts: list[Part]


def document(text: str, link: Callable[[str], str | None]) -> Document:
    """Return the rendered Markdown `text`, which begins with its title.

    `link` returns a target's address on the site, or None.
    """
    tokens = _parser().parse(text)
    for token in _walk(tokens):
        if token.type == "link_open":
            target = link(str(token.attrs["href"]))
            token.attrs = {} if target is None else {"href": target}
        elif token.type == "image":
            source = link(str(token.attrs["src"]))
            if source is None:
                raise ValueError(f"the site has no picture {token.attrs['src']!r}")
            token.attrs["src"], token.attrs["loading"] = source, "lazy"
    _anchor(tokens)
    title = tokens[1].content
    html = _parser().renderer.render(tokens[3:], _parser().options, {})
    html = html.replace("<th></th>", "<td></td>")
    return Document(_strip_markup(title), Markup(html), _split(tokens))


def inline(text: str) -> Markup:
    return Markup(_parser().renderInline(text))


def formula(tex: str, display: bool = False) -> Markup:
    return Markup(convert(tex, display="block" if display else "inline"))


@cache
def _parser() -> MarkdownIt:
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")

    def write(tex: str, options: dict[str, Any]) -> Markup:
        return formula(tex, options["display_mode"])

    parser.use(dollarmath_plugin, allow_digits=False, allow_space=False, renderer=write)
    renderer: Any = parser.renderer
    rules = renderer.rules
    # Elements wider than the page scroll separately, also by keyboard.
    opening = '<div class="wide" role="group" tabindex="0" aria-label="table"><table>\n'
    rules["table_open"] = lambda *_: opening
    rules["table_close"] = lambda *_: "</table></div>\n"
    rules["math_block"] = _block
    for kind in ("fence", "code_block"):
        rules[kind] = _code
    return parser


def _block(tokens: Sequence[Token], index: int, *_: Any) -> str:
    return f'<div class="formula">{formula(tokens[index].content.strip(), display=True)}</div>\n'


def _code(tokens: Sequence[Token], index: int, *_: Any) -> str:
    token = tokens[index]
    language = escape(token.info or "text")
    text = escape(token.content)
    return (
        f'<pre class="code language-{language}" role="group" tabindex="0" '
        f'aria-label="{language}"><code>{text}</code></pre>\n'
    )


def _walk(tokens: Sequence[Token]) -> Iterator[Token]:
    for token in tokens:
        yield token
        yield from _walk(token.children or [])


def _anchor(tokens: Sequence[Token]) -> None:
    seen: dict[str, int] = {}
    for opening, content in pairwise(tokens):
        if opening.type == "heading_open":
            name = slug(_strip_markup(content.content))
            count = seen[name] = seen.get(name, -1) + 1
            opening.attrs["id"] = name + (f"-{count}" if count else "")


def slug(title: str) -> str:
    """Return the anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def _strip_markup(text: str) -> str:
    return re.sub(r"[`*$\\]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text))


def _split(tokens: Sequence[Token]) -> list[Part]:
    found: list[tuple[str, str, list[str]]] = []
    for before, token in pairwise(tokens):
        if before.type == "heading_open":
            found.append((str(before.attrs["id"]), _strip_markup(token.content), []))
        elif token.type in ("inline", "fence"):
            found[-1][2].append(_strip_markup(token.content))
    return [Part(anchor, title, " ".join(text)) for anchor, title, text in found]
