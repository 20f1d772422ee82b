"""Check of the order of the times at which a reference or a proof is requested."""

import itertools
import math
from collections.abc import Sequence

from pyharness.model.errors import InputError


def check_order(times: Sequence[float], who: str) -> None:
    """Raise InputError unless times are finite, of one sign, and lead away from 0.

    The first time may be 0. `who` names the computation in the message.
    """
    if not all(map(math.isfinite, times)):
        raise InputError(f"{who}: a time is not finite; allowed: finite numbers, in seconds")
    away = [abs(t) for t in times]
    one_side = bool(times) and (min(times) >= 0.0 or max(times) <= 0.0)
    if not (one_side and all(t1 < t2 for t1, t2 in itertools.pairwise(away))):
        raise InputError(f"{who}: times do not lead away from 0 on one side; give times that do")
