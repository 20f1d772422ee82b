"""Elementary functions that are recorded with their derivative, from which their series follows."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

_LN2, _LN10 = math.log(2.0), math.log(10.0)


class Elementary(NamedTuple):
    """A function: its name in NumPy, and its derivative for numbers or symbols."""

    of_numpy: str
    derivative: Callable[[Any], Any]


# By the kind of the operation, which is also the name in `math` and in C.
WITH_DERIVATIVE = {
    "log": Elementary("log", lambda x: 1.0 / x),
    "log1p": Elementary("log1p", lambda x: 1.0 / (1.0 + x)),
    "log2": Elementary("log2", lambda x: 1.0 / _LN2 / x),
    "log10": Elementary("log10", lambda x: 1.0 / _LN10 / x),
    "atan": Elementary("arctan", lambda x: 1.0 / (1.0 + x * x)),
    # Near 1, 1 - x*x would lose digits.
    "asin": Elementary("arcsin", lambda x: 1.0 / np.sqrt((1.0 - x) * (1.0 + x))),
    "acos": Elementary("arccos", lambda x: -1.0 / np.sqrt((1.0 - x) * (1.0 + x))),
    "asinh": Elementary("arcsinh", lambda x: 1.0 / np.sqrt(1.0 + x * x)),
    "acosh": Elementary("arccosh", lambda x: 1.0 / np.sqrt((x - 1.0) * (x + 1.0))),
    "atanh": Elementary("arctanh", lambda x: 1.0 / ((1.0 - x) * (1.0 + x))),
    "cbrt": Elementary("cbrt", lambda x: np.exp(-2.0 / 3.0 * np.log(x)) / 3.0),
    "expm1": Elementary("expm1", np.exp),
    "exp2": Elementary("exp2", lambda x: _LN2 * np.exp(_LN2 * x)),
}


def of_float(kind: str) -> Callable[[float], float]:
    """Return a function of floats that returns an infinity or NaN instead of an error."""
    function, of_numpy = getattr(math, kind), getattr(np, WITH_DERIVATIVE[kind].of_numpy)

    def called(x: float) -> float:
        try:
            found: float = function(x)
        except (ValueError, OverflowError):
            with np.errstate(all="ignore"):
                found = float(of_numpy(x))
        return found

    return called


def with_exponential(exponential: Callable[[float], float]) -> dict[str, Callable[[float], float]]:
    """Return the functions that saturate like another exponential where that does."""
    return {
        "expm1": lambda x: exponential(x) if x > 40.0 else math.expm1(x),
        "exp2": lambda x: exponential(_LN2 * x),
    }
