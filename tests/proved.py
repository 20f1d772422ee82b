"""A campaign that tests the promises of references and methods against proved solutions.

The command is ``python -m tests.proved COUNT SEED [FIRST]``. Of four random scenes, one has no
torque and any time, one has none and a short time, one has a torque law, and one has a torque that
depends on the state. The solution at the last time is enclosed in balls of at least 25 digits. The
two references must differ from the balls by at most their own error. The error of a method must be
at most the tolerance plus 4e-15 K, where the error amplification K is below 1e6. The command prints
a line for each result that breaks its promise, then a table: how often an estimate is below the
error, and quantiles of the error over the estimate. It returns exit status 1 if a promise is
broken. 1000 scenes take ten minutes of one core.
"""

import math
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from random import Random

import numpy as np

from pyharness import InputError, Scene, solve
from pyharness.model.state_torque import StateTorque
from pyharness.scenes.free_motions import KINDS as FREE
from pyharness.scenes.free_motions import draw as draw_free
from pyharness.scenes.random_scenes import draw as draw_law
from pyharness.scenes.state_scenes import draw as draw_state
from pyharness.truth.enclosed import Balls
from pyharness.truth.enclosure import enclose
from pyharness.truth.integer_series import integer_series
from pyharness.truth.reference import reference

MOST_GROWTH = 1e6
_DIGITS = 25
_EFFORT = 0.05  # of the enclosures and of the references: about a second each
_SHORTER = 0.3
_METHODS = {"auto": 1e-14, "taylor": 1e-14, "closed-form": 1e-14, "dop853": 1e-12, "rk45": 1e-9}
_ROUNDING = 2e-16
# The largest omega, and the error amplification, are those of a solution at so many times.
_INSIDE, _ROUGH = 50, 1e-9
_QUANTILES = (0.5, 0.9, 0.99, 1.0)
_GROUPS = ("free", "short", "law", "state")


@dataclass
class Tally:
    """The counts of a campaign, and a line for each broken promise."""

    broken: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    ratios: dict[str, list[float]] = field(default_factory=dict)  # error over estimate
    largest: dict[str, float] = field(default_factory=dict)  # error over limit

    def judge(self, place: str, name: str, error: float, limit: float) -> None:
        """Compare an error with its limit, and count it."""
        self.counts[name] += 1
        self.largest[name] = max(self.largest.get(name, 0.0), error / limit if limit else 0.0)
        if not error <= limit:
            self.broken.append(f"{place}, {name}: error {error:.3g} above {limit:.3g}")
            print(self.broken[-1], flush=True)

    def table(self) -> str:
        """Return the counts and quantiles as text."""
        heads = " ".join(f"{f'{100 * q:g} %':>8}" for q in _QUANTILES)
        lines = [f"{'':24} results  error/limit  estimates  below error {heads}"]
        for name in sorted(self.largest):
            ratios = np.array(self.ratios.get(name, []))
            line = f"{name:24} {self.counts[name]:7d}  {self.largest[name]:11.2g}"
            if ratios.size:
                parts = " ".join(f"{x:8.2g}" for x in np.quantile(ratios, _QUANTILES))
                line += f"  {ratios.size:9d}  {np.mean(ratios > 1.0):11.2%} {parts}"
            lines.append(line)
        scenes = ", ".join(f"{self.counts[f'{each} scenes']} {each}" for each in _GROUPS)
        refused = f"{self.counts['refused']} results refused"
        lines.append(f"scenes: {scenes}; {refused}; {len(self.broken)} promises broken")
        return "\n".join(lines)


def drawn(source: Random, seed: str, number: int) -> tuple[str, Scene, float]:
    """Return the group of a scene, the random scene of a number, and its time (s)."""
    group = _GROUPS[number % 4]
    if group == "law":
        draw = draw_law(seed, number)
        scene, time = draw.scene, draw.time
    elif group == "state":
        scene, time = draw_state(source)
    else:
        longest = 6.0 if group == "free" else 1.0
        moments, omega, attitude, time = draw_free(source, source.choice(FREE), longest)
        turns = attitude if number % 8 < 4 else None
        scene = Scene(group, omega=omega, moments=moments, attitude=turns)
    return group, scene, time


