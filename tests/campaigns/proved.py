"""A campaign that tests the promises of references and methods against proved solutions.

The command is ``python -m tests.campaigns.proved COUNT SEED [FIRST]``. The group `free` has scenes
without torque and with any time, `short` the same with short times, `law` torque laws, and `state`
torques that depend on the state. The solution is enclosed at several times in balls of at least 25
digits.

- A reference must differ from the balls by at most its own error, in omega and attitude.
- The error of a method must be at most the tolerance plus 4e-15 K sqrt(1 + N/1000) after N steps.
  The error of omega is relative to its largest component; the error of the attitude is an angle
  (rad). The error amplification K is below 1e6. For the attitude it is multiplied by 1 plus half of
  the largest omega times the time.
- The error of a method must be at most 100 times its estimate, which is at least 2e-16.

If the forecast of a result's work is large, the result is left out by chance, except with `--all`.
A seed, a number and the groups determine a scene. The command prints a line for each broken
promise, and a table. It returns exit status 1 if a promise is broken.
"""

import argparse
import math
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from random import Random

import numpy as np

from docs.campaign.page import DATA, write_page
from docs.campaign.tally import Run, Tally, command, merged
from pyharness import ImpossibleBodyWarning, InputError, Scene, StateTorque, Trajectory, solve
from pyharness.checks.scenes.random_scenes import draw as draw_law
from pyharness.checks.scenes.state_scenes import draw as draw_state
from pyharness.model.attitude import product
from pyharness.truth.certificate import prove
from pyharness.truth.enclosed import Balls, Enclosure, largest_radius
from pyharness.truth.enclosure import enclose
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import exact_coefficients, reference
from tests.checks.scenes.free_motions import KINDS as FREE
from tests.checks.scenes.free_motions import draw as draw_free

GROUPS = ("free", "short", "law", "state")
MOST_GROWTH = 1e6
_DIGITS = 25
_EFFORT = 0.05  # of the enclosures and of the references: about a second each
_MOST_DIGITS = 60  # under a torque
_SHORTER, _MOST_TRIES = 0.3, 40
_METHODS = {"auto": 1e-14, "taylor": 1e-14, "closed-form": 1e-14, "dop853": 1e-12, "rk45": 1e-9}
# The part of the scenes in which a slow result is computed if it takes little work, and the work
# (rad) from which on the part is lower in proportion.
_SLOW = {
    "reference": (1.0, 3.0), "precise": (0.05, 3.0), "taylor": (1.0, 10_000.0),
    "dop853": (0.05, 10.0), "rk45": (0.05, 10.0),
}  # fmt: skip
_SLOW_WITH_TORQUE = {"reference": (0.5, 30.0), "precise": (0.5, 30.0)}
_ALL = 1 / 100  # part of the scenes without torque in which every result is computed
_ROUNDING, _ANGLE_ROUNDING = 2e-16, 4.5e-16
# The largest omega, and the error amplification, are those of a solution at so many times.
_INSIDE, _ROUGH = 50, 1e-9
_COARSE = 1e-18  # largest radius of a ball over the largest omega
_REPORTS = 20  # in a run


@dataclass(frozen=True)
class Case:
    """One scene of the campaign, and its proved solution."""

    tally: Tally
    group: str
    place: str  # the command that repeats the scene
    scene: Scene
    found: Enclosure
    source: Random
    whole: bool  # whether no result is left out

    @property
    def is_free(self) -> bool:
        """Whether the scene is of a group without torque."""
        return self.group in ("free", "short")

    @property
    def times(self) -> tuple[float, ...]:
        """The times (s) of the proved solution."""
        return self.found.time

    @property
    def work(self) -> float:
        """A forecast of the work of a numerical integration (rad)."""
        fast = max(1.0, *(abs(float(x)) for x in exact_coefficients(self.scene)))
        return abs(self.times[-1]) * fast * math.hypot(*self.scene.omega)

    def judge(self, name: str, error: float, limit: float) -> None:
        """Compare an error with its limit, and count it."""
        self.tally.judge(self.place, f"{self.group} {name}", error, limit)

    def count(self, name: str, what: str) -> None:
        """Count a result that is `refused` or `skipped`."""
        row = self.tally.row(f"{self.group} {name}")
        setattr(row, what, getattr(row, what) + 1)

    def takes(self, name: str) -> bool:
        """Return whether a result is computed.

        It is counted as skipped if the forecast of its work excludes it.
        """
        slow = _SLOW if self.is_free else _SLOW_WITH_TORQUE
        part, most = slow.get(name, (1.0, math.inf))
        chosen, share = (self.source.random() for _ in range(2))
        if self.whole:
            return True
        if chosen >= part:
            return False
        if share * self.work >= most:
            self.count(name, "skipped")
            return False
        return True


