"""Outcomes of self-tests, in which `verify` must detect each planted fault."""

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
    """The outcome of one planted fault, or of the control (no fault)."""

    name: str
    fault: str
    passed: bool  # the fault was detected or had no effect; in the control, no check failed
    failed: int  # number of failed checks
    note: str
    has_effect: bool = True  # whether the fault changed a result

    @property
    def check(self) -> Check:
        return Name("self-test", self.name).judged(self.passed, self.note, float(self.failed))


def control(failed: int, note: str) -> Outcome:
    return Outcome(CONTROL, "no fault: nothing may fail", failed == 0, failed, note)


def self_test_report(
    title: Sequence[str], found: Sequence[Outcome], again: str, **extra: Any
) -> Report:
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