def distance(values: Sequence[float], balls: Balls) -> float:
    """Return a bound of the largest distance of values from any point of the balls."""
    pairs = zip(values, balls.middle, strict=True)
    return max(float(abs(Fraction(x) - middle) + balls.radius) for x, middle in pairs)


def try_scene(tally: Tally, seed: str, number: int) -> None:
    """Enclose the solution of one random scene, and judge the references and all methods."""
    source = Random(f"proved {seed} {number}")
    group, scene, time = drawn(source, seed, number)
    small = -math.log10(max(map(abs, scene.omega)) or 1.0)
    digits = min(1000, max(0, math.ceil(small)) + _DIGITS)
    while True:
        try:
            found = enclose(scene, [time], digits, effort=_EFFORT)
            break
        except InputError:
            # The motion has a singularity, or takes too many steps.
            time *= _SHORTER
    (omega,), place = found.omega, f"python -m tests.proved 1 {seed} {number}, t = {time!r}"
    tally.counts[f"{group} scenes"] += 1
    _try_references(tally, group, place, scene, time, omega)
    turning = scene.attitude is not None
    every = [time * k / _INSIDE for k in range(1, _INSIDE + 1)]
    try:
        whole = solve(scene, every, "taylor", _ROUGH, attitude=turning, effort=_EFFORT)
    except InputError:
        tally.counts["refused"] += 1
        return
    growth = math.inf if whole.growth is None else whole.growth
    scale = max(map(abs, [*scene.omega, *whole.omega.flat]))
    if not (growth < MOST_GROWTH and scale and whole.has_all_rows):
        tally.counts["refused"] += 1
        return
    for method, finest in _METHODS.items():
        tolerance = finest ** source.uniform(0.25, 1.0)
        try:
            end = solve(scene, [time], method, tolerance, attitude=turning, effort=_EFFORT)
        except InputError:
            tally.counts["refused"] += 1
            continue
        if not end.has_all_rows:
            tally.counts["refused"] += 1
            continue
        error, name = distance(end.omega[-1].tolist(), omega) / scale, f"{group} {method}"
        tally.judge(place, name, error, tolerance + 4e-15 * growth)
        if end.error is not None:
            ratio = max(0.0, error - _ROUNDING) / max(end.error, _ROUNDING)
            tally.ratios.setdefault(name, []).append(ratio)


def _try_references(
    tally: Tally, group: str, place: str, scene: Scene, time: float, omega: Balls
) -> None:
    radius = float(omega.radius)
    try:
        known = reference(scene, [time], effort=_EFFORT)
        if len(known.omega):
            error = distance(known.omega[-1].tolist(), omega)
            tally.judge(place, f"{group} reference", error, known.error + 2.0 * radius)
        precise = reference(scene, [time], precise=True, effort=_EFFORT)
        if len(precise.omega) and precise.remainder is not None:
            pairs = zip(precise.omega[-1], precise.remainder[-1], omega.middle, strict=True)
            error = max(abs(float(Fraction(x) + Fraction(y) - z)) for x, y, z in pairs)
            # The remainder is rounded to binary64.
            limit = precise.estimate + radius + 2.0**-105 * max(map(abs, precise.omega[-1]))
            tally.judge(place, f"{group} precise", error, float(limit))
    except InputError:
        tally.counts["refused"] += 1
    if group != "law" or isinstance(scene.torque, StateTorque) or scene.torque.in_space:
        return
    try:
        second = integer_series(replace(scene, attitude=None), [time])
        error = distance(second.omega[-1].tolist(), omega)
        scale = float(np.abs(second.way).max())
        tally.judge(place, f"{group} integer series", error, scale * 2e-16 + 2.0 * radius)
    except InputError:
        tally.counts["refused"] += 1


def campaign(count: int, seed: str, first: int = 0) -> Tally:
    """Return the tally of `count` random scenes from number `first` on."""
    tally = Tally()
    for number in range(first, first + count):
        try_scene(tally, seed, number)
    return tally


def main(arguments: Sequence[str]) -> int:
    """Run the campaign of the command line; return 1 if a promise is broken."""
    count, seed, first = [*arguments, "0"][:3]
    tally = campaign(int(count), seed, int(first))
    print(tally.table())
    return 1 if tally.broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
