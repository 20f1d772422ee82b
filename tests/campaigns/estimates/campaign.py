"""True and reported errors: `python -m tests.campaigns.estimates --scenes 20000 --seed 1`.

Every scene is drawn from the seed and its number, solved to its tolerance, and compared with a
truth of 31 digits (`tests.campaigns.estimates.truth`). `--seed 1 --only 123` repeats one scene. The
exit status is 1 if an error exceeds the tolerance, if an answer reports wrongly whether any digit
is left, if a reported error is below a hundredth of the true one, or if more than one in a thousand
reported errors are below a tenth of it.
"""

import argparse
import csv
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pyharness import InputError, prepare, solve, solve_many
from pyharness.model.trajectory import Array
from tests.campaigns.estimates.scenes import Draw, drawn

SENSITIVE = "sensitive"
_ROUNDING = 2.0**-53
_ULP = 2.0**-52  # errors up to it are rounding errors of the result
_LOW = 1e-3  # fraction of the estimates that may be below a tenth of the error
_GIVEN = 4e-15  # times K: error allowed for rounding, in addition to the tolerance
_CALM = 1e6  # K above which no error is judged
_SURELY, _HARDLY = 3.0, 1.0 / 30.0  # limits of rounding times K over the tolerance

COLUMNS = (
    "number", "kinds", "tolerance", "time", "turns", "growth", "largest", "truth_steps",
    "entrance", "method", "ended", "error", "estimate", "estimated_growth", "steps", "runs",
)  # fmt: skip


@dataclass(frozen=True)
class Answer:
    """The result of an entry point for a scene, and the error it reported; None for no report."""

    draw: Draw
    entrance: str
    method: str
    ended: str
    error: float  # true error of omega over the largest, or angle (rad); infinite without an answer
    estimate: float | None = None
    growth: float | None = None
    steps: int = 0
    runs: int | None = None  # 2 if the first run was not accurate enough

    @property
    def limit(self) -> float:
        """The largest error allowed."""
        return self.draw.tolerance + _GIVEN * self.draw.truth.growth

    @property
    def is_judged(self) -> bool:
        """Whether the error amplification is small enough to judge the error."""
        return self.draw.truth.growth < _CALM

    @property
    def is_unfinished(self) -> bool:
        """Whether a scene that is judged has no result."""
        return self.is_judged and self.ended not in ("complete", SENSITIVE)

    @property
    def exceeds(self) -> bool:
        """Whether the error is larger than allowed in a result that is reported as complete."""
        return self.is_judged and self.ended == "complete" and not self.error <= self.limit

    @property
    def lost(self) -> float:
        """The rounding error times K, relative to the tolerance."""
        return _ROUNDING * self.draw.truth.growth / self.draw.tolerance

    @property
    def is_silent(self) -> bool:
        """Whether a result is reported as complete although rounding has left no digit.

        A closed form loses no digit to rounding, and for a torque in space no amplification is
        known. For both, the error decides.
        """
        known = self.growth is not None or self.error > self.draw.tolerance
        return self.lost > _SURELY and self.ended == "complete" and known

    @property
    def is_false_alarm(self) -> bool:
        """Whether a scene is reported as sensitive that is not.

        Torques that cancel make a scene sensitive by themselves, which K does not measure. With the
        attitude the amplification is known up to the angle by which an error of omega may rotate
        the body.
        """
        angle = 1.0 + math.pi * self.draw.truth.turns * self.draw.attitude
        calm = self.lost * angle < _HARDLY and "cancelling" not in self.draw.kinds
        return calm and self.ended == SENSITIVE

    @property
    def seen(self) -> float | None:
        """The estimate over the true error; None if one of them is meaningless."""
        if self.estimate is None or not self.error < 1.0 or self.error <= _ULP:
            return None
        return self.estimate / self.error

    @property
    def is_low(self) -> bool:
        """Whether the estimate is below a tenth of the error."""
        return self.seen is not None and self.seen < 0.1

    @property
    def is_blind(self) -> bool:
        """Whether the estimate is below a hundredth of the error."""
        return self.seen is not None and self.seen < 0.01

    def row(self) -> list[Any]:
        """Return the values of `COLUMNS`."""
        of, truth = self.draw, self.draw.truth
        return [
            of.number, ", ".join(of.kinds), of.tolerance, of.time, truth.turns, truth.growth,
            truth.largest, truth.steps, self.entrance, self.method, self.ended, self.error,
            self.estimate, self.growth, self.steps, self.runs,
        ]  # fmt: skip


