"""Recorded functions have NumPy's values, in every arithmetic, and the derivatives of mpmath.

The functions are those of the tables that record them, so that each needs samples here.
"""

import math
from decimal import Decimal, localcontext
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from pyharness import InputError, Scene, opaque, solve, solve_many
from pyharness.engine.steps.taylor_ivp import recorded_equation
from pyharness.engine.system import leaf_cache
from pyharness.engine.system.leaf_text import structure
from pyharness.engine.system.recorded import kernel_tape, listing, outputs_at, taylor_step
from pyharness.model.codes import Operations
from pyharness.model.dual import with_derivatives
from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.numpy_calls import OF_MATH
from pyharness.model.numpy_protocol import ELEMENTS
from pyharness.model.recurrences import OPERATIONS
from pyharness.model.state_torque import StateTorque, recorded, replayed
from pyharness.model.symbols import SYMBOLS
from pyharness.model.tape import FLOATS, TIME, evaluate, float_outputs
from pyharness.truth.decimal_functions import ELEMENTARY
from pyharness.truth.tape_series import TapeSeries

REST = (1.0, 0.0, 0.0, 0.0)
TINY = (0.0, 5e-324, 1e-310, 1e-300, 1e-160, 1e-20, 1e-10, 1e-5)
UNIT = (0.01, 0.3, 0.5, 0.49999999999999994, 0.9, 1 - 1e-6, 1 - 1e-12)
WHOLE = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 7.3, 8.0, 12.0, 29.5, 100.5)
LARGE = (1000.0, 2.0**29, 1e5 + 0.5, 2.0**51 + 0.5, 2.0**52 + 1, 1e16, 1e100, 1e150)
HUGE = (1e160, 1e200, 1e300)


def signed(*values: float) -> list[float]:
    return [sign * x for x in values for sign in (1.0, -1.0)]


REAL = signed(*TINY, *UNIT, *WHOLE, *LARGE, *HUGE)
BEYOND_1 = [1 + 1e-12, 1 + 1e-6, 1.01, *WHOLE, *LARGE, *HUGE]
EXPONENTS = signed(*TINY, *UNIT, *WHOLE, 300.0, 700.0)
ARGUMENTS: dict[str, list[float]] = dict.fromkeys((
    "rint", "floor", "ceil", "trunc", "sign", "fabs", "tanh", "arctan", "arcsinh", "cbrt",
    "sin", "cos", "tan", "radians", "degrees", "deg2rad", "rad2deg", "conjugate", "negative",
    "positive", "absolute",
), REAL) | {
    "square": signed(*TINY, *UNIT, *WHOLE, *LARGE),
    "sqrt": [*TINY, *UNIT, *WHOLE, *LARGE, *HUGE],
    "reciprocal": signed(*TINY[3:], *UNIT, *WHOLE, *LARGE),
    **{name: [*TINY[1:], *UNIT, *BEYOND_1] for name in ("log", "log2", "log10")},
    "log1p": [*TINY, *UNIT, *BEYOND_1, *(-x for x in (*TINY, *UNIT))],
    **dict.fromkeys(("arcsin", "arccos"), signed(*TINY, *UNIT, 1.0)),
    "arctanh": signed(*TINY, *UNIT),
    "arccosh": [1.0, *BEYOND_1],
    **dict.fromkeys(("exp", "expm1", "exp2", "sinh", "cosh"), EXPONENTS),
}  # fmt: skip
SOME = signed(1e-300, 1e-20, 0.3, 0.5, 1.0, 2.5, 29.5, 1e10, 1e100)
Pairs = list[tuple[float, ...]]
PAIRS: Pairs = [(x, y) for x in SOME for y in SOME]
# Their squares neither overflow nor underflow.
MODERATE: Pairs = [pair for pair in PAIRS if all(1e-20 <= abs(x) < 1e11 for x in pair)]
POWERS: Pairs = [(x, y) for x in (1e-20, 0.3, 2.5, 1e10) for y in signed(0.3, 0.5, 1, 3, 7.25)]
OPERANDS: dict[str, Pairs] = {
    **dict.fromkeys(("add", "subtract", "copysign", "heaviside"), PAIRS),
    **dict.fromkeys(("maximum", "minimum", "fmax", "fmin"), PAIRS),
    **dict.fromkeys(("hypot", "arctan2", "multiply", "divide"), MODERATE),
    **dict.fromkeys(("fmod", "remainder", "floor_divide"), MODERATE),
    **dict.fromkeys(("power", "float_power"), POWERS),
    "clip": [(x, -0.5, 1.0) for x in SOME],
}
CHOICES = {
    "less", "less_equal", "greater", "greater_equal", "invert", "logical_not", "logical_and",
    "logical_or", "logical_xor", "bitwise_and", "bitwise_or", "bitwise_xor",
}  # fmt: skip
REFUSED = {"equal", "not_equal"}
# Functions of NumPy that Python's operators on symbols compute.
OPERATORS = {
    "add", "subtract", "multiply", "divide", "negative", "positive", "absolute", "power",
    "remainder", "floor_divide", "reciprocal", "bitwise_and", "bitwise_or", "bitwise_xor",
}  # fmt: skip
NAMES = OPERATORS | set(ELEMENTS)
# The documented difference (docs/how-to/torques.md), also at -0.0.
OTHERWISE: dict[tuple[str, tuple[float, ...]], float] = {("sign", (0.0,)): -1.0}


