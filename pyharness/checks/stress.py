"""Stress: numerical stability tried to breaking, in named trials with bounds derived beforehand."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module

from pyharness.checks import check as checks
from pyharness.checks.check import Check, may_hold, selected, severity
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, corrected, original
from pyharness.model.scene import Scene

# Each trial is a module of pyharness.checks.trials, loaded when it is called for.
TRIALS = (
    *("separatrix", "near-symmetry", "shapes", "scales", "torque", "length", "step-size"),
    *("regions", "invariance", "attitude", "matrices", "threads"),
)
LISTINGS = tuple(f(program) for program in PROGRAMS for f in (original, corrected))


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came out of one input: a check, and the input where it is a scene."""

    check: Check
    scene: Scene | None = None


@dataclass(frozen=True, eq=False)
class Attempt:
    """What is tried, computed when it is asked for.

    Attributes
    ----------
    name : str
        What follows the name of what it is part of, after a slash: of a trial's own, method or
        program and circumstance.
    make : callable
        From the whole name to checks, whose names begin with it, and parts.
    scene : Scene or None
        The input, where it is a scene.
    """

    name: str
    make: Callable[[str], Iterable["Check | Attempt"]]
    scene: Scene | None = None

    def outcomes(self, whole: str, only: Sequence[str]) -> Iterator[Outcome]:
        """Compute what `only` asks for."""
        id = f"{whole}/{self.name}"
        if not may_hold(id, only):
            return
        for made in self.make(id):
            if isinstance(made, Attempt):
                yield from made.outcomes(id, only)
            elif selected(made.id, only):
                yield Outcome(made, self.scene)


@dataclass(frozen=True)
class Trial:
    """A named trial: what is tried, and how the bound was derived.

    ``run(only)`` yields the outcomes asked for, each computed when it is its turn.
    """

    name: str
    title: str
    bound: str
    run: Callable[[Sequence[str]], Iterable[Outcome]]


def in_turn(
    name: str, attempts: Callable[[], Iterable[Attempt]]
) -> Callable[[Sequence[str]], Iterable[Outcome]]:
    """Return the run of a trial that makes one attempt after the other."""
    return lambda only: (o for attempt in attempts() for o in attempt.outcomes(name, only))


def trial(name: str) -> Trial:
    """Return the trial of a name in `TRIALS`."""
    found: Trial = import_module(f"pyharness.checks.trials.{name.replace('-', '_')}").TRIAL
    return found


def stress(only: Sequence[str] = ()) -> Iterator[Outcome]:
    """Run the checks whose names begin as in `only`, as in ``separatrix/taylor``; or all."""
    for name in TRIALS:
        if not may_hold(name, only):
            continue
        try:
            yield from trial(name).run(only)
        except InputError as refusal:
            # Something refused what it has to take: a fault, and none of the user's.
            id = f"{name}/refused"
            yield Outcome(Check(id, False, None, None, replay(name), f"ended here: {refusal}"))


def replay(id: str) -> str:
    """Return the command that repeats one check."""
    return f"python -m pyharness stress --only {id}"


def bounded(id: str, value: float, limit: float, note: str = "") -> Check:
    """Return the check that `value` does not exceed `limit`; NaN does."""
    return checks.bounded(id, value, limit, replay(id), note)


def described(id: str, value: float | None, note: str = "") -> Check:
    """Return a finding without a bound, which can't fail."""
    return checks.described(id, value, replay(id), note)


def worst(outcomes: Iterable[Outcome]) -> dict[str, Outcome]:
    """Return the outcome nearest to its limit, or furthest beyond, of each trial and method.

    Of those that have a limit and a scene.
    """
    found: dict[str, Outcome] = {}
    for outcome in outcomes:
        if outcome.scene is None or outcome.check.limit is None:
            continue
        name = "/".join(outcome.check.id.split("/")[:2])
        if name not in found or severity(outcome.check) > severity(found[name].check):
            found[name] = outcome
    return found
