"""Reports as HTML fragments for web pages."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import groupby
from typing import Any

from pyharness.model.report import Field, Line, Section, Table


def sections(text: Sequence[Section]) -> str:
    """Return sections of a report as HTML, with numbers rounded as in text."""
    return "\n".join(part for section in text if section for part in _write_section(section))


def table(given: Table, label: str = "table", links: Mapping[str, str] | None = None) -> str:
    """Return a table as HTML, scrollable if wide.

    `label` is for screen readers; `links` maps cells' texts to addresses.
    """
    (head, *rows), columns = given.written(), given.columns
    lines = [f'<div class="wide" role="group" tabindex="0" aria-label="{escape(label)}">']
    lines += ['<table class="numbers">', "<thead><tr>"]
    lines += [_cell("th", text, each.left) for text, each in zip(head, columns, strict=True)]
    lines += ["</tr></thead>", "<tbody>"]
    for row in rows:
        cells = zip(row, columns, strict=True)
        shown = (_cell("td", text, each.left, (links or {}).get(text)) for text, each in cells)
        lines.append(f"<tr>{''.join(shown)}</tr>")
    return "\n".join([*lines, "</tbody></table></div>"])


def _cell(tag: str, text: str, left: bool, link: str | None = None) -> str:
    scope = ' scope="col"' if tag == "th" else ""
    shown = escape(text) if link is None else f'<a href="{escape(link)}">{escape(text)}</a>'
    return f"<{tag}{scope}{' class=left' if left else ''}>{shown}</{tag}>"


def _write_section(section: Section) -> Iterator[str]:
    grouped: Any = groupby(section, type)
    for kind, parts in grouped:
        if kind is Line:
            yield "<pre>" + "\n".join(map(escape, parts)) + "</pre>"
        elif kind is Field:
            pairs = ((escape(each.label.strip()), escape(each.text)) for each in parts)
            yield f"<dl>{''.join(f'<dt>{label}</dt><dd>{text}</dd>' for label, text in pairs)}</dl>"
        else:
            yield from (
                table(each) if kind is Table else f"<p>{escape(each)}</p>" for each in parts if each
            )
