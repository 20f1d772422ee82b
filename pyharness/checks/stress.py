"""Stress trials: checks of methods under extreme conditions, with bounds derived beforehand."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module

from pyharness.checks.check import Attempts, Check, Name, run_suites, severity
from pyharness.model.listing import PROGRAMS, Listing

# Each trial is in the module of pyharness.checks.trials that has its name, except these two.
_ELSEWHERE = {"near-symmetry": "separatrix", "shapes": "separatrix"}
TRIALS = (
    *("separatrix", "near-symmetry", "shapes", "scales", "torque", "length", "step-size"),
    *("regions", "invariance", "attitude", "matrices", "threads"),
)
# For any scene (`pyharness.checks.scene_trials`).
SCENE_TRIALS = ("length", "step-size", "invariance", "threads")
LISTINGS = tuple(f(program) for program in PROGRAMS for f in (Listing.original, Listing.corrected))

named = partial(Name, command="stress")
"""Return a `Name` with the command `stress`, and with the given other fields."""


@dataclass(frozen=True)
class Trial:
    """A group of checks under one kind of extreme conditions."""

    name: str
    title: str
    bound: str  # describes the limits
    # From the requested beginnings of ids; other checks may be omitted.
    attempts: Callable[[Sequence[str]], Attempts]


def trial(name: str) -> Trial:
    place = _ELSEWHERE.get(name, name).replace("-", "_")
    values = vars(import_module(f"pyharness.checks.trials.{place}")).values()
    return next(each for each in values if isinstance(each, Trial) and each.name == name)


def stress(only: Sequence[str] = (), trials: Mapping[str, Trial] | None = None) -> Iterator[Check]:
    suites = {
        name: lambda name=name: (trials[name] if trials else trial(name)).attempts(only)
        for name in trials or TRIALS
    }
    return run_suites(suites, only, "stress")


def worst(checks: Iterable[Check]) -> dict[str, Check]:
    """Return, for each ``trial/method``, the worst check with a limit and a scene."""
    found: dict[str, Check] = {}
    for check in checks:
        if check.name.scene is None or check.limit is None:
            continue
        name = f"{check.suite}/{check.name.subject}"
        if name not in found or severity(check) > severity(found[name]):
            found[name] = check
    return found