def test_every_function_and_every_operation_has_samples() -> None:
    assert {*ARGUMENTS, *OPERANDS, *CHOICES, *REFUSED} == NAMES
    assert {each.__name__ for each in OF_MATH.values()} <= NAMES
    assert {each.of_numpy for each in WITH_DERIVATIVE.values()} <= set(ARGUMENTS)
    codes = {code for code, operation in OPERATIONS.items() if operation.function}
    assert codes == {getattr(Operations, kind.upper()) for kind in WITH_DERIVATIVE}
    assert set(ELEMENTARY) == set(SYMBOLS.elementary) == set(FLOATS.elementary) == set(SERIES)


def allowed(name: str, given: tuple[float, ...], wanted: float) -> float:
    """Return four rounding errors of the result and, of some functions, of an argument."""
    found = 4.0 * float(np.spacing(abs(wanted)))
    eps = float(np.finfo(float).eps)
    if name in ("power", "float_power"):
        return found + 2.0 * eps * abs(wanted * given[1] * math.log(given[0]))
    if name in ("remainder", "fmod"):
        return found + eps * (abs(given[0]) + abs(given[1]))
    return found


def samples(name: str) -> list[tuple[float, ...]]:
    return OPERANDS.get(name) or [(x,) for x in ARGUMENTS[name]]


def quotient_is_whole(name: str, given: tuple[float, ...]) -> bool:
    """Whether a rounding error decides on which side of a jump the function is."""
    if name not in ("remainder", "fmod", "floor_divide"):
        return False
    quotient = given[0] / given[1]
    return abs(quotient - round(quotient)) <= 1e-15 * abs(quotient)


@pytest.mark.parametrize("name", sorted({*ARGUMENTS, *OPERANDS}))
def test_value_is_that_of_numpy(name: str) -> None:
    function = getattr(np, name)
    count = len(samples(name)[0])
    tape: Any = recorded(lambda t, w: [function(*w[:count]), 0.0 * t, 0.0 * t]).tape
    checked = 0
    for given in samples(name):
        with np.errstate(all="ignore"):
            wanted = OTHERWISE.get((name, given), float(function(*given)))
        if quotient_is_whole(name, given):
            continue
        inputs = [0.0, *given, *[0.0] * (7 - count)]
        state = np.array([inputs[1:]])
        for value in (float_outputs(tape, inputs)[0], outputs_at(tape, np.zeros(1), state)[0, 0]):
            close = abs(value - wanted) <= allowed(name, given, wanted)
            assert value == wanted or close, (given, value, wanted)
        checked += 1
    assert checked > 8


@pytest.mark.parametrize("name", sorted(CHOICES))
def test_choice_is_that_of_numpy(name: str) -> None:
    function = getattr(np, name)
    conditions = name.startswith(("logical", "bitwise", "inv"))

    def torque(t: Any, w: Any) -> Any:
        given = [w[0] > 0.5, w[1] > 0.5] if conditions else [w[0], w[1]]
        return [np.where(function(*given[: function.nin]), 1.0, 0.0), 0.0 * t, 0.0 * t]

    tape = recorded(torque)
    for omega in ((0.3, 0.7, 0.0), (0.7, 0.3, 0.0), (0.7, 0.7, 0.0), (0.3, 0.3, 0.0)):
        assert tape.at(0.0, omega, REST)[0] == float(torque(0.0, np.array(omega))[0])


