"""The page of a measurement: what made it and where, its tables, its notes."""

from collections.abc import Iterable, Sequence

from pyharness.model.report import Column, Line, Section, Table


def made_page(
    title: str,
    command: str,
    drift: str,
    versions: Sequence[tuple[str, str | None]],
    tables: Iterable[Section],
    notes: Iterable[str],
) -> list[Section]:
    """Return its sections; `drift` says what the numbers are worth, `title` has its marks."""
    return [
        [Line(title)],
        [Line(f"Made by `{command}`; run that again to have it for another machine.")],
        [Line(drift)],
        [Table((Column(""), Column("version")), versions)],
        *tables,
        [Line("#" + title.split()[0] + " Notes")],
        [Line(f"- {line}") for line in notes],
    ]
