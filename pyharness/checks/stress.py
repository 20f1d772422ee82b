"""Stress trials: checks of methods under extreme conditions, with bounds derived beforehand."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module

from pyharness.checks.check import Attempts, Check, Name, run_suites, severity
from pyharness.model.listing import PROGRAMS, Listing

# These two trials are not in a module of their name.
_ELSEWHERE = {"near-symmetry": "separatrix", "shapes": "separatrix"}
TRIALS = (
    *("separatrix", "near-symmetry", "shapes", "scales", "torque", "length", "step-size"),
    *("regions", "invariance", "attitude", "matrices", "threads"),
)
# Trials for any scene (`pyharness.checks.scene_trials`).
SCENE_TRIALS = ("length", "step-size", "invariance", "threads")
LISTINGS = tuple(f(program) for program in PROGRAMS for f in (Listing.original, Listing.corrected))

named = partial(Name, command="stress")
"""Return a `Name` with the command `stress`."""


@dataclass(frozen=True)
class Trial:
    """A group of checks under one kind of extreme conditions."""

    name: str
    title: str
    bound: str  # describes the limits
    # Returns the checks whose ids have the requested beginnings, and possibly others.
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
    """Return the worst check with a limit and a scene, by ``trial/method``."""
    found: dict[str, Check] = {}
    for check in checks:
        if check.name.scene is None or check.limit is None:
            continue
        name = f"{check.suite}/{check.name.subject}"
        if name not in found or severity(check) > severity(found[name]):
            found[name] = check
    return found