# Where derivatives are infinite.
SINGULAR = {
    "arccosh": (1.0,), "arcsin": (1.0, -1.0), "arccos": (1.0, -1.0), "sqrt": (0.0,), "cbrt": (0.0,),
}  # fmt: skip
JUMPS = {"rint", "floor", "ceil", "trunc", "fmod", "remainder", "floor_divide"}


# Functions of several arguments without switches; test_function_slopes.py compiles the others.
COMPILED = ("add", "subtract", "multiply", "divide", "hypot", "power", "float_power")


@pytest.mark.parametrize(
    ("name", "compiled"),
    [(name, False) for name in sorted({*ARGUMENTS, *OPERANDS})]
    + [(name, True) for name in COMPILED],
)
def test_value_in_the_kernel_is_that_of_numpy(
    name: str, compiled: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The value is the rate of an unknown, where the others, which are constant, are operands."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    function, n = getattr(np, name), len(samples(name)[0])
    given: tuple[float, ...]
    tape = recorded_equation(lambda t, y: [*(0.0 * y[:n]), function(*y[:n])], n + 1)
    array = kernel_tape(tape).copy()
    if compiled:
        address, how = leaf_cache.leaves_of(tape)
        assert how == "compiled"
        array[7:8].view(np.int64)[:] = address
    else:
        assert name in (*ARGUMENTS, *COMPILED) or structure(listing(tape)) is None
    for given in samples(name):
        # Beyond, derivatives overflow, and rounding errors decide on which side of a jump it is.
        sizes = [abs(x) for x in given if x]
        largest = 1e5 if name in JUMPS else 1e150
        if any(not 1e-20 <= x <= largest for x in sizes) or given[0] in SINGULAR.get(name, ()):
            continue
        if quotient_is_whole(name, given):
            continue
        wanted = OTHERWISE.get((name, given), float(function(*given)))
        start, allowed_errors = np.array([*given, 0.0]), np.full(n + 1, 1e300)
        step = taylor_step(array, 0.0, start, allowed_errors, 1e-6, 1.0, 1.0)
        value = float(step.terms[1, n]) / step.h
        assert value == wanted or abs(value - wanted) <= allowed(name, given, wanted), given


# An argument of each function, and others near its singularities or where formulas lose digits.
SERIES: dict[str, tuple[float, ...]] = {
    "log": (0.7, 1.0 + 1e-9, 30.0), "log1p": (0.7, 1e-9, -1e-9, -0.9),
    "log2": (0.7, 1.0 + 1e-9, 1024.0), "log10": (0.7, 1.0 + 1e-9, 1000.0),
    "atan": (0.7, 1e-9, -20.0), "asin": (0.7, 1e-9, -0.7, 1.0 - 1e-9),
    "acos": (0.7, 1e-9, -0.7, 1.0 - 1e-9), "asinh": (0.7, 1e-9, -1e5, 1e5),
    "acosh": (1.7, 1.0 + 1e-9, 1e5), "atanh": (0.7, 1e-9, -0.7, 1.0 - 1e-9),
    "cbrt": (0.7, 1e-9, 1e9), "expm1": (0.7, 1e-9, -1e-9, -40.0, 50.0),
    "exp2": (0.7, 1e-9, -40.5, 500.5),
}  # fmt: skip
POINTS = [(kind, x) for kind, each in SERIES.items() for x in each]


def of_kind(kind: str) -> StateTorque:
    return replayed(lambda t, w, q: [SYMBOLS.elementary[kind](t), 0.0 * t, 0.0 * t])


def terms_of(kind: str, x: float, count: int) -> list[Any]:
    """Return Taylor coefficients by mpmath, with 60 digits."""
    found: list[Any] = mpmath.taylor(getattr(mpmath, kind), mpmath.mpf(x), count)
    return found


@pytest.mark.parametrize(("kind", "x"), POINTS)
def test_series_and_derivative_are_those_of_mpmath(kind: str, x: float) -> None:
    tape: Any = of_kind(kind).tape
    with mpmath.workdps(200):
        wanted = terms_of(kind, x, 6)
    # The reference.
    with localcontext(prec=40), mpmath.workdps(50):
        series = TapeSeries(tape)
        nothing = [[Decimal(0)] * 8 for _ in range(7)]
        series.begin(Decimal(x), nothing[:3], nothing[3:])
        for term in wanted:
            assert abs(mpmath.mpf(str(series.next()[0])) - term) <= 1e-25 * abs(term)
    # The derivative in floats.
    value, slope = evaluate(with_derivatives(tape, [TIME]), [x, *[0.0] * 7], FLOATS)[::3]
    assert value == pytest.approx(float(wanted[0]), rel=1e-15)
    # Its exponential has the rounding error of a product.
    lost = {"exp2": abs(x), "cbrt": abs(math.log(abs(x)))}.get(kind, 0.0)
    assert slope == pytest.approx(float(wanted[1]), rel=1e-15 + 1e-16 * lost)
    # The kernel, whose terms are those of the integral, times powers of the step.
    equation = recorded_equation(lambda t, y: [SYMBOLS.elementary[kind](t)], 1)
    h = 1e-3 * min(1.0, abs(x), abs(1.0 - abs(x)) or 1.0)
    step = taylor_step(kernel_tape(equation), x, np.zeros(1), np.full(1, 1e300), 1e-6, h, h)
    scale = abs(float(wanted[0])) + abs(float(wanted[1])) * h
    for k, term in enumerate(wanted):
        exact = float(term) * step.h ** (k + 1) / (k + 1)
        assert step.terms[k + 1, 0] == pytest.approx(exact, rel=1e-12, abs=1e-17 * h * scale)


@pytest.mark.parametrize(("kind", "x"), POINTS)
def test_enclosure_contains_the_value(kind: str, x: float) -> None:
    flint = pytest.importorskip("flint")
    from pyharness.truth.balls import functions_at

    function = functions_at(Fraction(0), True).elementary[kind]
    if kind in ("atan", "asin", "acos", "cbrt"):
        with pytest.raises(InputError, match="no enclosure"):
            function(flint.arb(x))
        return
    with flint.ctx.workprec(200), mpmath.workdps(80):
        found, (wanted,) = function(flint.arb(x)), terms_of(kind, x, 0)
        assert found.overlaps(flint.arb(mpmath.nstr(wanted, 75)))
        assert found.rad() < 1e-40 * max(1.0, abs(float(wanted)))


# Torques -f(omega) of a sphere, and omega with its inverse: exact solutions, from mpmath.
SMALL: dict[str, Any] = {
    "sinh": (np.sinh, lambda t, w: 2 * mpmath.atanh(mpmath.exp(-t) * mpmath.tanh(w / 2))),
    "expm1": (np.expm1, lambda t, w: -mpmath.log1p(mpmath.expm1(-w) * mpmath.exp(-t))),
    "arcsinh": (np.arcsinh, None),
    "arctanh": (np.arctanh, None),
    "log1p": (np.log1p, None),
}


@pytest.mark.parametrize("name", SMALL)
def test_small_motion_has_all_digits(name: str) -> None:
    function, exact = SMALL[name]
    omega = np.array([1e-11, -3e-12, 2e-12])
    scene = Scene("", omega, moments=(1, 1, 1), torque=lambda t, w: -function(w))
    found: Any = solve(scene, 1.0, tolerance=1e-12)
    other = solve(
        Scene("", omega, moments=(1, 1, 1), torque=opaque(lambda t, w: -function(w))),
        1.0, "dop853", 1e-12,
    )  # fmt: skip
    many = solve_many(scene, 1.0, omega=np.tile(omega, (9, 1)), tolerance=1e-12)
    assert found.ended == "complete"
    assert found.error < 1e-12
    assert found.omega[0] == pytest.approx(other.omega[0], rel=1e-11)
    assert many.omega[8] == pytest.approx(found.omega[0], rel=1e-12)
    if exact:
        with mpmath.workdps(40):
            wanted = [float(exact(1, mpmath.mpf(w))) for w in omega]
        assert found.omega[0] == pytest.approx(wanted, rel=1e-12)
