"""How much work is done without being asked for: every limit, and the one option that lifts it.

A limit counts work, steps times waves and the like, so that a method gives up after some ten
seconds. `effort` is a factor on all of them.
"""

import math

from pyharness.errors import InputError

# Of a forecast: the pace so far is not that of the rest.
_SLACK = 1.5
# Where there is no forecast.
_UNFORESEEN = 10.0


def checked_effort(effort: float) -> float:
    """Return the factor; InputError where it is no finite number above 0."""
    try:
        value = float(effort)
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not 0.0 < value < math.inf:
        raise InputError(f"effort: {effort}; allowed: a finite number above 0")
    return value


def advice(instead: str, effort: float, needed: float | None = None) -> str:
    """Return what to do where a limit ended the work, as the end of a message.

    Parameters
    ----------
    instead : str
        What else would help, as in "take a shorter time".
    effort : float
        The factor on the limit.
    needed : float, optional
        What it should have been, as far as can be told.
    """
    factor = suggested(effort, needed)
    return f"{instead}, or allow more work: --effort {factor} (effort={factor} in Python)"


def suggested(effort: float, needed: float | None = None) -> str:
    """Return a factor that should do: two digits, rounded up."""
    known = needed is not None and math.isfinite(needed) and needed > 0.0
    assert needed is not None or not known
    factor = max(_SLACK * needed, effort) if known and needed else _UNFORESEEN * effort
    if not factor < 1e300:
        return "1e+300"
    digit = 10.0 ** (math.floor(math.log10(factor)) - 1)
    return f"{math.ceil(factor / digit) * digit:.2g}"
