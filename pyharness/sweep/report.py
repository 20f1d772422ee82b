"""Report of the verb `sweep`: the axes, and statistics of the stored quantities."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from pyharness.model.report import Column, Report, Table, digits, format_duration, words
from pyharness.sweep.axes import Axis, units_of
from pyharness.sweep.forecast import format_estimate
from pyharness.sweep.reductions import REDUCTIONS
from pyharness.sweep.run import Outcome
from pyharness.sweep.store import Store
from pyharness.sweep.sweep import ReductionSpec

_NUMBER = digits(".6g")
_AXES = (
    *words("axis dimension how"), Column("values"), Column("least", _NUMBER),
    Column("largest", _NUMBER), Column("unit", left=True),
)  # fmt: skip
_FOUND = (
    *words("reduction of"), Column("scenes"), Column("none"), Column("least", _NUMBER),
    Column("mean", _NUMBER), Column("largest", _NUMBER), Column("unit", left=True),
)  # fmt: skip
_AXIS_KEYS = ("field", "dimension", "how", "count", "least", "largest", "units")
_FLAGS = (*words("reduction value"), Column("scenes"))


class Found(NamedTuple):
    """Statistics of one component of a reduction, in `units`.

    `scenes` counts the scenes with a finite value, and `none` the others. `least`, `mean` and
    `largest` are None if no value is finite.
    """

    name: str
    label: str
    scenes: int
    none: int
    least: float | None
    mean: float | None
    largest: float | None
    units: str


def summary(store: Store, asked: ReductionSpec) -> tuple[list[Found], Counter[int]]:
    """Return the statistics of a reduction's components, and the counts of its codes of outcomes.

    One of the two is empty. Values are read chunk by chunk.
    """
    reduction = REDUCTIONS[asked.reduction]
    labels = reduction.labels or ("",)
    count, none, total = (np.zeros(len(labels)) for _ in range(3))
    least, largest = np.full(len(labels), np.inf), np.full(len(labels), -np.inf)
    flags: Counter[int] = Counter()
    for chunk in range(store.sweep.n_chunks):
        values = store.read(asked.name, chunk).reshape(-1, len(labels))
        if reduction.flags:
            codes, counts = np.unique(values, return_counts=True)
            flags.update(dict(zip(codes.tolist(), counts.tolist(), strict=True)))
            continue
        finite = np.isfinite(values)
        count += finite.sum(axis=0)
        none += (~finite).sum(axis=0)
        total += np.where(finite, values, 0.0).sum(axis=0)
        least = np.minimum(least, np.where(finite, values, np.inf).min(axis=0))
        largest = np.maximum(largest, np.where(finite, values, -np.inf).max(axis=0))
    if reduction.flags:
        return [], flags
    units = "" if reduction.units == "1" else reduction.units
    mean = total / np.maximum(count, 1)
    numbers = zip(least.tolist(), mean.tolist(), largest.tolist(), strict=True)
    return [
        Found._make([asked.name, label, int(n), int(gaps), *(three if n else [None] * 3), units])
        for label, n, gaps, three in zip(labels, count, none, numbers, strict=True)
    ], flags


def sweep_report(store: Store, outcome: Outcome, path: str) -> Report:
    """Return the report of a sweep: axes, statistics, and the work of this run."""
    sweep = store.sweep
    found: list[Found] = []
    flags: list[tuple[str, str, int]] = []
    for asked in sweep.reductions:
        numbers, counted = summary(store, asked)
        found += numbers
        named = REDUCTIONS[asked.reduction].flags
        flags += [(asked.name, named.get(code, str(code)), n) for code, n in counted.items()]
    text: list[list[Any]] = [[f"{sweep.name}: {_did(outcome)}; store {path}"]]
    if outcome.estimate is not None:
        text[0].append(f"estimated: {format_estimate(outcome.estimate)}")
    axes = [_axis_row(axis) for axis in sweep.axes]
    text.append([Table(_AXES, axes)])
    if found:
        text.append([Table(_FOUND, found)])
    if flags:
        text.append([Table(_FLAGS, flags)])
    return Report(
        "sweep",
        text=text,
        record=lambda: {
            "name": sweep.name,
            "store": path,
            "sweep_sha256": sweep.fingerprint,
            "scenes": sweep.n_scenes,
            "chunks": sweep.n_chunks,
            "computed": outcome.computed,
            "repaired": outcome.repaired,
            "seconds": outcome.seconds,
            "axes": [dict(zip(_AXIS_KEYS, row, strict=True)) for row in axes],
            "reductions": [each._asdict() for each in found],
            "counts": [
                {"reduction": name, "value": value, "scenes": n} for name, value, n in flags
            ],
        },
        data=Table(_FOUND, found),
        page=text,
    )


def _did(outcome: Outcome) -> str:
    total = outcome.before + outcome.computed
    if not outcome.computed:
        return f"all {total} chunks were there"
    there = f", {outcome.before} were there" if outcome.before else ""
    repaired = f", {outcome.repaired} of them damaged before" if outcome.repaired else ""
    return f"{outcome.computed} chunks in {format_duration(outcome.seconds)}{repaired}{there}"


def _axis_row(axis: Axis) -> tuple[Any, ...]:
    least = largest = None
    if not axis.is_choice:
        values = axis.coordinates()
        least, largest = float(values.min()), float(values.max())
    units = units_of(axis.field)
    shown = "" if units == "1" else units
    return axis.field, axis.dimension, axis.how, axis.count, least, largest, shown
