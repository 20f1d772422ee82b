"""The report of `family`: orders and errors of the weighted residual methods."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict

from pyharness.history.family.orders import SLACK, OrderFinding
from pyharness.model.records import build_record, scene_record
from pyharness.model.report import Column, Report, Section, Table, numbers, short, words
from pyharness.model.scene import Scene
from pyharness.model.scene_report import heading


def family_report(scene: Scene, found: Sequence[OrderFinding]) -> Report:
    """Return the report of orders and errors in a scene, by n terms and k corrections."""
    names = ("predicted", "measured", "settled", "error")
    measures = [{name: getattr(each, name) for name in names} for each in found]
    data = [
        [member.weighting, member.points_label, member.terms, member.corrections, *measure.values()]
        for member, measure in zip((each.member for each in found), measures, strict=True)
    ]
    page = [heading(scene), *_tables(found), verdict(found)]
    return Report(
        "family",
        text=page,
        record=lambda: {
            "scene": scene_record(scene),
            "members": [
                asdict(each.member) | measure for each, measure in zip(found, measures, strict=True)
            ],
            "unexpected": _unexpected(found),
            "build": build_record(),
        },
        data=numbers("weighting points terms corrections predicted measured settled error", data),
        page=page,
    )


def verdict(found: Sequence[OrderFinding]) -> list[str]:
    """Return sentences on measured and derived orders: one for each miss, else one for all."""
    unexpected = _unexpected(found)
    if unexpected:
        return [f"UNEXPECTED: {each}" for each in unexpected]
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
    return [text]


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


def _tables(found: Sequence[OrderFinding]) -> list[Section]:
    corrections = sorted({each.member.corrections for each in found})
    groups: dict[tuple[str, str, int], dict[int, OrderFinding]] = {}
    for each in found:
        member = each.member
        key = (member.weighting, member.points_label[:24], member.terms)
        groups.setdefault(key, {})[member.corrections] = each
    rows = [[*key, *map(row.get, corrections)] for key, row in groups.items()]
    names = [*words("weighting points"), Column("n")]

    def table(write: Callable[[OrderFinding | None], str]) -> Table:
        return Table([*names, *(Column(f"k={k}", write) for k in corrections)], rows)

    return [
        [
            "Each cell: order derived / order measured, with n terms and k corrections. ?: the "
            "measured order did not converge before rounding errors dominated.",
            table(_order),
        ],
        ["Largest error of any component of omega (rad/s):", table(_error)],
    ]


def _order(each: OrderFinding | None) -> str:
    if each is None:
        return ""
    measured = "-" if math.isnan(each.deviation) else f"{each.measured:.2f}"
    return f"{each.predicted}/{measured}{'' if each.settled or measured == '-' else '?'}"


def _error(each: OrderFinding | None) -> str:
    return "" if each is None else short(each.error)
