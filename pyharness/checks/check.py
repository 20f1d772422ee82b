"""Checks: what is compared with what, whether it passed, and the command that repeats it."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

from pyharness.model.errors import InputError
from pyharness.model.scene import Scene

# The note of a check begins so where a method reported that it can't, or would take too long.
REFUSED = "refused: "
# Suites whose ids name the problem before the method that solves it.
_CIRCUMSTANCE_FIRST = ("random", "external")


@dataclass(frozen=True)
class Name:
    """What a check compares: parts that, joined by slashes, are its id, as in ``cells/two-term``.

    Attributes
    ----------
    suite : str
        A kind of `verify`, or a trial of `stress`.
    subject : str
        The program or method that is judged.
    circumstance, setting, quantity : str
        The problem; the tolerance, step size or listing; the number that is compared.
    command, options : str
        The verb that makes the check, and its options beside ``--only``.
    scene : Scene or None
        The input, where it is a scene that may be saved.
    """

    suite: str
    subject: str = ""
    circumstance: str = ""
    setting: str = ""
    quantity: str = ""
    command: str = field(default="verify", kw_only=True)
    options: str = field(default="", kw_only=True)
    scene: Scene | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def id(self) -> str:
        """The parts that are not empty, joined by slashes; no two checks of a run have the same."""
        who = self.subject, self.circumstance
        who = who[::-1] if self.suite in _CIRCUMSTANCE_FIRST else who
        return "/".join(filter(None, (self.suite, *who, self.setting, self.quantity)))

    @property
    def place(self) -> str:
        """The parts after the subject."""
        return "/".join(filter(None, (self.circumstance, self.setting, self.quantity)))

    @property
    def replay(self) -> str:
        """The command that makes this check alone."""
        return f"python -m pyharness {self.command} --only {self.id}{self.options}"

    def of(self, quantity: str) -> "Name":
        """Return the name of the check of another quantity."""
        return replace(self, quantity=quantity)

    def bounded(self, value: float, limit: float, note: str = "") -> "Check":
        """Return the check that `value` does not exceed `limit`; NaN does."""
        # NumPy's numbers come here too, and are no JSON.
        found, allowed = float(value), float(limit)
        return Check(self, not math.isnan(found) and found <= allowed, found, allowed, note)

    def judged(
        self, passed: bool, note: str, value: float | None = None, limit: float | None = None
    ) -> "Check":
        """Return a check that passed or not for a reason that `note` tells."""
        return Check(self, bool(passed), value, limit, note)

    def described(self, value: float | None, note: str = "") -> "Check":
        """Return a finding without a bound, which can't fail."""
        return Check(self, True, None if value is None else float(value), None, note)


@dataclass(frozen=True)
class Check:
    """One comparison."""

    name: Name
    passed: bool
    value: float | None  # None where there is no one number
    limit: float | None  # of `value`; None where the check is yes or no, or only describes
    note: str = ""  # what is wrong, or what was seen, in a few words
    again: str = ""  # the command that repeats it, where that is not the one of its name

    @property
    def id(self) -> str:
        """The id of its name."""
        return self.name.id

    @property
    def suite(self) -> str:
        """The suite that it belongs to."""
        return self.name.suite

    @property
    def replay(self) -> str:
        """The command that makes this check alone."""
        return self.again or self.name.replay

    def record(self) -> dict[str, Any]:
        """Return what JSON tells of it."""
        head = {"id": self.id, "passed": self.passed, "value": self.value, "limit": self.limit}
        more = {each.name: getattr(self, each.name) for each in fields(self)[_OF_ANY:]}
        return {**head, "replay": self.replay, "note": self.note, **more}


_OF_ANY = len(fields(Check))


@dataclass(frozen=True)
class Sample(Check):
    """A check in a scene drawn at random, with what its limit is made of."""

    entrance: str = ""  # how the scene was solved
    tolerance: float = math.nan  # the requested one
    growth: float = math.nan  # error amplification: by how much an earlier perturbation grows


@dataclass(frozen=True, eq=False)
class Attempt:
    """What is computed where a check below `name` is requested: `make` returns checks or parts."""

    name: Name
    make: Callable[[Name], "Check | Iterable[Check | Attempt]"]


Attempts = Iterable[Check | Attempt]


def made(attempts: Attempts, only: Sequence[str]) -> Iterator[Check]:
    """Compute what `only` requests; a check that is there already is yielded as it is."""
    for each in attempts:
        if isinstance(each, Check):
            yield each
        elif may_hold(each.name.id, only):
            found = each.make(each.name)
            parts = [found] if isinstance(found, Check) else found
            yield from (check for check in made(parts, only) if selected(check.id, only))


def run_suites(
    suites: Mapping[str, Callable[[], Attempts]],
    only: Sequence[str],
    command: str,
    of_the_user: Sequence[str] = (),
) -> Iterator[Check]:
    """Make the checks requested, suite after suite.

    A refusal that ends a suite fails; in suites `of_the_user` it is a mistake in the user's input.
    """
    for suite, attempts in suites.items():
        if not may_hold(suite, only):
            continue
        try:
            yield from made(attempts(), only)
        except InputError as refusal:
            if suite in of_the_user:
                raise
            again = Name(suite, command=command).replay
            name = Name(suite, "refused", command=command)
            yield replace(name.judged(False, f"ended here: {refusal}"), again=again)


def severity(check: Check) -> tuple[bool, float]:
    """Return what orders checks: those that failed last, then by their ratio to the limit."""
    if check.value is None or check.limit is None or check.value == check.limit == 0.0:
        return not check.passed, 0.0
    ratio = abs(check.value) / check.limit if check.limit else math.inf
    # NaN compares with nothing.
    return not check.passed, math.inf if math.isnan(ratio) else ratio


def selected(id: str, only: Sequence[str]) -> bool:
    """Whether a check is requested: all are where nothing is named, else whole leading parts.

    ``cells/two-term`` selects ``cells/two-term/case-3``, not ``cells/two-terms``.
    """
    return not only or any(id == each or id.startswith(each + "/") for each in only)


def may_hold(id: str, only: Sequence[str]) -> bool:
    """Whether checks below or above `id` are requested: only these are computed."""
    return selected(id, only) or any(each.startswith(id + "/") for each in only)