def drawn(
    source: Random, seed: str, number: int, groups: Sequence[str] = GROUPS
) -> tuple[str, Scene, float]:
    """Return the group of a scene, the random scene of a number, and its time (s)."""
    group, round_ = groups[number % len(groups)], number // len(groups)
    if group == "law":
        # Every second scene of this generator is a difficult one.
        draw = draw_law(seed, round_)
        scene, time = draw.scene, draw.time
    elif group == "state":
        scene, time = draw_state(source)
    else:
        longest = 6.0 if group == "free" else 1.0
        moments, omega, attitude, time = draw_free(source, source.choice(FREE), longest)
        turns = attitude if round_ % 2 == 0 else None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ImpossibleBodyWarning)
            scene = Scene(group, omega=omega, moments=moments, attitude=turns)
    return group, scene, time


def distance(values: Sequence[float], balls: Balls) -> float:
    """Return a bound of the largest distance of values from any point of the balls."""
    pairs = zip(values, balls.middle, strict=True)
    return max(float(abs(Fraction(x) - middle) + balls.radius) for x, middle in pairs)


def angle(attitude: Sequence[float], balls: Balls) -> float:
    """Return a bound of the angle (rad) between a unit quaternion and any point of the balls.

    The quaternion q of a trajectory never jumps to -q. The angle between q and -q is 2 pi here.
    """
    first, *rest = map(Fraction, attitude)
    scalar, *vector = product((first, *(-x for x in rest)), balls.middle)
    half = math.asin(min(1.0, math.sqrt(float(sum(x * x for x in vector)))))
    return 2.0 * (half if scalar > 0 else math.pi - half) + 8.0 * float(balls.radius)


def try_scene(
    tally: Tally, seed: str, number: int, groups: Sequence[str] = GROUPS, whole: bool = False
) -> None:
    """Enclose the solution of one random scene, and judge the references and the methods.

    No result is left out if `whole` is true.
    """
    source = Random(f"proved {seed} {number}")
    group, scene, time = drawn(source, seed, number, groups)
    tolerances = {name: best ** source.uniform(0.25, 1.0) for name, best in _METHODS.items()}
    chosen = source.random() < _ALL
    parts = [*sorted(source.random() for _ in range(3)), 1.0]
    small = -math.log10(max(map(abs, scene.omega)) or 1.0)
    digits = min(1000, max(0, math.ceil(small)) + _DIGITS)
    if not scene.torque.is_zero and digits > _MOST_DIGITS:
        # The integer steps of the prover of torque laws take minutes here.
        tally.row(f"{group} enclosure").skipped += 1
        return
    for _ in range(_MOST_TRIES):
        try:
            found = enclose(scene, [time * part for part in parts], digits, effort=_EFFORT)
            break
        except InputError:
            # The motion has a singularity, or takes too many steps.
            time *= _SHORTER
    else:
        tally.row(f"{group} enclosure").refused += 1
        return
    tally.counts[group] += 1
    place = command(1, seed, number, groups, whole)
    case = Case(tally, group, place, scene, found, source, whole or chosen)
    _try_enclosure(case, digits)
    _try_references(case)
    _try_methods(case, tolerances)


