"""The basis of a limit: whether the limit is proved, derived or measured, and by what source."""

from dataclasses import dataclass

MARKS = {
    "proved": "a theorem, whose hypotheses are checked in exact arithmetic",
    "derived": "a formula from analysis, with assumptions and without rigorous rounding",
    "measured": "set from the results of runs",
}
"""The three marks of a limit, each with its meaning."""


@dataclass(frozen=True)
class Basis:
    """The reason why a limit has its value, defined once, beside the limit.

    Attributes
    ----------
    mark : str
        A key of `MARKS`, the weakest of the parts.
    limit : str
        The quantity that is limited, and its terms.
    source : str
        The theorem, the derivation, or the command of the runs, in Markdown.
    """

    mark: str
    limit: str
    source: str

    def __post_init__(self) -> None:
        """Raise ValueError if the mark is unknown, or a text empty."""
        if self.mark not in MARKS or not self.limit or not self.source:
            raise ValueError(f"not a basis of a limit: {self}")
