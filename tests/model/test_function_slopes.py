"""Slopes of recorded functions, by dual numbers and by both kernels, are those of mpmath.

Each function of one argument in the table of samples needs a slope here, or has none.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness.engine.steps.taylor_ivp import recorded_equation
from pyharness.engine.system import leaf_cache
from pyharness.engine.system.recorded import kernel_tape, taylor_step
from pyharness.model.dual import with_derivatives
from pyharness.model.state_torque import recorded
from pyharness.model.tape import FLOATS, evaluate
from tests.conftest import Patch
from tests.model.test_elementary import ARGUMENTS, JUMPS, SINGULAR

SLOPES: dict[str, Callable[[Any], Any]] = {
    "tanh": lambda x: mpmath.sech(x) ** 2, "arctan": lambda x: 1 / (1 + x * x),
    "arcsinh": lambda x: 1 / mpmath.sqrt(1 + x * x),
    "cbrt": lambda x: 1 / (3 * mpmath.cbrt(abs(x)) ** 2),
    "sin": mpmath.cos, "cos": lambda x: -mpmath.sin(x), "tan": lambda x: mpmath.sec(x) ** 2,
    "square": lambda x: 2 * x, "sqrt": lambda x: 1 / (2 * mpmath.sqrt(x)),
    "reciprocal": lambda x: -1 / x**2, "log": lambda x: 1 / x,
    "log2": lambda x: 1 / x / mpmath.log(2), "log10": lambda x: 1 / x / mpmath.log(10),
    "log1p": lambda x: 1 / (1 + x), "arcsin": lambda x: 1 / mpmath.sqrt(1 - x * x),
    "arccos": lambda x: -1 / mpmath.sqrt(1 - x * x), "arctanh": lambda x: 1 / (1 - x * x),
    "arccosh": lambda x: 1 / mpmath.sqrt(x * x - 1), "exp": mpmath.exp, "expm1": mpmath.exp,
    "exp2": lambda x: mpmath.log(2) * mpmath.mpf(2) ** x, "sinh": mpmath.cosh, "cosh": mpmath.sinh,
    **dict.fromkeys(("absolute", "fabs"), mpmath.sign),
    **dict.fromkeys(("radians", "deg2rad"), lambda x: mpmath.pi / 180),
    **dict.fromkeys(("degrees", "rad2deg"), lambda x: 180 / mpmath.pi),
    **dict.fromkeys(("conjugate", "positive"), lambda x: mpmath.mpf(1)),
    "negative": lambda x: mpmath.mpf(-1),
}  # fmt: skip
# Functions of a rounded logarithm or exponent.
LOST: dict[str, Callable[[float], float]] = {
    "exp2": abs, "cbrt": lambda x: abs(float(np.log(abs(x)))),
}  # fmt: skip
# Slopes that are differences, of the cosine also in kernels. Their errors are those of the value,
# doubled by the square. Formulas without a difference overflow, or take twice as long.
DIFFERENCES = ("cosh", "tanh")
# Those with a switch have no compiled code.
INTERPRETED = ("absolute", "fabs", "cbrt")
# Squares overflow, or differ from 1 by less than a rounding error.
LARGEST = 1e150


def points(name: str, least: float = 0.0) -> list[float]:
    singular = SINGULAR.get(name, ())
    if name in ("absolute", "fabs"):
        singular = (0.0,)
    return [x for x in ARGUMENTS[name] if x not in singular and least <= abs(x) <= LARGEST]


def check(name: str, x: float, slope: float, least: float = 0.0) -> None:
    """Allow four rounding errors, and the error `least`."""
    with mpmath.workdps(400):
        wanted = float(SLOPES[name](mpmath.mpf(x)))
    lost = LOST[name](x) if name in LOST else 0.0
    limit = (4.0 + lost) * float(np.spacing(abs(wanted))) + least
    assert slope == wanted or abs(slope - wanted) <= limit, (name, x, slope, wanted)


def test_every_function_has_a_slope_or_jumps() -> None:
    assert set(SLOPES) | JUMPS | {"sign"} >= set(ARGUMENTS)
    assert set(SLOPES) <= set(ARGUMENTS)


@pytest.mark.parametrize("name", SLOPES)
def test_slope_by_dual_numbers(name: str) -> None:
    tape = recorded(lambda t, w: [getattr(np, name)(w[0]), 0.0 * t, 0.0 * t]).tape
    assert tape is not None
    both = with_derivatives(tape, [1])
    for x in points(name):
        value = getattr(np, name)(abs(x))
        least = 2.0 * float(np.spacing(value)) if name in DIFFERENCES else 0.0
        check(name, x, evaluate(both, [0.0, x, *[0.0] * 6], FLOATS)[3], least)


@pytest.mark.parametrize(
    ("name", "compiled"), [(name, each) for name in SLOPES for each in (False, True)]
)
def test_slope_in_the_kernel(name: str, compiled: bool, tmp_path: Path, monkeypatch: Patch) -> None:
    """Unknown 0 grows with the time; the function is the rate of unknown 1."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    tape = recorded_equation(lambda t, y: [0.0 * y[0] + 1.0, getattr(np, name)(y[0])], 2)
    array = kernel_tape(tape).copy()
    if compiled:
        address, how = leaf_cache.leaves_of(tape)
        assert (how == "compiled") == (name not in INTERPRETED)
        array[7:8].view(np.int64)[:] = address
    for x in points(name, 1e-20):
        h = 1e-3 * min(1.0, abs(x), abs(1.0 - abs(x)) or 1.0)
        step = taylor_step(array, 0.0, np.array([x, 0.0]), np.full(2, 1e300), 1e-6, h, h)
        value, wanted = float(step.terms[1, 1]) / step.h, float(getattr(np, name)(x))
        assert abs(value - wanted) <= 4.0 * np.spacing(abs(wanted)), (x, value, wanted)
        # The term may be subnormal.
        least = 2e-323 / step.h / step.h + (float(np.spacing(wanted)) if name == "cosh" else 0.0)
        check(name, x, 2.0 * float(step.terms[2, 1]) / step.h / step.h, least)
