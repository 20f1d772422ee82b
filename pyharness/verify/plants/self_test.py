"""Self-test of `verify`: one plant after another, and which check catches which."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pyharness.compare.checks import Check
from pyharness.verify.kinds import verify
from pyharness.verify.plants.plants import PLANTS, Plant
from pyharness.verify.selection import Selection

# What is recorded can't tell a fault from a change that was meant.
_NOT_ENOUGH = "golden"
_DRAWS = 12


@dataclass(frozen=True)
class Caught:
    """How a plant fared.

    Attributes
    ----------
    plant : Plant or None
        None for the control, without a fault.
    failed : mapping of str to int
        Failed checks by kind.
    example : str
        The name of one check that failed, not of the record where there is another.
    """

    plant: Plant | None
    failed: Counter[str]
    example: str

    @property
    def passed(self) -> bool:
        """Whether a check that is not the record caught it; of the control, whether none did."""
        if self.plant is None:
            return not self.failed
        return any(count for kind, count in self.failed.items() if kind != _NOT_ENOUGH)


def self_test(seed: str, record: Path) -> Iterator[Caught]:
    """Verify a part of everything without a fault, and once with each plant."""
    chosen = Selection(seed=seed, draws=_DRAWS, record=record, thin=True)
    yield _caught(None, chosen)
    for plant in PLANTS:
        with plant.planted():
            yield _caught(plant, chosen)


def _caught(plant: Plant | None, chosen: Selection) -> Caught:
    failed: Counter[str] = Counter()
    example = ""
    for check in verify(chosen):
        if not check.passed:
            failed[check.kind] += 1
            if not example or example.startswith(_NOT_ENOUGH):
                example = check.id
    return Caught(plant, failed, example)


def as_check(caught: Caught) -> Check:
    """Return the finding as a check."""
    name = "none" if caught.plant is None else caught.plant.name
    counts = ", ".join(f"{kind} {count}" for kind, count in caught.failed.items())
    note = f"caught by {counts}" if counts else "caught by nothing"
    value = float(sum(n for kind, n in caught.failed.items() if kind != _NOT_ENOUGH))
    again = "python -m pyharness verify --self-test"
    return Check(f"self-test/{name}", caught.passed, value, None, again, note)
