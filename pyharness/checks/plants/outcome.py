"""Outcomes of self-tests: faults are planted one at a time, and `verify` must notice each."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from pyharness.checks.check import Check, Name
from pyharness.checks.report import checks_report, summary_page
from pyharness.model.report import Report, counted

CONTROL = "none"
"""Name of the outcome without any fault."""


@dataclass(frozen=True)
class Outcome:
    """Whether a planted fault was noticed, by how many checks, and by which."""

    name: str
    fault: str
    passed: bool
    failed: int
    note: str
    has_effect: bool = True  # whether the fault changed a result

    @property
    def check(self) -> Check:
        """Return the outcome as a check; its value is how many checks failed."""
        return Name("self-test", self.name).judged(self.passed, self.note, float(self.failed))


def control(failed: int, note: str) -> Outcome:
    """Return the outcome without any fault, which passes if nothing failed."""
    return Outcome(CONTROL, "no fault: nothing may fail", failed == 0, failed, note)


def self_test_report(
    title: Sequence[str], found: Sequence[Outcome], again: str, **extra: Any
) -> Report:
    """Return the report of a self-test, which the command `again` repeats, with `extra` fields."""
    lines = []
    for each in found:
        lines += [f"{'' if each.passed else 'FAILED '}{each.name}: {each.fault}", f"  {each.note}"]
    missed = sum(not each.passed for each in found)
    idle = sum(not each.has_effect for each in found)
    end = f"{missed} not as it should be" if missed else "each noticed"
    end += f", but {idle} without effect" if idle else ""
    checks = [replace(each.check, again=again) for each in found]
    text = [title, lines, [f"{counted(len(found) - 1, 'plant')} and a control: {end}"]]
    page = summary_page("verify --self-test", checks, title)
    return checks_report("verify", checks, text, page, **extra)
