"""Self-test of `verify`, with faults planted in programs, methods and references."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from pyharness.checks.kinds import verify
from pyharness.checks.plants.outcome import Outcome, control
from pyharness.checks.plants.plants import PLANTS, Plant
from pyharness.checks.selection import Selection

# The golden record can't distinguish a fault from an intended change.
_NOT_ENOUGH = "golden"
_DRAWS = 12


def self_test(seed: str, record: Path) -> Iterator[Outcome]:
    """Yield the outcomes without a fault, then with each planted fault."""
    chosen = Selection(seed=seed, draws=_DRAWS, record=record, thin=True)
    failed, example = _failed(chosen)
    yield control(failed.total(), _note(failed, example))
    for plant in PLANTS:
        yield outcome(plant, chosen)


def outcome(plant: Plant, chosen: Selection) -> Outcome:
    """Return whether any checks detect a planted fault, apart from the golden record's."""
    with plant.planted(plant.size):
        failed, example = _failed(replace(chosen, only=plant.kinds))
    noticed = failed.total() - failed[_NOT_ENOUGH]
    return Outcome(plant.name, plant.fault, noticed > 0, noticed, _note(failed, example))


def _failed(chosen: Selection) -> tuple[Counter[str], str]:
    """Return the number of failed checks by kind, and one id, preferably not of the record."""
    names = [check.id for check in verify(chosen) if not check.passed]
    kinds = Counter(name.partition("/")[0] for name in names)
    return kinds, min(names, key=lambda name: name.startswith(_NOT_ENOUGH), default="")


def _note(failed: Counter[str], example: str) -> str:
    counts = ", ".join(f"{kind} {count}" for kind, count in failed.items())
    return f"caught by {counts} ({example})" if failed else "nothing fails"
