"""Stress trials of numerical stability up to its limits, with bounds derived beforehand."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module

from pyharness.checks.check import Attempts, Check, Name, run_suites, severity
from pyharness.model.listing import PROGRAMS, corrected, original

# Each trial is a module of pyharness.checks.trials, loaded when it is requested.
TRIALS = (
    *("separatrix", "near-symmetry", "shapes", "scales", "torque", "length", "step-size"),
    *("regions", "invariance", "attitude", "matrices", "threads"),
)
LISTINGS = tuple(f(program) for program in PROGRAMS for f in (original, corrected))

named = partial(Name, command="stress")
"""Return the name of a check of a trial."""


@dataclass(frozen=True)
class Trial:
    """A named trial: its title, the origin of its bound, and the attempts that `only` requests."""

    name: str
    title: str
    bound: str
    attempts: Callable[[Sequence[str]], Attempts]


def trial(name: str) -> Trial:
    """Return the trial with a name of `TRIALS`."""
    found: Trial = import_module(f"pyharness.checks.trials.{name.replace('-', '_')}").TRIAL
    return found


def stress(only: Sequence[str] = ()) -> Iterator[Check]:
    """Make the checks whose ids begin as in `only`, as in ``separatrix/taylor``; by default all."""
    suites = {name: lambda name=name: trial(name).attempts(only) for name in TRIALS}
    return run_suites(suites, only, "stress")


def worst(checks: Iterable[Check]) -> dict[str, Check]:
    """Return the check with the largest ratio to its limit, for each trial and subject.

    Only checks with a limit and a scene are considered.
    """
    found: dict[str, Check] = {}
    for check in checks:
        if check.name.scene is None or check.limit is None:
            continue
        name = f"{check.suite}/{check.name.subject}"
        if name not in found or severity(check) > severity(found[name]):
            found[name] = check
    return found
