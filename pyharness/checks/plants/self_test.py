"""Self-test of `verify`: it plants one fault at a time, and reports which checks detect it."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pyharness.checks.check import Check, Name
from pyharness.checks.kinds import verify
from pyharness.checks.plants.plants import PLANTS, Plant
from pyharness.checks.report import checks_report
from pyharness.checks.selection import Selection
from pyharness.model.report import Report

# The golden record can't distinguish a fault from an intended change.
_NOT_ENOUGH = "golden"
_DRAWS = 12


@dataclass(frozen=True)
class Caught:
    """The checks that failed with a planted fault or, as a control, without any fault.

    `example` is of the golden record only if nothing else failed.
    """

    plant: Plant | None
    failed: Counter[str]
    example: str

    @property
    def passed(self) -> bool:
        """Return whether a check besides the record failed; for the control, whether none did."""
        return bool(self.failed.keys() - {_NOT_ENOUGH}) if self.plant else not self.failed

    @property
    def counts(self) -> str:
        """Return a text for the report with the number of failed checks of each kind."""
        return ", ".join(f"{kind} {count}" for kind, count in self.failed.items())


def self_test(seed: str, record: Path) -> Iterator[Caught]:
    """Yield the failed checks, first without any fault, and then with each planted fault."""
    chosen = Selection(seed=seed, draws=_DRAWS, record=record, thin=True)
    yield _caught(None, chosen)
    for plant in PLANTS:
        with plant.planted(plant.size):
            yield _caught(plant, replace(chosen, only=plant.kinds))


def _caught(plant: Plant | None, chosen: Selection) -> Caught:
    failed: Counter[str] = Counter()
    example = ""
    for check in verify(chosen):
        if not check.passed:
            failed[check.suite] += 1
            if not example or example.startswith(_NOT_ENOUGH):
                example = check.id
    return Caught(plant, failed, example)


def as_check(caught: Caught) -> Check:
    """Return the result for a planted fault as a check; its value leaves out the golden record."""
    name = Name("self-test", caught.plant.name if caught.plant else "none")
    value = float(caught.failed.total() - caught.failed[_NOT_ENOUGH])
    again = "python -m pyharness verify --self-test"
    note = f"caught by {caught.counts or 'nothing'}"
    return Check(name, caught.passed, value, None, None, note, again)


def self_test_report(title: Sequence[str], found: Sequence[Caught], seed: str) -> Report:
    """Return the report of each planted fault: how many checks of which kinds detected it."""
    told = []
    for caught in found:
        plant = caught.plant
        name, fault = (plant.name, plant.fault) if plant else ("none", "no fault: nothing may fail")
        by = f"caught by {caught.counts} ({caught.example})" if caught.failed else "nothing fails"
        told += [f"{'' if caught.passed else 'FAILED '}{name}: {fault}", f"  {by}"]
    missed = sum(not caught.passed for caught in found)
    end = f"{missed} not as it should be" if missed else "each caught by more than the record"
    end = f"{len(found) - 1} plants and a control: {end}"
    return checks_report("verify", list(map(as_check, found)), [title, told, [end]], seed=seed)