def _solved(method: str) -> Callable[[Draw], Answer]:
    def solved(of: Draw) -> Answer:
        found = solve(of.scene, of.times, method, of.tolerance, attitude=of.attitude)
        error = np.inf
        if len(found.omega) == len(of.times):
            error = _error(of, found.omega, found.attitude)
        return _answer(of, f"solve {method}", method, found.ended, error, found)

    return solved


def _prepared(method: str) -> Callable[[Draw], Answer]:
    def prepared(of: Draw) -> Answer:
        name, start = f"prepare {method}", np.array(of.scene.omega)
        if of.attitude:
            joint = prepare(of.scene, method, of.tolerance, attitude=True)
            omega, attitude = joint(start, of.time, np.array(of.scene.attitude))
            error = _error(of, omega, attitude)
            return _answer(of, name, joint.plan.method, joint.status, error, joint)
        solver = prepare(of.scene, method, of.tolerance)
        error = _error(of, solver(start, of.time), None)
        return _answer(of, name, solver.method, solver.status, error, solver)

    return prepared


def _many(of: Draw) -> Answer:
    scene = of.scene if of.attitude else replace(of.scene, attitude=None)
    found = solve_many([scene], of.time, tolerance=of.tolerance)
    error = _error(of, found.omega, found.attitude)
    return Answer(of, "solve_many", "auto", str(found.ended[0]), error)


def _error(of: Draw, omega: Array, attitude: Array | None) -> float:
    """Return the largest error of omega or of the attitude; with one row, at the last time only."""
    truth = of.truth
    if not np.isfinite(omega).all():
        return float("inf")
    if omega.size == 3:
        truth = truth.at_the_end()
    found = truth.error(omega.reshape(-1, 3))
    return found if attitude is None else max(found, truth.angle(np.reshape(attitude, (-1, 4))))


def _answer(of: Draw, name: str, method: str, ended: str, error: float, said: Any) -> Answer:
    """Return an answer from a result; not every kernel has all attributes."""
    evaluations = getattr(said, "evaluations", None)  # a prepared solver has none
    runs = None if evaluations is None else 1 + (evaluations > said.steps)
    return Answer(of, name, method, ended, error, said.error, said.growth, said.steps, runs)


ENTRANCES: dict[str, Callable[[Draw], Answer]] = {
    "solve taylor": _solved("taylor"),
    "solve auto": _solved("auto"),
    "prepare taylor": _prepared("taylor"),
    "prepare auto": _prepared("auto"),
    "solve_many": _many,
}


def answers(of: Draw) -> Iterator[Answer]:
    """Yield the answer of every entry point; a refusal is an answer too."""
    for name, entrance in ENTRANCES.items():
        try:
            yield entrance(of)
        except InputError as refusal:
            yield Answer(of, name, "", f"refused: {refusal}", float("inf"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign, or show one scene."""
    from pyharness.views.table import write
    from tests.campaigns.estimates.report import report

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


def faults(each: Answer) -> list[str]:
    """Return the names of an answer's faults; a few estimates may be low."""
    flags = {
        "exceeds": each.exceeds,
        "silent": each.is_silent,
        "false alarm": each.is_false_alarm,
        "blind": each.is_blind,
        "unfinished": each.is_unfinished,
    }
    return [name for name, flag in flags.items() if flag]


def _faulty(found: Sequence[Answer]) -> bool:
    estimates = sum(each.seen is not None for each in found)
    low = sum(each.is_low for each in found)
    return any(map(faults, found)) or low > max(1.0, _LOW * estimates)


def _tolerances(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split(",")))
