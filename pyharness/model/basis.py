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
    """The reason for a check's limit: proof, derivation or measurement.

    `mark`, a key of `MARKS`, classifies the weakest part of the reason; `source`, in Markdown,
    names a theorem, derivation or command.
    """

    mark: str
    limit: str
    source: str

    def __post_init__(self) -> None:
        if self.mark not in MARKS or not self.limit or not self.source:
            raise ValueError(f"not a basis of a limit: {self}")
