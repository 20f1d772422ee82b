"""Names and results of checks, and the selection of checks to run."""

import math
import shlex
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyharness.checks.scenes.random_scenes import weekly_seed
from pyharness.model.basis import Basis
from pyharness.model.errors import InputError, NotBuiltError, printable
from pyharness.model.scene import Scene
from pyharness.truth.bounded import ErrorBound

if TYPE_CHECKING:
    from pyharness.checks.external_file import Problem

DRAWS = 1000
RECORD = Path(__file__).parent.parent.parent / "tests" / "golden"
# Beginning of the note if a method could not solve the problem or reached its work limit.
REFUSED = "refused: "
# Kinds of checks in whose ids the problem precedes the method.
_CIRCUMSTANCE_FIRST = ("random", "external")

BITS = Basis(
    "derived",
    "no bit or count may differ",
    "IEEE 754 determines the result of each operation; assumes that both sides perform the same "
    "operations in the same order (`checks/check.py`)",
)
"""Basis of the limit 0 for differences between results that must agree bit for bit."""


@dataclass(frozen=True)
class Name:
    """The name of a check; its id joins the non-empty fields among the first five by slashes."""

    suite: str  # kind of check of `verify`, or trial of `stress`
    subject: str = ""  # program or method
    circumstance: str = ""  # problem
    setting: str = ""  # tolerance, step size or listing
    quantity: str = ""  # compared number
    # Command, verify or stress, and options that repeat the check.
    command: str = field(default="verify", kw_only=True)
    options: str = field(default="", kw_only=True)
    scene: Scene | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def id(self) -> str:
        who = self.subject, self.circumstance
        who = who[::-1] if self.suite in _CIRCUMSTANCE_FIRST else who
        return "/".join(filter(None, (self.suite, *who, self.setting, self.quantity)))

    @property
    def place(self) -> str:
        return "/".join(filter(None, (self.circumstance, self.setting, self.quantity)))

    @property
    def replay(self) -> str:
        return f"python -m pyharness {self.command} --only {self.id}{self.options}"

    def with_quantity(self, quantity: str) -> "Name":
        return replace(self, quantity=quantity)

    def bounded(self, value: float, limit: float, basis: Basis, note: str = "") -> "Check":
        """Return the check that `value` is at most `limit`; NaN fails."""
        # NumPy's numbers cannot be written as JSON.
        found, allowed = float(value), float(limit)
        return Check(self, not math.isnan(found) and found <= allowed, found, allowed, basis, note)

    def judged(
        self,
        passed: bool,
        note: str,
        value: float | None = None,
        limit: float | None = None,
        basis: Basis | None = None,
    ) -> "Check":
        """Return a check with the result `passed`; `value` and `limit` are only shown."""
        return Check(self, bool(passed), value, limit, basis, note)

    def described(self, value: float | None, note: str = "") -> "Check":
        """Return a check without a limit, which cannot fail."""
        return Check(self, True, None if value is None else float(value), None, None, note)


@dataclass(frozen=True)
class Check:
    name: Name
    passed: bool
    value: float | None  # None if there is no single number
    limit: float | None  # None if `value` is not compared
    basis: Basis | None  # why the limit has this value
    note: str = ""  # fault or observation, in a few words
    again: str = ""  # command that repeats the check, if not `name.replay`
    # Returns the reference solution's error bound in the unit of `value`, or None; called only
    # when the check is reported.
    reference_bound: Callable[[], ErrorBound | None] | None = field(
        default=None, compare=False, repr=False
    )
    took: float | None = field(default=None, compare=False, repr=False)  # run time (s), for JUnit

    def __post_init__(self) -> None:
        if (self.limit is None) != (self.basis is None):
            raise ValueError(f"{self.id}: a limit has a basis, and a basis has a limit")

    @property
    def id(self) -> str:
        return self.name.id

    @property
    def suite(self) -> str:
        return self.name.suite

    @property
    def mark(self) -> str:
        """Return how the limit was set: proved, derived, measured, or "" without a limit."""
        return self.basis.mark if self.basis else ""

    @property
    def replay(self) -> str:
        return self.again or self.name.replay

    def record(self) -> dict[str, Any]:
        head = {"id": self.id, "passed": self.passed, "value": self.value, "limit": self.limit}
        more = {each.name: getattr(self, each.name) for each in fields(self)[_OF_ANY:]}
        bound = None if self.reference_bound is None else self.reference_bound()
        known = {} if bound is None else {"reference_bound": bound.record()}
        tail = {"basis": self.mark or None, "replay": self.replay, "note": self.note}
        return {**head, **tail, **known, **more}


_OF_ANY = len(fields(Check))


@dataclass(frozen=True)
class Sample(Check):
    """A check in a random scene, with fields by which reports group checks."""

    entrance: str = ""  # call that solved the scene, as in ``solve-taylor``
    tolerance: float = math.nan
    growth: float = math.nan  # error amplification (norm of the state-transition matrix)


