from pyharness.checks.check import Check
from pyharness.checks.stress import stress


def checks_of(*only: str) -> dict[str, Check]:
    return {check.id: check for check in stress(only)}


def failed(*only: str) -> list[str]:
    return [id for id, check in checks_of(*only).items() if not check.passed]
