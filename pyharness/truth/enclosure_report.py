"""Reports of the subcommand `prove`: enclosures and checked certificates."""

import json
from collections.abc import Sequence
from typing import Any

from pyharness.model.assumptions import assumption_records
from pyharness.model.records import scene_record
from pyharness.model.report import Column, Report, Section, Table, counted, short, words
from pyharness.model.scene import Scene
from pyharness.model.scene_report import heading
from pyharness.truth.enclosed import Enclosure

_NAMES = {
    "omega": ("omega1", "omega2", "omega3"),
    "attitude": ("q0", "q1", "q2", "q3"),
    "velocity": ("V1", "V2", "V3"),
    "energy": ("energy",),
}
_UNITS = {"omega": "rad/s", "attitude": "", "velocity": "m/s", "energy": "J", "transition": ""}
_RADIUS = {"omega": "radius"}


def enclosure_report(scene: Scene, digits: int, found: Enclosure) -> Report:
    rows = found.rows()
    lines = [line for row in rows for line in _lines(row)]
    steps = f", {counted(found.steps, 'step')}" if found.steps else ""
    text: list[Section] = [
        heading(scene),
        [
            f"proved by {found.how}{steps}. The true value differs from a value by at most its "
            "radius:",
            _table([lines]),
        ],
    ]
    columns = [Column("time", unit="s"), *map(Column, ("quantity", "value", "radius", "unit"))]
    return Report(
        "prove",
        text,
        record=lambda: {
            "scene": scene_record(scene),
            "digits": digits,
            "how": found.how,
            "steps": found.steps,
            "rows": rows,
            "assumptions": assumption_records([(scene, [])]),
        },
        data=Table(columns, lines),
    )


def _lines(row: dict[str, Any]) -> list[list[Any]]:
    lines = []
    for quantity, unit in _UNITS.items():
        values = row.get(quantity, ())
        names = _NAMES.get(quantity) or [
            f"d{'omega' if n < 9 else 'q'}{n // 3 + 1 if n < 9 else n // 3 - 3}/domega{n % 3 + 1}"
            for n in range(len(values))
        ]
        radius = row.get(_RADIUS.get(quantity, f"{quantity}_radius"))
        lines += [
            [row["time"], name, value, radius, unit]
            for name, value in zip(names, values, strict=False)
        ]
    return lines


def certificates_report(found: Sequence[tuple[str, dict[str, Any] | None, str]]) -> Report:
    """Return the report of checked certificates.

    An entry has the file's name, its certificate or None, and the reason of a failure.
    """
    verdicts = []
    for name, proved, why in found:
        steps = None if proved is None else len(proved["steps"])
        verdicts.append([name, "proved", steps, "-"] if proved else [name, "not proved", None, why])
    reason = Column("reason", left=True, fit="wrap")
    columns = [*words("certificate verdict"), Column("steps"), reason]
    text: list[Section] = [[Table(columns, verdicts)]]
    for name, proved, _ in found:
        if proved is not None:
            lines = [_lines(row) for row in proved["rows"]]
            text.append([f"{name} proves, of {json.dumps(proved['scene'])}:", _table(lines)])
    return Report(
        "prove",
        text,
        record=lambda: {
            "certificates": [
                {"file": name, "proved": proved is not None, "steps": steps, "reason": why}
                | {key: proved and proved[key] for key in ("scene", "rows")}
                for (name, proved, why), (_, _, steps, _) in zip(found, verdicts, strict=True)
            ]
        },
        data=Table(columns, verdicts),
    )


def _table(lines: Sequence[Sequence[Sequence[Any]]]) -> Table:
    time = Column("time", lambda x: f"{x:.6g}", unit="s")
    columns = [time, *words("quantity value"), Column("radius", short)]
    return Table(columns, [line[:4] for row in lines for line in row])
