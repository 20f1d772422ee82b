"""The table of divergences, by kind."""

from typing import Any

from pyharness.model.facts import facts


def divergences(kind: str | None = None) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = facts("divergences")["divergence"]
    return [entry for entry in entries if kind is None or entry["kind"] == kind]
