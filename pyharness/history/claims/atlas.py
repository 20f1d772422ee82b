"""The atlas of claims: which claims of the thesis hold from which initial omega.

The starts, which are values of omega(0), cover the sphere of directions at several magnitudes. The
verdict on a claim has points as in `evidence`: 1 if the claim is reproduced, 1/2 if it is
reproduced in part, and 0 otherwise. The claims have no weights. A verdict code is one of the
integers FAILS, HOLDS and IN_PART of `over_starts`.
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
from pyharness.history.claims.over_starts import (
    FAILS,
    HOLDS,
    IN_PART,
    Starts,
    judged,
)
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

    A start is an initial omega; a reading is an interpretation of doubtful cards. `codes` has for
    each claim of the thesis an array of codes: 0 (fails), 1 (reproduced) or 3 (in part). Its axes
    are reading, number of steps, magnitude of omega(0) (rad/s), height (omega3 divided by the
    magnitude) and longitude (rad). The other fields have the values along these axes, in the same
    order.
    """

    codes: Mapping[str, Codes]
    readings: Sequence[str]
    steps: Sequence[int]
    magnitudes: Array
    heights: Array
    longitudes: Array

    @property
    def n_starts(self) -> int:
        """Return the number of starts (initial omegas) of the atlas.

        The atlas has the same starts for each choice of a reading (interpretation of doubtful
        cards) and a number of steps.
        """
        return len(self.magnitudes) * len(self.heights) * len(self.longitudes)

    def choices(self) -> list[tuple[str, int]]:
        """Return all pairs of a reading (of doubtful cards) and a number of steps of the atlas.

        The pairs are in the order of the arrays of verdict codes.
        """
        return list(product(self.readings, self.steps))

    def score(self, reading: int = 0, steps: int = 0) -> Array:
        """Return for each start (initial omega) the sum of the points of all claims.

        A claim has 1 point if it is reproduced, and 1/2 if in part. `reading` and `steps` are
        indices into `self.readings` and `self.steps`. The shape of the result is (number of
        magnitudes, of heights, of longitudes), the coordinates of a start.
        """
        return sum_of_points([codes[reading, steps] for codes in self.codes.values()])

    def none_fails(self, reading: int = 0, steps: int = 0) -> NDArray[np.bool_]:
        """Return for each start whether every claim is reproduced, at least in part.

        A start is an initial omega. `reading` and `steps` are indices into `self.readings` and
        `self.steps`. The shape of the result is (number of magnitudes, of heights, of longitudes),
        the coordinates of a start.
        """
        held = [codes[reading, steps] != FAILS for codes in self.codes.values()]
        return np.asarray(np.all(held, axis=0))

    def start(self, at: Sequence[int] | NDArray[Any]) -> Triple:
        """Return omega(0) (rad/s) at the three indices `at` of magnitude, height and longitude.

        The height is omega3 divided by the magnitude.
        """
        size, height = self.magnitudes[at[0]], self.heights[at[1]]
        across, longitude = np.sqrt(1.0 - height * height), self.longitudes[at[2]]
        found = size * np.array([across * np.cos(longitude), across * np.sin(longitude), height])
        return (float(found[0]), float(found[1]), float(found[2]))


def atlas_of(codes: Mapping[str, Codes], axes: Mapping[str, Array]) -> Atlas:
    """Return the atlas, the verdicts on claims from many starts, that a sweep has computed.

    A start is an initial omega. `codes` has the array of verdict codes of each claim, negative
    where the sweep is incomplete. `axes` maps the dimensions of these arrays to their values, in
    order: reading of the cards, number of steps, and three coordinates of the start. Raise
    InputError if the sweep has other axes, or is incomplete.
    """
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
    """Return the sum of the points of several claims' verdicts, for each initial omega.

    `codes` has one array of verdict codes for each claim, all of the same shape, which is also the
    shape of the result. A claim has 1 point if it is reproduced, and 1/2 if it is reproduced in
    part.
    """
    values = np.zeros(len(_CODES) + 1)
    for code, points in _POINTS.items():
        values[code] = points
    return np.asarray(sum(values[each] for each in codes))


def shares(codes: Codes) -> tuple[float, float, float]:
    """Return the fractions of starts from which a claim is reproduced, in part, and not at all.

    A start is an initial omega of the programs' runs. `codes` are the verdict codes of the claim of
    the thesis, one for each start.
    """
    whole, part, not_at_all = (float((codes == each).mean()) for each in (HOLDS, IN_PART, FAILS))
    return whole, part, not_at_all


def bits(codes: Codes) -> float:
    """Return the entropy of the verdict on a claim of the thesis over the starts, in bits.

    A start is an initial omega. `codes` are the verdict codes of the claim, one for each start. The
    entropy is 0 if the verdict is the same from every start, and 1 if each of two verdicts is given
    from half of the starts.
    """
    parts = np.array([(codes == code).mean() for code in _CODES])
    parts = parts[parts > 0.0]
    return float(-(parts * np.log2(parts)).sum()) + 0.0


def about(names: Sequence[str]) -> dict[int, list[str]]:
    """Return, for each case by its number, the claims in `names` that are about this case alone.

    `names` are identifiers of claims of the thesis, and so are the results. A claim about several
    cases is left out.
    """
    found: dict[int, list[str]] = {}
    for name in names:
        case = claim(name)["parameters"].get("case")
        if case is not None:
            found.setdefault(case, []).append(name)
    return found


def shown_starts(names: Sequence[str]) -> dict[Triple, dict[str, int]]:
    """Return the verdict codes of the claims `names` from a few initial omegas.

    The initial omegas (starts) are those that the thesis shows, and one of our own
    (`laboratory.starts`). The result maps each start to a code for each claim: 0 (fails), 1
    (reproduced) or 3 (in part). The verdicts are for the original programs.
    """
    given = starts()
    bench = Starts(Laboratory(True, Assumptions()), np.array(given))
    found = {name: judged(claim(name), bench, len(given)) for name in names}
    return {
        start: {name: int(codes[k]) for name, codes in found.items()}
        for k, start in enumerate(given)
    }
