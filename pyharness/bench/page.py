"""The report of a benchmark: its tables and notes, the command that made it, and the machine."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pyharness.model.build import build, machine
from pyharness.model.report import Column, Line, Picture, Report, Section, Table


def measured_report(
    title: str,
    worth: str,
    parts: Sequence[tuple[str, Table]],
    notes: Sequence[str],
    record: Callable[[], dict[str, Any]],
    data: Table,
    pictures: Mapping[str, Callable[[], Picture]],
    packages: Iterable[str],
    command: str,
) -> Report:
    """Return the report of a benchmark, made of titled tables and notes.

    `title` is the heading of the page, with its Markdown marks. `worth` is a text on how far the
    numbers can be compared. `parts` are the tables, each with its title, and `notes` are lines of
    text below them. `record` is a function that returns the JSON record, `data` the table with full
    precision, and `pictures` has functions that draw the pictures, by name. `packages` are the
    packages whose versions are listed. `command` is the command that produces the page again.
    """
    here, built = machine(packages), build()
    versions = [
        *here.items(),
        ("pyharness", built.version),
        ("Fortran compiler", f"{built.compiler}, {built.flags}"),
        ("Python", built.python),
        ("NumPy", built.numpy),
        ("SciPy", built.scipy),
        ("platform", built.platform),
    ]
    mark = "#" + title.split()[0]
    tables: list[Section] = [[Line(f"{mark} {head}"), table] for head, table in parts]
    page: list[Section] = [
        [Line(title)],
        [Line(f"Made by `{command}`; run that again to have it for another machine.")],
        [Line(worth)],
        [Table((Column(""), Column("version")), versions)],
        *tables,
        [Line(f"{mark} Notes")],
        [Line(f"- {line}") for line in notes],
    ]
    return Report(
        "bench",
        text=[*parts, notes],
        record=lambda: record() | {"machine": here, "build": asdict(built)},
        data=data,
        page=page,
        pictures=pictures,
    )


def grouped(reasons: Iterable[tuple[str, str, str]], most: int | None = None) -> list[str]:
    """Return a line of text for each reason why contenders (solvers) have no result.

    `reasons` are tuples (contender, reason, task). The task may include the setting of the
    contender, or be empty. A line names at most the first `most` tasks of a contender. Contenders
    with the same reason and the same tasks share a line.
    """
    places: dict[tuple[str, str], list[str]] = {}
    for who, why, where in reasons:
        places.setdefault((who, why), []).append(where)
    alike: dict[tuple[str, str], list[str]] = {}
    for (who, why), found in places.items():
        more = f" and {len(found) - most} more" if most and len(found) > most else ""
        alike.setdefault((why, ", ".join(filter(None, found[:most])) + more), []).append(who)
    return [
        f"{', '.join(names)}: {why}" + (f" ({where})" if where else "")
        for (why, where), names in alike.items()
    ]
