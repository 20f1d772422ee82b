"""Stress trials: checks of methods under extreme conditions, with bounds derived beforehand.

The report has a description, a table by method and a picture for each trial.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module

from pyharness.checks.check import Attempts, Check, Name, run_suites, severity
from pyharness.checks.report import basis_note, checks_report, listed_singly, marks, verdict
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.report import Column, Picture, Report, Section, Table, short, words

# Each trial is in a module of pyharness.checks.trials, loaded when it is requested: the one of its
# name, except for these.
_ELSEWHERE = {"near-symmetry": "separatrix", "shapes": "separatrix"}
TRIALS = (
    *("separatrix", "near-symmetry", "shapes", "scales", "torque", "length", "step-size"),
    *("regions", "invariance", "attitude", "matrices", "threads"),
)
# The trials that can be made of any scene (`pyharness.checks.scene_trials`).
SCENE_TRIALS = ("length", "step-size", "invariance", "threads")
LISTINGS = tuple(f(program) for program in PROGRAMS for f in (Listing.original, Listing.corrected))

named = partial(Name, command="stress")
"""Return a `Name`, from the same arguments, whose command is `stress`."""


@dataclass(frozen=True)
class Trial:
    """A group of checks of `stress` under one kind of extreme conditions.

    `bound` is a text on the limits; `attempts` takes the leading parts of requested ids.
    """

    name: str
    title: str
    bound: str
    attempts: Callable[[Sequence[str]], Attempts]


def trial(name: str) -> Trial:
    """Return the trial `name`, one of `TRIALS`."""
    place = _ELSEWHERE.get(name, name).replace("-", "_")
    values = vars(import_module(f"pyharness.checks.trials.{place}")).values()
    return next(each for each in values if isinstance(each, Trial) and each.name == name)


def stress(only: Sequence[str] = (), trials: Mapping[str, Trial] | None = None) -> Iterator[Check]:
    """Yield the checks of `stress` whose ids begin with an element of `only`, or all if empty."""
    suites = {
        name: lambda name=name: (trials[name] if trials else trial(name)).attempts(only)
        for name in trials or TRIALS
    }
    return run_suites(suites, only, "stress")


def worst(checks: Iterable[Check]) -> dict[str, Check]:
    """Return the worst check by ``trial/method``, among checks with a limit and a scene."""
    found: dict[str, Check] = {}
    for check in checks:
        if check.name.scene is None or check.limit is None:
            continue
        name = f"{check.suite}/{check.name.subject}"
        if name not in found or severity(check) > severity(found[name]):
            found[name] = check
    return found


_COLUMNS = (
    *words("method"), Column("checks"), Column("failed"), Column("bounded"),
    Column("ratio", short, name="share"), Column("value", short), Column("limit", short),
    *words("basis"), Column("worst at", left=True, fit="cut"),
)  # fmt: skip
_NOTE = (
    "bounded: number of checks with a bound; the others only describe. ratio: value over limit of "
    "the worst check, with its value, limit and basis (without a bound: the largest value)."
)


def stress_report(trials: Sequence[Trial], checks: Sequence[Check]) -> Report:
    """Return the report of `stress`: failures, then a table and a picture for each trial."""
    text: list[Section] = [listed_singly(checks), [_NOTE, *basis_note(checks)]]
    for each in trials:
        own = [check for check in checks if check.suite == each.name]
        if own:
            text.append([f"{each.name}: {each.title}", f"  bound: {each.bound}"])
            text.append([_table(own)])
    report = checks_report("stress", checks, [*text, [verdict(checks)]])
    pictures = {each.name: partial(_picture, each, checks) for each in trials}
    return report._replace(pictures=pictures)


def _table(checks: Sequence[Check]) -> Table:
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault(check.name.subject, []).append(check)
    rows = []
    for name, members in groups.items():
        judged = [check for check in members if check.limit is not None]
        failed = sum(not check.passed for check in members)
        worst = max(judged, key=severity) if judged else max(members, key=_size)
        share = severity(worst)[1] if judged else None
        where = worst.name.place or None
        numbers = [len(members), failed, len(judged), share, worst.value, worst.limit]
        rows.append([name, *numbers, marks([worst]), where])
    return Table(_COLUMNS, rows)


def _picture(trial: Trial, checks: Sequence[Check]) -> Picture:
    from pyharness.checks import pictures

    if trial.name == "regions":
        from pyharness.checks.theory.amplification import regions

        return pictures.regions_picture(regions())
    if trial.name == "length":
        from pyharness.checks.trials.length import curves

        return pictures.length_picture(list(curves()))
    return pictures.stress_picture(trial, checks)


def _size(check: Check) -> float:
    value = check.value
    return -1.0 if value is None else value if value == value else float("inf")