def _try_enclosure(case: Case, digits: int) -> None:
    """Compare the radii with the requested digits, and at times the balls of two provers."""
    case.judge("enclosure", float(largest_radius(case.found.omega, digits)), 1.0)
    if not (case.whole and case.is_free):
        return
    try:
        second = prove(replace(case.scene, attitude=None), case.times, _DIGITS, 0.02).enclosure
    except InputError:
        case.count("certificate", "refused")
        return
    for one, two in zip(case.found.omega, second.omega, strict=True):
        far = max(abs(x - y) for x, y in zip(one.middle, two.middle, strict=True))
        case.judge("certificate", float(far), float(one.radius + two.radius))


def _try_methods(case: Case, tolerances: dict[str, float]) -> None:
    scene, times = case.scene, case.times
    free = case.is_free
    needed = scene.torque.needs_attitude
    every = [times[-1] * k / _INSIDE for k in range(1, _INSIDE + 1)]
    method = "auto" if free else "taylor"
    try:
        path = solve(scene, every, method, _ROUGH, attitude=needed, effort=_EFFORT)
    except InputError:
        case.count("error amplification", "refused")
        return
    growth = math.inf if path.growth is None else path.growth
    scale = max(map(abs, [*scene.omega, *path.omega.flat]))
    if not (scale and path.has_all_rows):
        case.count("error amplification", "refused")
        return
    if max(float(balls.radius) for balls in case.found.omega) > _COARSE * scale:
        # From rest, the digits that are needed are known only now.
        case.count("enclosure", "skipped")
        return
    # The path with an attitude has this factor in its error amplification already.
    turned = growth * (1.0 if needed else 1.0 + 0.5 * scale * abs(times[-1]))
    turning = scene.attitude is not None
    for name, tolerance in tolerances.items():
        if not case.takes(name):
            continue
        try:
            end = solve(scene, times, name, tolerance, attitude=turning, effort=_EFFORT)
        except InputError:
            case.count(name, "refused")
            continue
        if not end.has_all_rows:
            case.count(name, "refused")
            continue
        pairs = zip(end.omega.tolist(), case.found.omega, strict=True)
        error = max(distance(row, balls) for row, balls in pairs) / scale
        _judge_method(case, name, end, error, tolerance, growth, _ROUNDING)
        if end.attitude is not None and case.found.attitude is not None:
            rows = zip(end.attitude.tolist(), case.found.attitude, strict=True)
            error = max(angle(row, balls) for row, balls in rows)
            _judge_method(case, f"{name} angle", end, error, tolerance, turned, _ANGLE_ROUNDING)


def _judge_method(
    case: Case,
    name: str,
    end: Trajectory,
    error: float,
    tolerance: float,
    growth: float,
    rounding: float,
) -> None:
    """Compare an error with the tolerance and with its estimate, `Trajectory.error`."""
    # A series takes the amplification from any earlier time, and a closed form from fewer times.
    growth = max(growth, end.growth or 0.0)
    if growth < MOST_GROWTH:
        case.judge(name, error, tolerance + 4e-15 * growth * math.sqrt(1.0 + end.steps / 1000.0))
    if end.error is not None:
        beyond, estimate = max(0.0, error - rounding), max(end.error, rounding)
        case.tally.judge_estimate(case.place, f"{case.group} {name}", beyond, estimate)


def _try_references(case: Case) -> None:
    for name, compare in (("reference", _try_reference), ("precise", _try_precise)):
        if not case.takes(name):
            continue
        try:
            compare(case)
        except InputError:
            case.count(name, "refused")
    scene = case.scene
    if case.group != "law" or isinstance(scene.torque, StateTorque) or scene.torque.in_space:
        return
    try:
        second = integer_series(replace(scene, attitude=None), list(case.times))
    except InputError:
        case.count("integer series", "refused")
        return
    scale = float(np.abs(second.way).max())
    for row, balls in zip(second.omega.tolist(), case.found.omega, strict=False):
        limit = scale * 2e-16 + 2.0 * float(balls.radius)
        case.judge("integer series", distance(row, balls), limit)


