"""The report of `stress`: for each trial a description, and a table by method."""

from collections.abc import Sequence
from functools import partial

from pyharness.checks.check import Check, severity
from pyharness.checks.report import basis_note, checks_report, listed_singly, marks, verdict
from pyharness.checks.stress import Trial
from pyharness.model.report import Column, Picture, Report, Section, Table, short, words

_COLUMNS = (
    *words("method"), Column("checks"), Column("failed"), Column("bounded"),
    Column("ratio", short, name="share"), Column("value", short), Column("limit", short),
    *words("basis"), Column("worst at", left=True, fit="cut"),
)  # fmt: skip
_NOTE = (
    "bounded: number of checks with a bound; the others only describe. ratio: value over limit of "
    "the worst check, with its value, limit and basis (without a bound: the largest value)."
)


def stress_report(trials: Sequence[Trial], checks: Sequence[Check]) -> Report:
    """Return the report of `stress`: failures, then a table and a picture for each trial."""
    text: list[Section] = [listed_singly(checks), [_NOTE, *basis_note(checks)]]
    for each in trials:
        own = [check for check in checks if check.suite == each.name]
        if own:
            text.append([f"{each.name}: {each.title}", f"  bound: {each.bound}"])
            text.append([_table(own)])
    report = checks_report("stress", checks, [*text, [verdict(checks)]])
    pictures = {each.name: partial(_picture, each, checks) for each in trials}
    return report._replace(pictures=pictures)


def _table(checks: Sequence[Check]) -> Table:
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault(check.name.subject, []).append(check)
    rows = []
    for name, members in groups.items():
        judged = [check for check in members if check.limit is not None]
        failed = sum(not check.passed for check in members)
        worst = max(judged, key=severity) if judged else max(members, key=_size)
        share = severity(worst)[1] if judged else None
        where = worst.name.place or None
        numbers = [len(members), failed, len(judged), share, worst.value, worst.limit]
        rows.append([name, *numbers, marks([worst]), where])
    return Table(_COLUMNS, rows)


def _picture(trial: Trial, checks: Sequence[Check]) -> Picture:
    from pyharness.checks import pictures

    if trial.name == "regions":
        from pyharness.checks.theory.amplification import regions

        return pictures.regions_picture(regions())
    if trial.name == "length":
        from pyharness.checks.trials.length import curves

        return pictures.length_picture(list(curves()))
    return pictures.stress_picture(trial, checks)


def _size(check: Check) -> float:
    value = check.value
    return -1.0 if value is None else value if value == value else float("inf")
