"""The views of `family`: tables of at most 100 columns, CSV, JSON; nothing is computed."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from pyharness.history.family.orders import SLACK, OrderFinding
from pyharness.model.build import Build
from pyharness.model.scene import Scene
from pyharness.views.records import SCHEMA, scene_record
from pyharness.views.text import aligned, heading, markdown_text, short, wrapped

_LEFT = ("weighting", "points", "n")


def family_table(scene: Scene, found: Sequence[OrderFinding]) -> str:
    """Return the default view: orders and errors, a row for each weighting and n."""
    lines = heading(scene)
    for title, head, rows in _parts(found):
        lines += ["", *wrapped(title), *aligned(head, rows, left=2)]
    lines += ["", *verdict(found)]
    return "\n".join(lines) + "\n"


def family_markdown(scene: Scene, found: Sequence[OrderFinding]) -> str:
    """Return the same in Markdown."""
    parts = ["\n".join(heading(scene)) + "\n"]
    for title, head, rows in _parts(found):
        parts += [f"{title}\n", markdown_text(head, rows)]
    return "\n".join([*parts, "\n".join(verdict(found)) + "\n"])


def family_rows(found: Sequence[OrderFinding]) -> tuple[Sequence[str], list[list[str]]]:
    """Return head and rows for CSV: full numbers, empty where there is none."""
    head = (
        "weighting", "points", "terms", "corrections", "predicted", "measured", "settled", "error",
    )  # fmt: skip
    return head, [
        [
            each.member.weighting,
            each.member.points_label,
            str(each.member.terms),
            str(each.member.corrections),
            str(each.predicted),
            "" if each.measured is None else repr(each.measured),
            str(each.settled).lower(),
            repr(each.error),
        ]
        for each in found
    ]


def family_record(scene: Scene, found: Sequence[OrderFinding], build: Build) -> dict[str, Any]:
    """Return what `family` found."""
    return {
        "schema": SCHEMA,
        "scene": scene_record(scene),
        "members": [
            {
                **asdict(each.member),
                "predicted": each.predicted,
                "measured": each.measured,
                "settled": each.settled,
                "error": each.error,
            }
            for each in found
        ],
        "unexpected": _unexpected(found),
        "build": asdict(build),
    }


def verdict(found: Sequence[OrderFinding]) -> list[str]:
    """Say how the orders measured stand to those derived."""
    unexpected = _unexpected(found)
    if unexpected:
        return [line for each in unexpected for line in wrapped(f"UNEXPECTED: {each}")]
    near = sum(abs(each.deviation) <= SLACK for each in found)
    silent = sum(each.measured is None for each in found)
    text = f"as expected: {near} of {len(found)} orders within {SLACK} of those derived"
    above = sum(each.deviation > SLACK for each in found)
    if above:
        text += f"; {above} above (in this scene the term that limits them is small)"
    if silent:
        text += f"; {silent} not measurable (nothing but rounding, or no step small enough)"
    unsettled = len(found) - near - above - silent
    if unsettled:
        text += f"; {unsettled} below, but not settled"
    return wrapped(text)


def _unexpected(found: Sequence[OrderFinding]) -> list[str]:
    return [
        f"{_name(each)}: order {each.measured:.2f}, derived {each.predicted}"
        for each in found
        if each.misses
    ]


def _name(each: OrderFinding) -> str:
    member = each.member
    points = f" at points {member.points_label}" if member.points is not None else ""
    return f"{member.weighting}{points}, {member.terms} terms, {member.corrections} corrections"


def _parts(
    found: Sequence[OrderFinding],
) -> list[tuple[str, Sequence[str], list[list[str]]]]:
    corrections = sorted({each.member.corrections for each in found})
    head = [*_LEFT, *(f"k={k}" for k in corrections)]
    groups: dict[tuple[str, str, str], dict[int, OrderFinding]] = {}
    for each in found:
        member = each.member
        key = (member.weighting, member.points_label[:24], str(member.terms))
        groups.setdefault(key, {})[member.corrections] = each
    orders, errors = [], []
    for key, row in groups.items():
        cells = [row.get(k) for k in corrections]
        orders.append([*key, *(_order(each) for each in cells)])
        errors.append([*key, *("" if each is None else short(each.error) for each in cells)])
    return [
        ("order derived / measured, by terms n and corrections k", head, orders),
        ("largest error of any w over these steps (rad/s)", head, errors),
    ]


def _order(each: OrderFinding | None) -> str:
    if each is None:
        return ""
    measured = "-" if math.isnan(each.deviation) else f"{each.measured:.2f}"
    return f"{each.predicted}/{measured}{'' if each.settled or measured == '-' else '?'}"
