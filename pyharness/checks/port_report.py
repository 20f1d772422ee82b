"""The report of `verify --port`: first differing steps, and times of the answers."""

import statistics
from collections.abc import Sequence

from pyharness.checks.port import PortCheck
from pyharness.checks.report import checks_report, summary, summary_page
from pyharness.model.report import Column, Report, Section, Table, digits, words

_MOST_STEPS = 3  # failed checks whose step is shown in full
_UNITS = {"T": "s", "U": "rad/s", "V": "m/s"}
_STEP = (*words("variable unit ours theirs"), Column("ulp"))
_TIMES = (
    *words("runs"), Column("answers"), Column("total (s)", digits(".3f")),
    Column("median (ms)", digits(".3f", 1e3)), Column("longest (ms)", digits(".3f", 1e3)),
)  # fmt: skip


def port_report(command: str, checks: Sequence[PortCheck], asked: int, seed: str) -> Report:
    """Return the report of a port's checks, of which there is at least one."""
    title = [f"{command}: against the twins, bit for bit"]
    if seed:
        title.append(f"seed of the random scenes: {seed}")
    if checks[-1].value is None:
        title.append(f"ended at the first of {asked} cells that it did not answer")
    extra = {"port": command, "seconds": _total(checks), **({"seed": seed} if seed else {})}
    steps = [step_section(check) for check in checks if check.difference][:_MOST_STEPS]
    text = summary(title, checks, depth=2, more=_times(checks))
    # Sections for steps follow the list of failures, the second section.
    text[2:2] = steps
    page = summary_page("verify --port", checks, title, depth=2, more=[*steps, _times(checks)])
    return checks_report("verify", checks, text, page, **extra)


def step_section(check: PortCheck) -> Section:
    """Return the exact values of all variables in the first step that differs."""
    assert check.difference is not None
    rows = [
        [
            each["variable"], _UNITS[each["variable"][0]], repr(float.fromhex(each["ours"])),
            repr(float.fromhex(each["theirs"])), f"{each['ulps']:.0f}",
        ]
        for each in check.difference["values"]
    ]  # fmt: skip
    return [f"{check.id}, step {check.difference['step']}:", Table(_STEP, rows)]


def _total(checks: Sequence[PortCheck]) -> float:
    return sum(check.seconds for check in checks if check.seconds is not None)


def _times(checks: Sequence[PortCheck]) -> Section:
    groups: dict[str, list[float]] = {}
    for check in checks:
        if check.seconds is not None:
            groups.setdefault("/".join(check.id.split("/")[:2]), []).append(check.seconds)
    rows = [
        [name, len(each), sum(each), statistics.median(each), max(each)]
        for name, each in groups.items()
    ]
    told = "times from a request to the port's answer; the first one includes the start of the port"
    return [told, Table(_TIMES, rows)] if rows else []
