"""Reports as HTML fragments, for insertion into web pages."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape

from pyharness.model.report import Field, Line, Section, Table


def sections(text: Sequence[Section]) -> str:
    """Return sections as HTML, with numbers as for a terminal."""
    return "\n".join(part for section in text if section for part in _write_section(section))


def table(given: Table, label: str = "table", links: Mapping[str, str] | None = None) -> str:
    """Return a table as HTML, which scrolls if it is wider than the page.

    `label` is for screen readers; `links` maps the text of a cell to an address.
    """
    (head, *rows), columns = given.written(), given.columns
    lines = [
        f'<div class="wide" role="group" tabindex="0" aria-label="{escape(label)}">',
        '<table class="numbers">',
        "<thead><tr>",
        *(_cell("th", text, each.left) for text, each in zip(head, columns, strict=True)),
        "</tr></thead>",
        "<tbody>",
    ]
    for row in rows:
        cells = (
            _cell("td", text, each.left, (links or {}).get(text))
            for text, each in zip(row, columns, strict=True)
        )
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return "\n".join([*lines, "</tbody></table></div>"])


def _cell(tag: str, text: str, left: bool, link: str | None = None) -> str:
    scope = ' scope="col"' if tag == "th" else ""
    shown = escape(text) if link is None else f'<a href="{escape(link)}">{escape(text)}</a>'
    return f"<{tag}{scope}{' class=left' if left else ''}>{shown}</{tag}>"


def _write_section(section: Section) -> Iterator[str]:
    """Yield the HTML elements of a section.

    Successive lines form one `pre`, successive labelled paragraphs (Field) one `dl`.
    """
    lines: list[str] = []
    fields: list[str] = []
    for each in [*section, ""]:
        if lines and not isinstance(each, Line):
            yield "<pre>" + "\n".join(map(escape, lines)) + "</pre>"
            lines = []
        if fields and not isinstance(each, Field):
            yield f"<dl>{''.join(fields)}</dl>"
            fields = []
        if isinstance(each, Line):
            lines.append(each)
        elif isinstance(each, Field):
            fields.append(f"<dt>{escape(each.label.strip())}</dt><dd>{escape(each.text)}</dd>")
        elif isinstance(each, Table):
            yield table(each)
        elif each:
            yield f"<p>{escape(each)}</p>"