@dataclass(frozen=True, eq=False)
class Attempt:
    """A deferred computation of the checks whose ids begin with the id of `name`."""

    name: Name
    make: Callable[[Name], "Check | Iterable[Check | Attempt]"]


Attempts = Iterable[Check | Attempt]
# Quantity of a check that raised an exception.
_RAISED = "exception"


def make_checks(
    attempts: Attempts, only: Sequence[str], raised: tuple[type[Exception], ...] = (NotBuiltError,)
) -> Iterator[Check]:
    """Yield the finished checks, and the deferred checks that `only` selects.

    An exception becomes a failed check, unless its type is in `raised`.
    """
    for each in attempts:
        if isinstance(each, Check):
            yield each
        elif may_hold(each.name.id, only):
            try:
                found = each.make(each.name)
                parts = [found] if isinstance(found, Check) else found
                for check in make_checks(parts, only, raised):
                    is_whole = each.name.id == each.name.suite or check.name.quantity == _RAISED
                    if is_whole or selected(check.id, only):
                        yield check
            except raised:
                raise
            except Exception as error:
                said = f"ended here: {error}"
                if not isinstance(error, InputError):
                    place = traceback.extract_tb(error.__traceback__)[-1]
                    where = f"{Path(place.filename).name}, line {place.lineno}"
                    said = printable(f"ended here: {type(error).__name__}: {error} ({where})")
                ended = each.name.with_quantity(_RAISED).judged(False, said)
                yield replace(ended, again=each.name.replay)


def run_suites(
    suites: Mapping[str, Callable[[], Attempts]],
    only: Sequence[str],
    command: str,
    of_the_user: Sequence[str] = (),  # suites that read the user's files
) -> Iterator[Check]:
    """Yield the checks of all `suites` that `only` selects.

    An exception becomes a failed check, except NotBuiltError and, in suites `of_the_user`,
    InputError.
    """
    for suite, attempts in suites.items():
        raised = (NotBuiltError, InputError) if suite in of_the_user else (NotBuiltError,)

        def whole(name: Name, make: Callable[[], Attempts] = attempts) -> Attempts:
            return make()

        yield from timed(make_checks([Attempt(Name(suite, command=command), whole)], only, raised))


def timed(checks: Iterable[Check]) -> Iterator[Check]:
    """Yield the checks with run times (s), each measured since the previous check."""
    begin = time.perf_counter()
    for check in checks:
        yield replace(check, took=time.perf_counter() - begin)
        begin = time.perf_counter()


def requested_suites(suites: Iterable[str], only: Sequence[str]) -> list[str]:
    return [suite for suite in suites if may_hold(suite, only)]


def severity(check: Check) -> tuple[bool, float]:
    """Return a sort key: passed before failed, then by the ratio of value to limit."""
    if check.value is None or check.limit is None or check.value == check.limit == 0.0:
        return not check.passed, 0.0
    ratio = abs(check.value) / check.limit if check.limit else math.inf
    # NaN cannot be ordered.
    return not check.passed, math.inf if math.isnan(ratio) else ratio


def selected(id: str, only: Sequence[str]) -> bool:
    """Return whether `only` is empty, or contains the id or its first parts."""
    return not only or any(id == each or id.startswith(each + "/") for each in only)


def may_hold(id: str, only: Sequence[str]) -> bool:
    """Return whether `only` can include a check whose id begins with `id`."""
    return selected(id, only) or any(each.startswith(id + "/") for each in only)


def without_check(only: Sequence[str], checks: Sequence[Check]) -> list[str]:
    """Return the ids in `only` that name no check; empty if one failed."""
    # A check that raised has another id than the requested one.
    if not all(check.passed for check in checks):
        return []
    ids = [check.id for check in checks]
    return [x for x in only if "/" in x and not any(selected(id, [x]) for id in ids)]


@dataclass(frozen=True)
class Selection:
    """The choice of the checks for a run of `verify`."""

    only: Sequence[str] = ()  # beginnings of ids, as in ``cells/two-term``; empty: all
    seed: str = field(default_factory=weekly_seed)  # seed of the random draws
    draws: int = DRAWS
    record: Path = RECORD  # folder of the golden record
    # None: the package's published problems
    problems: Sequence["Problem"] | None = None
    thin: bool = False  # a few checks of every kind, for `verify --self-test`

    def may_ask(self, id: str) -> bool:
        return may_hold(id, self.only)

    def name_draw(self, number: int, subject: str = "") -> Name:
        draws = f" --draws {self.draws}" if self.draws > DRAWS else ""
        options = f"{draws} --seed {shlex.quote(self.seed)}"
        return Name("random", subject, str(number), options=options)
