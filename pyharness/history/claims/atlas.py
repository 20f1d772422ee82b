"""The atlas of claims: which claims of the thesis hold from which initial omega (start).

The starts cover the sphere of directions at several magnitudes. Each claim counts equally: 1 point
if it is reproduced, 1/2 if in part. The codes of verdicts are those of `over_starts`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.history.claims.evidence import POINTS
from pyharness.history.claims.laboratory import Assumptions, Laboratory, starts
from pyharness.history.claims.ledger import claim
from pyharness.history.claims.over_starts import FAILS, HOLDS, IN_PART, Starts, judged
from pyharness.history.claims.verdicts import IN_PART as PARTLY
from pyharness.history.claims.verdicts import REPRODUCED
from pyharness.model.errors import InputError
from pyharness.model.scene import Triple
from pyharness.model.trajectory import Array

WHERE = ("omega.magnitude", "height", "longitude")
CHOSEN = ("reading", "steps")
_CODES = (FAILS, HOLDS, IN_PART)
_POINTS = {HOLDS: POINTS[REPRODUCED], IN_PART: POINTS[PARTLY]}
Codes = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Atlas:
    """The verdict codes of each claim over a grid of starts, readings and numbers of steps.

    The axes of `codes` are reading, number of steps, magnitude of omega(0) (rad/s), height (omega3
    over the magnitude) and longitude (rad).
    """

    codes: Mapping[str, Codes]
    readings: Sequence[str]
    steps: Sequence[int]
    magnitudes: Array
    heights: Array
    longitudes: Array

    @property
    def n_starts(self) -> int:
        """Return the number of starts."""
        return len(self.magnitudes) * len(self.heights) * len(self.longitudes)

    def choices(self) -> list[tuple[str, int]]:
        """Return all pairs of reading and number of steps, in the order of `codes`."""
        return list(product(self.readings, self.steps))

    def score(self, reading: int = 0, steps: int = 0) -> Array:
        """Return the total points of each start; `reading` and `steps` are indices."""
        return sum_of_points([codes[reading, steps] for codes in self.codes.values()])

    def none_fails(self, reading: int = 0, steps: int = 0) -> NDArray[np.bool_]:
        """Return for each start whether no claim fails."""
        held = [codes[reading, steps] != FAILS for codes in self.codes.values()]
        return np.asarray(np.all(held, axis=0))

    def start(self, at: Sequence[int] | NDArray[Any]) -> Triple:
        """Return omega(0) (rad/s) at the three indices of magnitude, height and longitude."""
        size, height = self.magnitudes[at[0]], self.heights[at[1]]
        across, longitude = np.sqrt(1.0 - height * height), self.longitudes[at[2]]
        found = size * np.array([across * np.cos(longitude), across * np.sin(longitude), height])
        return (float(found[0]), float(found[1]), float(found[2]))


def atlas_of(codes: Mapping[str, Codes], axes: Mapping[str, Array]) -> Atlas:
    """Return the atlas of a sweep; raise InputError if it is incomplete or has other axes."""
    if tuple(axes) != (*CHOSEN, *WHERE) or not codes:
        allowed = ", ".join((*CHOSEN, *WHERE))
        raise InputError(
            f"--atlas: the sweep must reduce to claims, and its axes must be {allowed}"
        )
    if any((each < 0).any() for each in codes.values()):
        raise InputError(
            "--atlas: chunks of the store are missing; 'pyharness sweep' computes them"
        )
    return Atlas(
        codes,
        [str(each) for each in axes["reading"]],
        [int(each) for each in axes["steps"]],
        *(axes[name] for name in WHERE),
    )


def sum_of_points(codes: Sequence[Codes]) -> Array:
    """Return the total points of several claims, for each start."""
    values = np.zeros(len(_CODES) + 1)
    for code, points in _POINTS.items():
        values[code] = points
    return np.asarray(sum(values[each] for each in codes))


def shares(codes: Codes) -> tuple[float, float, float]:
    """Return the fractions of starts with verdicts "reproduced", "in part" and "not reproduced"."""
    whole, part, not_at_all = (float((codes == each).mean()) for each in (HOLDS, IN_PART, FAILS))
    return whole, part, not_at_all


def bits(codes: Codes) -> float:
    """Return the entropy (bits) of the verdict on a claim over the starts."""
    parts = np.array([(codes == code).mean() for code in _CODES])
    parts = parts[parts > 0.0]
    return float(-(parts * np.log2(parts)).sum()) + 0.0


def about(names: Sequence[str]) -> dict[int, list[str]]:
    """Return the claims in `names` that concern a single case, by case."""
    found: dict[int, list[str]] = {}
    for name in names:
        case = claim(name)["parameters"].get("case")
        if case is not None:
            found.setdefault(case, []).append(name)
    return found


def shown_starts(names: Sequence[str]) -> dict[Triple, dict[str, int]]:
    """Return the verdict codes of the claims for the original programs, by start in `starts`."""
    given = starts()
    bench = Starts(Laboratory(True, Assumptions()), np.array(given))
    found = {name: judged(claim(name), bench, len(given)) for name in names}
    return {
        start: {name: int(codes[k]) for name, codes in found.items()}
        for k, start in enumerate(given)
    }