def _try_reference(case: Case) -> None:
    known = reference(case.scene, case.times, effort=_EFFORT)
    # A reference may end early, before a singularity.
    for row, balls in zip(known.omega.tolist(), case.found.omega, strict=False):
        limit = known.error + 2.0 * float(balls.radius)
        case.judge("reference", distance(row, balls), limit)
    if known.attitude is not None and case.found.attitude is not None:
        for row, balls in zip(known.attitude.tolist(), case.found.attitude, strict=False):
            limit = known.angle_error + 16.0 * float(balls.radius)
            case.judge("reference angle", angle(row, balls), limit)


def _try_precise(case: Case) -> None:
    precise = reference(case.scene, case.times, precise=True, effort=_EFFORT)
    if precise.remainder is None:
        return
    for row, rest, (middle, radius) in zip(
        precise.omega, precise.remainder, case.found.omega, strict=False
    ):
        sums = (Fraction(x) + Fraction(y) for x, y in zip(row, rest, strict=True))
        error = max(abs(float(x - z)) for x, z in zip(sums, middle, strict=True))
        # The remainder is rounded to binary64.
        limit = precise.estimate + float(radius) + 2.0**-105 * max(map(abs, row))
        case.judge("precise", error, float(limit))


def campaign(
    count: int,
    seed: str,
    first: int = 0,
    groups: Sequence[str] = GROUPS,
    report: Callable[[Tally], None] = lambda tally: None,
    whole: bool = False,
) -> Tally:
    """Return the tally of `count` random scenes from number `first` on.

    `report` is called after each twentieth of the scenes, and at an interrupt, with the tally so
    far. The tally of an interrupted run has the scenes that were finished. No result is left out if
    `whole` is true.
    """
    run = Run(seed, first, count, tuple(groups), whole=whole)
    tally = Tally([run])
    try:
        for done in range(1, count + 1):
            one = Tally()
            try_scene(one, seed, first + done - 1, groups, whole)
            tally.add(one)
            tally.runs = [replace(run, done=done)]
            if done * _REPORTS // count > (done - 1) * _REPORTS // count:
                report(tally)
    except KeyboardInterrupt:
        report(tally)
    except Exception:
        # The scenes so far are not lost.
        report(tally)
        done = tally.runs[0].done
        print(f"error in {command(1, seed, first + done, groups, whole)}", flush=True)
        raise
    return tally


def main(arguments: Sequence[str]) -> int:
    """Run the campaign of the command line, or merge tallies; return 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("count", nargs="?", type=int, help="number of scenes")
    parser.add_argument("seed", nargs="?", help="any text; it determines the scenes")
    parser.add_argument("first", nargs="?", type=int, default=0, help="number of the first scene")
    parser.add_argument("--groups", default=",".join(GROUPS), help="groups, separated by commas")
    parser.add_argument("--all", action="store_true", help="leave no slow result out")
    parser.add_argument("--out", type=Path, help="write the tally to this file as JSON")
    parser.add_argument("--merge", type=Path, nargs="+", help="add the tallies of these files")
    parser.add_argument("--markdown", action="store_true", help="print the table as Markdown")
    parser.add_argument("--page", action="store_true", help="write the page of the documents anew")
    chosen = parser.parse_args(arguments)
    groups = tuple(chosen.groups.split(","))
    if not set(groups) <= set(GROUPS):
        parser.error(f"--groups: {chosen.groups}; allowed: {', '.join(GROUPS)}")

    def report(tally: Tally) -> None:
        print(f"{tally.text()}\n", file=sys.stderr, flush=True)
        if chosen.out:
            tally.write(chosen.out)

    if chosen.merge:
        try:
            tally = merged(chosen.merge)
        except InputError as error:
            parser.error(str(error))
    elif chosen.seed is None:
        parser.error("COUNT and SEED, or --merge, are required")
    else:
        # A signal that asks the program to end is treated as an interrupt.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        tally = campaign(chosen.count, chosen.seed, chosen.first, groups, report, chosen.all)
    if chosen.out:
        tally.write(chosen.out)
    if chosen.page:
        tally.write(DATA)
        write_page()
    print(tally.markdown() if chosen.markdown else tally.text())
    return 1 if tally.broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
