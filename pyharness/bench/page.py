"""The report of a benchmark: tables, notes, command and machine."""

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
    """Return the report of a benchmark.

    `title` is a Markdown heading, `worth` a sentence on the comparability of the numbers, and
    `parts` are titled tables. `record` returns the JSON, `data` is the table with full precision,
    `pictures` are functions by name. The versions of `packages` are listed. `command` repeats the
    benchmark.
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
    """Return one line per reason, from tuples (contender, reason, task).

    A line lists at most `most` tasks. Contenders with the same reason and tasks share a line.
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
