"""Reasons for the limits of checks."""

from dataclasses import dataclass

MARKS = {
    "proved": "a theorem, whose hypotheses are checked in exact arithmetic",
    "derived": "a formula from analysis, with assumptions and without rigorous rounding",
    "measured": "set from the results of runs",
}
"""The marks of a limit, with their meanings."""


@dataclass(frozen=True)
class Basis:
    """The reason for a check's limit: proof, derivation or measurement."""

    mark: str  # a key of `MARKS`, for the weakest part of the reason
    limit: str
    source: str  # a theorem, derivation or command, in Markdown

    def __post_init__(self) -> None:
        if self.mark not in MARKS or not self.limit or not self.source:
            raise ValueError(f"not a basis of a limit: {self}")
