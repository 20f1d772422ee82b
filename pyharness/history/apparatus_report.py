"""The views of `defects` and of `compare --ablate`: text of at most 100 columns."""

import string
import textwrap
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

from pyharness.history.ablation import CaseEffects, Effect
from pyharness.model.listing import names_of
from pyharness.model.scene import Scene
from pyharness.views.text import WIDTH, aligned, heading, short, wrapped

_FIELDS = ("kind", "cards", "scan", "adopted", "certainty", "evidence", "why")


def apparatus_table(entries: Sequence[dict[str, Any]]) -> str:
    """Return a line for each entry: name, kind, certainty, flag, what it is."""
    head = ("name", "kind", "certainty", "flag", "what it is")
    rows = [
        [
            entry["id"],
            entry["kind"],
            entry["certainty"],
            str(entry.get("flag", "-")),
            entry["summary"],
        ]
        for entry in entries
    ]
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(4)]
    room = WIDTH - sum(widths) - 2 * 4
    lines = []
    for row in [list(head), *rows]:
        start = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False))
        parts = textwrap.wrap(row[4], room)
        lines += [f"{start if not i else ' ' * len(start)}  {part}" for i, part in enumerate(parts)]
    lines += ["", "`defects NAME` shows the statements, the evidence and the effect."]
    return "\n".join(lines) + "\n"


def entry_text(entry: dict[str, Any]) -> str:
    """Return one entry whole."""
    lines = wrapped(f"{entry['id']}: {entry['summary']}")
    lines.append("")
    for field in _FIELDS:
        value = entry.get(field)
        if field == "cards":
            value = "; ".join(f"{program} {cards}" for program, cards in entry["cards"].items())
        if not value:
            continue
        lines += textwrap.wrap(
            value, WIDTH, initial_indent=f"{field:10s} ", subsequent_indent=" " * 11
        )
    if "punched" in entry:
        lines += ["", *_beside("as punched", entry["punched"], "as mended", entry["mended"])]
    return "\n".join(lines) + "\n"


def _beside(left_head: str, left: str, right_head: str, right: str) -> list[str]:
    """Return two texts side by side under their heads."""
    room = (WIDTH - 3) // 2
    columns = [
        [head, "-" * room, *textwrap.wrap(text, room)]
        for head, text in ((left_head, left), (right_head, right))
    ]
    pairs = zip_longest(*columns, fillvalue="")
    return [f"{a.ljust(room)}   {b}".rstrip() for a, b in pairs]


def effects_table(effects: Sequence[CaseEffects], is_reading: bool) -> str:
    """Return errors and stops by program and case: as punched, alone mended, alone kept, mended."""
    columns = ("as punched", "this alone mended", "this alone kept", "all mended")
    if is_reading:
        columns = ("punched, with it", "punched", "mended, with it", "mended")
    head = ["case"]
    for letter in "abcd":
        head += [f"w.{letter}", f"V.{letter}", f"stop.{letter}"]
    lines = [
        "effect, measured now, 100 steps: largest error of w (rad/s) and of V (m/s), the stop;"
    ]
    lines.append(", ".join(f"{a}: {text}" for a, text in zip("abcd", columns, strict=True)))
    for program in dict.fromkeys(each.program for each in effects):
        rows = []
        for each in effects:
            if each.program != program:
                continue
            row = [str(each.case)]
            for found in (each.punched, each.mended_alone, each.kept_alone, each.mended):
                row += [short(found.omega), short(found.velocity), _stop(found)]
            rows.append(row)
        lines += ["", program, *aligned(head, rows, left=1)]
    return "\n".join(lines) + "\n"


def lattice_table(scene: Scene, program: str, effects: Sequence[Effect]) -> str:
    """Return one row for each subset of the defects, as letters, sorted by effect."""
    names = names_of("defect", program)
    letters = dict(zip(names, string.ascii_lowercase, strict=False))
    lines = [*heading(scene), f"program {program}: every subset of its defects, sorted by effect"]
    lines += [f"  {letter}  {name}" for name, letter in letters.items()]
    head = ("active", "error of w", "error of V", "steps", "stop")
    rows = [
        [
            "".join(a if name in found.listing.defects else "." for name, a in letters.items()),
            short(found.omega),
            short(found.velocity),
            str(found.steps),
            _stop(found),
        ]
        for found in effects
    ]
    return "\n".join([*lines, "", *aligned(head, rows, left=1)]) + "\n"


def lattice_rows(program: str, effects: Sequence[Effect]) -> tuple[Sequence[str], list[list[str]]]:
    """Return head and rows of the lattice for CSV, errors in full."""
    head = ("program", "active", "error_w", "error_v", "steps", "ended", "stop_variable")
    rows = [
        [
            program,
            " ".join(sorted(found.listing.defects)),
            repr(found.omega),
            repr(found.velocity),
            str(found.steps),
            found.ended,
            found.stop.variable if found.stop else "",
        ]
        for found in effects
    ]
    return head, rows


def _stop(found: Effect) -> str:
    if found.stop is not None:
        return f"{found.stop.variable}@{found.stop.step}"
    return f"ovf@{found.steps}" if found.ended == "overflow" else "-"
