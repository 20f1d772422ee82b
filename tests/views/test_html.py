"""Reports as HTML: no text is read as markup, and lines stay together."""

from pyharness.model.report import Column, Field, Line, Report, Section, Table, words
from pyharness.views import html
from pyharness.views.render import render

TABLE = Table([*words("name"), Column("a < b")], [["x & y", 3], ["z", None]])


def test_a_table_has_heads_and_cells_as_people_read_them() -> None:
    found = html.table(TABLE, "all of them", {"z": "#z"})
    assert 'tabindex="0" aria-label="all of them"' in found
    assert '<th scope="col" class=left>name</th>' in found
    assert '<th scope="col">a &lt; b</th>' in found
    assert "<tr><td class=left>x &amp; y</td><td>3</td></tr>" in found
    assert '<tr><td class=left><a href="#z">z</a></td><td>-</td></tr>' in found


def test_sections_keep_lines_and_fields_together() -> None:
    text: list[Section] = [
        ["one <i>", Line("  a  b"), Line("c"), "two"], [],
        [Field("says  ", "x > y"), Field("rule  ", "z"), TABLE], [Line("last")],
    ]  # fmt: skip
    report = Report("t", text, record=dict)
    assert render(report, "html").split("\n<div")[0] == (
        "<p>one &lt;i&gt;</p>\n<pre>  a  b\nc</pre>\n<p>two</p>\n"
        "<dl><dt>says</dt><dd>x &gt; y</dd><dt>rule</dt><dd>z</dd></dl>"
    )
    assert render(report, "html").endswith("</div>\n<pre>last</pre>")
