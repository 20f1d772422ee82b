"""The report of `stress`: for each trial what was tried, and a row for each method."""

from collections.abc import Sequence
from functools import partial

from pyharness.compare.checks import Check, severity
from pyharness.compare.checks_report import checks_report, told_singly, verdict
from pyharness.model.report import Column, Picture, Report, Section, Table, short, words
from pyharness.stress.run import Trial

_COLUMNS = (
    *words("method"), Column("checks"), Column("failed"), Column("bounded"),
    Column("share", short), Column("value", short), Column("limit", short),
    Column("worst at", left=True, fit="cut"),
)  # fmt: skip
_NOTE = (
    "bounded: checks with a bound, the rest describe; share: of the bound that the worst takes, "
    "value and limit its own (without a bound: the largest value)"
)


def stress_report(trials: Sequence[Trial], checks: Sequence[Check]) -> Report:
    """Report the failures, then a table for each trial; a trial is a picture."""
    text: list[Section] = [told_singly(checks)]
    for each in trials:
        own = [check for check in checks if check.kind == each.name]
        if own:
            text.append([f"{each.name}: {each.title}", f"  bound: {each.bound}"])
            text.append([_table(own)])
    report = checks_report("stress", checks, [*text, [_NOTE, verdict(checks)]])
    pictures = {each.name: partial(_picture, each, checks) for each in trials}
    return report._replace(pictures=pictures)


def _table(checks: Sequence[Check]) -> Table:
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault(check.id.split("/")[1], []).append(check)
    rows = []
    for name, members in groups.items():
        judged = [check for check in members if check.limit is not None]
        failed = sum(not check.passed for check in members)
        worst = max(judged, key=severity, default=None)
        if worst is None:
            worst = max(members, key=lambda check: _size(check.value))
        share = None if worst.limit is None else severity(worst)[1]
        where = "/".join(worst.id.split("/")[2:]) or None
        numbers = (share, worst.value, worst.limit)
        rows.append([name, len(members), failed, len(judged), *numbers, where])
    return Table(_COLUMNS, rows)


def _picture(trial: Trial, checks: Sequence[Check]) -> Picture:
    if trial.name == "regions":
        from pyharness.stress.region_picture import regions_picture
        from pyharness.theory.regions import regions

        return regions_picture(regions())
    if trial.name == "length":
        from pyharness.stress.length_picture import length_picture
        from pyharness.stress.trials.length import curves

        return length_picture(list(curves()))
    from pyharness.stress.pictures import stress_picture

    return stress_picture(trial, checks)


def _size(value: float | None) -> float:
    return -1.0 if value is None else value if value == value else float("inf")
