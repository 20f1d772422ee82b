"""The report of `verify --self-test`: a paragraph for each plant."""

from collections.abc import Sequence

from pyharness.compare.checks_report import checks_report
from pyharness.model.report import Report
from pyharness.verify.plants.self_test import Caught, as_check


def self_test_report(title: Sequence[str], found: Sequence[Caught], seed: str) -> Report:
    """Report each fault, and how many checks of each kind caught it."""
    told = []
    for caught in found:
        name, fault = "none", "no fault: nothing may fail"
        if caught.plant is not None:
            name, fault = caught.plant.name, caught.plant.fault
        counts = ", ".join(f"{kind} {count}" for kind, count in caught.failed.items())
        told += [
            f"{'' if caught.passed else 'FAILED '}{name}: {fault}",
            f"  caught by {counts} ({caught.example})" if counts else "  nothing fails",
        ]
    missed = sum(not caught.passed for caught in found)
    end = f"{missed} not as it should be" if missed else "each caught by more than the record"
    end = f"{len(found) - 1} plants and a control: {end}"
    return checks_report("verify", list(map(as_check, found)), [title, told, [end]], seed=seed)
