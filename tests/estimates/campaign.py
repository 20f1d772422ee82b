"""Errors and what is said of them: `python -m tests.estimates --scenes 20000 --seed 1`.

Every scene is drawn anew from the seed and its number, solved to its tolerance, and held to a truth
of 31 digits (`tests.estimates.truth`). One alone again: `--seed 1 --only 123`. 1 where an answer
exceeds what it may err by, or says wrongly whether any digit is left.
"""

import argparse
import csv
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pyharness import InputError, prepare, solve
from pyharness.model.trajectory import Array
from tests.estimates.scenes import Draw, drawn

SENSITIVE = "sensitive"
_ROUNDING = 2.0**-53
_GIVEN = 4e-15  # times K: what rounding may cost beside the tolerance
_CALM = 1e6  # K above which no error is judged
_SURELY, _HARDLY = 3.0, 1.0 / 30.0  # times the tolerance: rounding times K that has to be said

COLUMNS = (
    "number", "kinds", "tolerance", "time", "turns", "growth", "largest", "truth_steps",
    "entrance", "method", "ended", "error", "estimate", "estimated_growth", "steps", "runs",
)  # fmt: skip


@dataclass(frozen=True)
class Answer:
    """What an entrance gave for a scene, and what it said of it; None where it says nothing."""

    draw: Draw
    entrance: str
    method: str
    ended: str
    error: float  # true, over the largest omega on the way; infinite without an answer
    estimate: float | None = None
    growth: float | None = None
    steps: int = 0
    runs: int | None = None  # 2 where the first was not good enough

    @property
    def limit(self) -> float:
        """What the error may be."""
        return self.draw.tolerance + _GIVEN * self.draw.truth.growth

    @property
    def is_judged(self) -> bool:
        """Whether the motion is calm enough for that."""
        return self.draw.truth.growth < _CALM

    @property
    def exceeds(self) -> bool:
        """Whether the error is larger than it may be."""
        return self.is_judged and not self.error <= self.limit

    @property
    def lost(self) -> float:
        """Rounding times K over the tolerance."""
        return _ROUNDING * self.draw.truth.growth / self.draw.tolerance

    @property
    def is_silent(self) -> bool:
        """Whether it does not say that there is nothing left to know."""
        return self.lost > _SURELY and self.ended != SENSITIVE

    @property
    def is_false_alarm(self) -> bool:
        """Whether it says so where all is well."""
        return self.lost < _HARDLY and self.ended == SENSITIVE

    def row(self) -> list[Any]:
        """Return the values of `COLUMNS`."""
        of, truth = self.draw, self.draw.truth
        return [
            of.number, ", ".join(of.kinds), of.tolerance, of.time, truth.turns, truth.growth,
            truth.largest, truth.steps, self.entrance, self.method, self.ended, self.error,
            self.estimate, self.growth, self.steps, self.runs,
        ]  # fmt: skip


def _solved(of: Draw) -> Answer:
    found = solve(of.scene, [of.time], "taylor", of.tolerance)
    omega = found.omega[-1] if len(found.omega) else np.full(3, np.nan)
    return _answer(of, "solve taylor", "taylor", found.ended, omega, found)


def _prepared(method: str) -> Callable[[Draw], Answer]:
    def prepared(of: Draw) -> Answer:
        solver = prepare(of.scene, method, of.tolerance)
        omega = solver(np.array(of.scene.omega), of.time)
        name = f"prepare {method}"
        return _answer(of, name, solver.method, solver.status, omega, solver)

    return prepared


def _answer(of: Draw, name: str, method: str, ended: str, omega: Array, said: Any) -> Answer:
    """Read an answer; the attributes that not every kernel has are hooks."""
    error = of.truth.error(omega) if np.isfinite(omega).all() else float("inf")
    evaluations = getattr(said, "evaluations", None)  # no solver has any
    runs = None if evaluations is None else 1 + (evaluations > said.steps)
    return Answer(of, name, method, ended, error, said.error, said.growth, said.steps, runs)


ENTRANCES: dict[str, Callable[[Draw], Answer]] = {
    "solve taylor": _solved,
    "prepare taylor": _prepared("taylor"),
    "prepare auto": _prepared("auto"),
}


def answers(of: Draw) -> Iterator[Answer]:
    """Ask every entrance; a refusal is an answer too."""
    for name, entrance in ENTRANCES.items():
        try:
            yield entrance(of)
        except InputError as refusal:
            yield Answer(of, name, "", f"refused: {refusal}", float("inf"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign, or show one scene."""
    from pyharness.views.table import write
    from tests.estimates.report import report

    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--scenes", type=int, default=20_000)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--first", type=int, default=0, help="number to begin with")
    parser.add_argument("--only", type=int, help="show this number alone")
    parser.add_argument("--tolerances", type=_tolerances, default=(), metavar="1e-3,...")
    parser.add_argument("--out", type=Path, help="CSV with a row for each answer")
    options = parser.parse_args(arguments)
    if options.only is not None:
        of = drawn(options.seed, options.only, options.tolerances)
        print(of.scene)
        found = list(answers(of))
        for each in found:
            for name, value in zip(COLUMNS, each.row(), strict=True):
                print(f"{name:18s}{value}")
            print(f"{'limit':18s}{each.limit if each.is_judged else 'none'}\n")
        return 1 if _faulty(found) else 0
    begin, looked = time.perf_counter(), 0.0
    found = []
    for count in range(options.scenes):
        before = time.perf_counter()
        of = drawn(options.seed, options.first + count, options.tolerances)
        looked += time.perf_counter() - before
        found += answers(of)
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{count + 1} of {options.scenes} scenes ")
    if options.out:
        with options.out.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(each.row() for each in found)
    print(write(report(found, options.seed)))
    each = max(1, options.scenes)
    print(
        f"{time.perf_counter() - begin:.0f} s; drawing with the truth {1e3 * looked / each:.1f} ms "
        "a scene"
    )
    return 1 if _faulty(found) else 0


def _faulty(found: Sequence[Answer]) -> bool:
    return any(each.exceeds or each.is_silent or each.is_false_alarm for each in found)


def _tolerances(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split(",")))
