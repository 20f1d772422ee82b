"""Stress: numerical stability tried to breaking, in named trials with bounds derived beforehand."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module

from pyharness.compare.checks import Check, may_hold, selected, severity
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene

# Each trial is a module of pyharness.stress.trials, loaded when it is called for.
TRIALS = (
    "separatrix",
    "near-symmetry",
    "shapes",
    "scales",
    "torque",
    "length",
    "step-size",
    "regions",
    "invariance",
    "matrices",
    "threads",
)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came out of one input.

    Attributes
    ----------
    check : Check
        Named ``trial/method or program/circumstance``.
    scene : Scene or None
        The input, where it is a scene.
    """

    check: Check
    scene: Scene | None = None


@dataclass(frozen=True)
class Trial:
    """A named trial.

    Attributes
    ----------
    name, title : str
        What it is called, and what is tried.
    bound : str
        How the bound was derived, in a sentence or two.
    run : callable
        ``run(only)`` yields the outcomes asked for (see `pyharness.compare.checks.selected`), each
        computed when it is its turn.
    """

    name: str
    title: str
    bound: str
    run: Callable[[Sequence[str]], Iterable[Outcome]]


def trial(name: str) -> Trial:
    """Return the trial of a name in `TRIALS`."""
    found: Trial = import_module(f"pyharness.stress.trials.{name.replace('-', '_')}").TRIAL
    return found


def stress(only: Sequence[str] = ()) -> Iterator[Outcome]:
    """Run the trials asked for.

    Parameters
    ----------
    only : sequence of str
        Leading parts of the names of checks, as in ``separatrix/taylor``; all where empty.

    Yields
    ------
    Outcome
        As they come.
    """
    for name in TRIALS:
        if not may_hold(name, only):
            continue
        try:
            for outcome in trial(name).run(only):
                if selected(outcome.check.id, only):
                    yield outcome
        except InputError as refusal:
            # Something refused what it has to take: a fault, and none of the user's.
            id = f"{name}/refused"
            yield Outcome(Check(id, False, None, None, replay(name), f"ended here: {refusal}"))


def replay(id: str) -> str:
    """Return the command that repeats one check."""
    return f"python -m pyharness stress --only {id}"


def worst(outcomes: Iterable[Outcome]) -> dict[str, Outcome]:
    """Return the worst outcome of each trial and method that has a bound and a scene, by name.

    The worst is the one nearest to its limit, or furthest beyond.
    """
    found: dict[str, Outcome] = {}
    for outcome in outcomes:
        if outcome.scene is None or outcome.check.limit is None:
            continue
        name = "/".join(outcome.check.id.split("/")[:2])
        if name not in found or severity(outcome.check) > severity(found[name].check):
            found[name] = outcome
    return found
