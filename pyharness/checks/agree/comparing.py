"""Comparison of two programs' rows, cell by cell."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np

from pyharness.checks.agree.plan import Limit, Plan
from pyharness.checks.agree.reading import Rows, Value
from pyharness.checks.compare.agreement import ulp_distances
from pyharness.model.errors import InputError
from pyharness.model.trajectory import Array


@dataclass(frozen=True)
class Place:
    """A cell, with the values of the original and the other program."""

    run: str
    row: int  # from 1
    column: str
    original: Value
    other: Value
    ulps: float

    def __str__(self) -> str:
        ulps = f"{self.ulps:.4g} ulp" if math.isfinite(self.ulps) else "no number of ulp"
        return f"{self.run}, row {self.row}, {self.column}: {self.original}, {self.other} ({ulps})"


@dataclass(frozen=True)
class Column:
    """The distances between two programs in a column."""

    name: str
    limit: Limit
    cells: int
    differ: int  # cells that differ in any bit
    beyond: int  # cells beyond the limit
    distance: float  # largest, in the unit of the limit
    ulps: float  # largest
    first: Place | None  # first cell that differs
    first_beyond: Place | None
    kinds: dict[str, int]  # counts of cells that are not two finite numbers, or 0 with two signs


@dataclass(frozen=True)
class Agreement:
    columns: tuple[Column, ...]
    missing: tuple[str, ...]  # rows of the original, as in "missing in run-1: rows 3 to 5"
    additional: tuple[str, ...]
    growth: dict[str, list[tuple[int, float]]]  # by column, largest distance (ulp) in rows n

    @property
    def first(self) -> Place | None:
        """Return the first cell beyond its limit."""
        return self._first([each.first_beyond for each in self.columns])

    @property
    def first_difference(self) -> Place | None:
        return self._first([each.first for each in self.columns])

    def _first(self, places: Sequence[Place | None]) -> Place | None:
        known = [each for each in places if each is not None]
        number = {name: n for n, name in enumerate(dict.fromkeys(x.run for x in known))}
        return min(known, key=lambda x: (_run_number(x.run, number), x.row), default=None)

    @property
    def passed(self) -> bool:
        return not self.missing and not self.additional and self.first is None


def _run_number(name: str, others: dict[str, int]) -> int:
    last = name.rpartition("-")[2]
    return int(last) if last.isdigit() else others[name]


def compare(plan: Plan, original: Sequence[Rows], other: Sequence[Rows]) -> Agreement:
    """Return the agreement of two programs, with a list of rows for each run."""
    missing: list[str] = []
    additional: list[str] = []
    for run, one, two in zip(plan.runs, original, other, strict=True):
        for rows, told, than in ((one, missing, two), (two, additional, one)):
            if len(rows) > len(than):
                first = f"{run.name}: row" + ("s" if len(rows) > len(than) + 1 else "")
                last = f" to {len(rows)}" if len(rows) > len(than) + 1 else ""
                kind = "missing" if told is missing else "additional"
                told.append(f"{kind} in {first} {len(than) + 1}{last}")
    found = [_column(plan, k, original, other) for k in range(len(plan.outputs.columns))]
    growth = {column.name: rows for column, rows in found}
    return Agreement(tuple(x for x, _ in found), tuple(missing), tuple(additional), growth)


def _column(
    plan: Plan, k: int, original: Sequence[Rows], other: Sequence[Rows]
) -> tuple[Column, list[tuple[int, float]]]:
    name = plan.outputs.columns[k]
    places = [
        (run.name, n, x[k], y[k])
        for run, one, two in zip(plan.runs, original, other, strict=True)
        for n, (x, y) in enumerate(zip(one, two, strict=False), 1)
    ]
    limit = plan.limits[name]
    x, y = ([each[side] for each in places] for side in (2, 3))
    kinds = [(_kind(a), _kind(b)) for a, b in zip(x, y, strict=True)]
    ulps = _distances("ulp", x, y, kinds)
    distance = ulps if limit.unit == "ulp" else _distances(limit.unit, x, y, kinds)
    beyond = ~(distance <= limit.value)
    counts = Counter(
        a if a == b else f"{a}, {b}" for a, b in kinds if a != b or a not in ("number", "0.0")
    )
    for pair in (("number", "0.0"), ("0.0", "number")):
        counts.pop(", ".join(pair), None)

    def place(which: Any) -> Place | None:
        at = int(np.argmax(which)) if which.any() else -1
        return None if at < 0 else Place(*places[at][:2], name, x[at], y[at], float(ulps[at]))

    largest: dict[int, float] = {}
    for (_, row, _, _), size in zip(places, ulps.tolist(), strict=True):
        largest[row] = max(largest.get(row, 0.0), size)
    column = Column(
        name, limit, len(places), int((ulps != 0.0).sum()), int(beyond.sum()),
        float(distance.max(initial=0.0)), float(ulps.max(initial=0.0)),
        place(ulps != 0.0), place(beyond), dict(counts),
    )  # fmt: skip
    return column, sorted(largest.items())


def _kind(value: Value) -> str:
    """Return "number", or the name of a value that is not a finite number other than 0."""
    if isinstance(value, str):
        return value or "empty"
    if math.isnan(value):
        return "NaN"
    return repr(value) if math.isinf(value) or value == 0.0 else "number"


def _distances(
    unit: str, x: Sequence[Value], y: Sequence[Value], kinds: Sequence[tuple[str, str]]
) -> Array:
    if not x:
        return np.zeros(0)
    one, two = (np.array([v if isinstance(v, float) else math.nan for v in z]) for z in (x, y))
    if unit == "ulp":
        found = ulp_distances(one, two)
    else:
        with np.errstate(all="ignore"):
            found = np.abs(one - two)
            if unit == "relative":
                found = np.where(found == 0.0, 0.0, found / np.abs(one))
        found[np.isnan(one) & np.isnan(two) | (one == two)] = 0.0
        found[np.isnan(found) | (np.isinf(two) & (one != two))] = math.inf
    # Text differs from any other text.
    for k, (a, b) in enumerate(kinds):
        if a != b and (isinstance(x[k], str) or isinstance(y[k], str)):
            found[k] = math.inf
    return np.asarray(found, dtype=float)


def largest_distance(plan: Plan, one: Sequence[Rows], two: Sequence[Rows]) -> dict[str, float]:
    """Return the largest distance in each column, in ulp; infinite if rows are missing."""
    found = compare(plan, one, two)
    whole = not found.missing and not found.additional
    return {each.name: each.ulps if whole else math.inf for each in found.columns}


def with_zeros(rows: Sequence[Rows], column: int) -> list[Rows]:
    """Return rows with 0 in a column, or 1 if it has only zeros."""
    value = 0.0 if any(row[column] for each in rows for row in each) else 1.0
    return [[[*row[:column], value, *row[column + 1 :]] for row in each] for each in rows]


def refuse_idle_limits(plan: Plan, original: Sequence[Rows]) -> None:
    """Raise InputError if a limit accepts 0 for all values of its column."""
    for k, name in enumerate(plan.outputs.columns):
        column, _ = _column(plan, k, original, with_zeros(original, k))
        if not column.beyond:
            limit = column.limit
            raise InputError(
                f"'{plan.path}' limits: {limit.value:g} {limit.unit} finds nothing in {name}; it "
                "accepts 0 in place of each value; give a smaller limit"
            )


def are_same(one: Sequence[Rows], two: Sequence[Rows]) -> bool:
    """Return whether all rows are equal, bit for bit."""
    return all(
        a is not None and b is not None and [*map(repr, a)] == [*map(repr, b)]
        for x, y in zip(one, two, strict=True)
        for a, b in zip_longest(x, y)
    )
