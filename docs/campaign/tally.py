"""The tally of a campaign against proved solutions: counts, file and table.

``python -m tests.campaigns.proved`` runs the campaign. A histogram with 100 bins for each power of
10 counts the quotients of error and estimate, so that the size of a tally is constant.
"""

import json
import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pyharness import InputError
from pyharness.edition.made_pages import table
from pyharness.model.output_files import write_files

MOST_FACTOR = 100.0
"""The largest allowed quotient of error and estimate."""

_FORMAT = 1
_BINS = 100  # of each power of 10
_LEAST = 1e-9  # smaller quotients are in the lowest bin
_QUANTILES = (0.5, 0.9, 0.99)
_HEAD = (
    "group and result | results | largest error/limit | broken | refused | skipped | estimates | "
    "below the error | 50 % | 90 % | 99 % | 100 %"
)


@dataclass
class Row:
    """The counts of one kind of result, such as the omega of one method in a group of scenes."""

    results: int = 0
    broken: int = 0
    refused: int = 0  # by a message, or because rows are missing
    skipped: int = 0  # left out by chance, because the forecast of the work is large
    largest: float = 0.0  # error over limit
    estimates: int = 0
    below: int = 0  # estimates below the error
    factor: float = 0.0  # largest error over estimate
    bins: Counter[int] = field(default_factory=Counter)

    def add_ratio(self, ratio: float) -> None:
        """Count a quotient of error and estimate."""
        self.estimates += 1
        self.below += ratio > 1.0
        self.factor = max(self.factor, ratio)
        self.bins[math.floor(_BINS * math.log10(max(ratio, _LEAST)))] += 1

    def quantile(self, share: float) -> float:
        """Return the upper end of the bin of a quantile; `share` is from 0 to 1."""
        rest = share * self.estimates
        for each in sorted(self.bins):
            rest -= self.bins[each]
            if rest <= 0:
                return min(self.factor, 10 ** ((each + 1) / _BINS))
        return self.factor

    def add(self, other: "Row") -> None:
        """Add the counts of another row."""
        for name in ("results", "broken", "refused", "skipped", "estimates", "below"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.largest = max(self.largest, other.largest)
        self.factor = max(self.factor, other.factor)
        self.bins.update(other.bins)

    def cells(self) -> list[str]:
        """Return the cells of the table."""
        counts = [f"{x:d}" for x in (self.broken, self.refused, self.skipped)]
        cells = [f"{self.results:d}", f"{self.largest:.2g}" if self.results else "", *counts]
        if not self.estimates:
            return cells + [""] * 6
        quantiles = [*map(self.quantile, _QUANTILES), self.factor]
        below = f"{self.below / self.estimates:.2%}"
        return [*cells, str(self.estimates), below, *(f"{x:.2g}" for x in quantiles)]


@dataclass(frozen=True)
class Run:
    """One run: `count` scenes, numbered from `first`, of which `done` are finished."""

    seed: str
    first: int
    count: int
    groups: tuple[str, ...]
    done: int = 0
    whole: bool = False  # whether no slow result was left out

    @property
    def command(self) -> str:
        """The command that repeats the finished scenes."""
        return command(self.done, self.seed, self.first, self.groups, self.whole)

    def overlaps(self, other: "Run") -> bool:
        """Return whether a scene is in both runs."""
        if (self.seed, self.groups) != (other.seed, other.groups):
            return False
        return max(self.first, other.first) < min(self.first + self.done, other.first + other.done)


@dataclass
class Tally:
    """The counts of runs, and the broken promises.

    A broken promise has the texts `result` and `command`, and the numbers `error` and `limit`.
    """

    runs: list[Run] = field(default_factory=list)
    rows: dict[str, Row] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    broken: list[dict[str, Any]] = field(default_factory=list)

    def row(self, name: str) -> Row:
        """Return the counts of a kind of result."""
        return self.rows.setdefault(name, Row())

    def judge(self, place: str, name: str, error: float, limit: float) -> None:
        """Count a result, and report it if its error is above the limit."""
        error, limit = float(error), float(limit)
        row = self.row(name)
        row.results += 1
        row.largest = max(row.largest, error / limit if limit else 0.0 if not error else math.inf)
        if not error <= limit:
            row.broken += 1
            self._report(place, name, error, limit)

    def judge_estimate(self, place: str, name: str, error: float, estimate: float) -> None:
        """Count the quotient of error and estimate; above `MOST_FACTOR` a promise is broken."""
        error, estimate = float(error), float(estimate)
        row = self.row(name)
        row.add_ratio(error / estimate)
        if not error <= MOST_FACTOR * estimate:
            row.broken += 1
            self._report(place, f"{name} estimate", error, MOST_FACTOR * estimate)

    def _report(self, place: str, name: str, error: float, limit: float) -> None:
        self.broken.append({"result": name, "command": place, "error": error, "limit": limit})
        print(f"{place}: {name}: error {error:.3g} above {limit:.3g}", flush=True)

    def add(self, other: "Tally") -> None:
        """Add the counts of other runs; raise InputError if a scene would be counted twice."""
        for mine in self.runs:
            for each in other.runs:
                if mine.overlaps(each):
                    raise InputError(
                        f"merge: '{mine.command}' and '{each.command}' have common scenes; allowed:"
                        " each scene once"
                    )
        self.runs += other.runs
        for name, row in other.rows.items():
            self.row(name).add(row)
        self.counts.update(other.counts)
        self.broken += other.broken

    def lines(self) -> list[list[str]]:
        """Return the cells of the table, beginning with the names of the results."""
        return [[name, *row.cells()] for name, row in sorted(self.rows.items())]

    def shown(self, above: float) -> dict[str, Row]:
        """Return the rows with a broken promise, or with error over limit of at least `above`."""
        return {name: row for name, row in sorted(self.rows.items())
                if row.broken or row.largest >= above}  # fmt: skip

    def markdown(self, above: float = 0.0, columns: int | None = None) -> str:
        """Return the first columns of the rows that `shown` returns as a Markdown table."""
        cells = [[name, *row.cells()][:columns] for name, row in self.shown(above).items()]
        return table(" | ".join(_HEAD.split(" | ")[:columns]), cells)

    def text(self) -> str:
        """Return the whole table, and the summary, as text."""
        lines = [_HEAD.split(" | "), *self.lines()]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        shown = [
            "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]).rstrip()
            for line in lines
        ]
        return "\n".join([*shown, self.summary()])

    def summary(self) -> str:
        """Return the numbers of scenes of each group and of broken promises as one line."""
        scenes = ", ".join(f"{n} {name}" for name, n in sorted(self.counts.items()))
        return f"scenes: {scenes or 'none'}; {len(self.broken)} promises broken"

    def write(self, path: Path) -> None:
        """Write the tally as JSON, whole or not at all."""
        rows = {
            name: asdict(row) | {"bins": sorted(row.bins.items())}
            for name, row in sorted(self.rows.items())
        }
        record = {
            "format": _FORMAT,
            "runs": [asdict(run) for run in self.runs],
            "scenes": dict(sorted(self.counts.items())),
            "broken": self.broken,
            "rows": {},
        }
        # A line for each row keeps diffs readable.
        lines = ",\n".join(f"  {json.dumps(name)}: {json.dumps(row)}" for name, row in rows.items())
        text = json.dumps(record, indent=1).replace('"rows": {}', f'"rows": {{\n{lines}\n }}')
        write_files({str(path): f"{text}\n".encode()}, "--out")


def command(count: int, seed: str, first: int, groups: Iterable[str], whole: bool = False) -> str:
    """Return the command of a run of the campaign; a `whole` run also computes slow results."""
    name = seed if seed.replace("-", "").isalnum() else repr(seed)
    chosen = ",".join(groups)
    run = f"python -m tests.campaigns.proved {count} {name} {first}"
    return f"{run} --groups {chosen}{' --all' * whole}"


def read(path: Path) -> Tally:
    """Return the tally of a file; raise InputError if the file has none."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        if record["format"] != _FORMAT:
            raise InputError(f"{path}: format {record['format']}; allowed: {_FORMAT}")
        return Tally(
            [Run(**{**run, "groups": tuple(run["groups"])}) for run in record["runs"]],
            {
                name: Row(**{**row, "bins": Counter(dict(row["bins"]))})
                for name, row in record["rows"].items()
            },
            Counter(record["scenes"]),
            record["broken"],
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: no tally of a campaign ({error})") from None


def merged(paths: Iterable[Path]) -> Tally:
    """Return the sum of the tallies of files; raise InputError if runs have common scenes."""
    found = Tally()
    for path in paths:
        found.add(read(path))
    return found
