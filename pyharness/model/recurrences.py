"""Recurrences, slopes and rounding errors of recorded operations, as C code.

The interpreter (fortran/make_cases.py) and compiled code (`engine/system/leaves.py`) use them.
"""

import math
from typing import NamedTuple

from pyharness.model.codes import Operations


class Operation(NamedTuple):
    """An operation's recurrence for Taylor series, and its partial derivatives (slopes), as C."""

    # o, p and q are results, x and y operands. Of o, for example, t_o is term k of the series (l_o
    # for a table), b_o term k - 1, z_o term 0, f_o term 1, and m_o the value at a node. i is 1/k.
    # s0 and s1 sum products of terms 1 to k - 1 of the two series in pairs[0] and pairs[1].
    series: tuple[str, ...]
    pairs: tuple[str, ...] = ()
    value: str = ""  # of o at a node; if empty, the series is summed
    slopes: tuple[str, ...] = ()  # derivatives of o with respect to x and y
    second: str = ""  # derivative of p with respect to x, if another operation may read p
    first: str = ""  # z_o, if `value` does not give it; without both, the interpreter computes it
    # Rounding error of the operation alone, in units of 2**-53. The errors of the operands, times
    # the absolute slopes, are added.
    rounding: str = "2.0*size(z_o)"
    # z_o from the numbers x and y, if it is a function of C's library. `saturates` says that other
    # numbers may replace exponentials in y.
    function: str = ""


_WITH_DERIVATIVE = Operation(("t_p = k*t_x", "t_o = i*(s0 + t_p*z_y)"), ("py",), slopes=("m_y",))
_SINE = Operation(
    ("t_q = k*t_x", "t_o = i*(s0 + t_q*z_p)", "t_p = -i*(s1 + t_q*z_o)"), ("qp", "qo"),
    slopes=("m_p",), second="-m_o", rounding="2.0",
)  # fmt: skip
WAVE = 0  # the kind of SINE_COSINE of an angle proportional to time
OPERATIONS = {
    Operations.PRODUCT: Operation(
        ("t_o = s0 + z_x*t_y + z_y*t_x",), ("xy",), "m_x*m_y", ("m_y", "m_x"),
        rounding="size(z_o)",
    ),
    Operations.QUOTIENT: Operation(
        ("t_o = (t_x - s0 - t_y*z_o)/z_y",), ("yo",), "m_x/m_y", ("1.0/m_y", "-m_o/m_y"),
        rounding="size(z_o)",
    ),
    # A root of 0, such as a norm at rest, is constant: its terms would be 0/0.
    Operations.SQRT: Operation(
        ("t_o = halved(t_x - s0, z_o)",), ("oo",), slopes=("slope_of_root(m_o)",),
        first="root_of(z_x)", rounding="size(z_o)",
    ),
    # Term 0 of the second slot says that the exponential is constant.
    Operations.EXP: Operation(
        ("t_p = z_p ? 0.0 : k*t_x", "t_o = i*(s0 + t_p*z_o)"), ("po",), slopes=("m_o",)
    ),
    Operations.TANH: Operation(
        ("t_q = k*t_x", "t_o = i*(s0 + t_q*z_p)", "t_p = -s1 - 2.0*t_o*z_o"), ("qp", "oo"),
        slopes=("m_p",),
    ),
    Operations.SINE_COSINE: _SINE,
    WAVE: _SINE._replace(
        series=("t_q = k*t_x", "t_o = i*f_x*b_p", "t_p = -i*f_x*b_o"), pairs=()
    ),
    Operations.TABLE: Operation(("t_o = l_o",)),
    **{
        getattr(Operations, name.upper()): _WITH_DERIVATIVE._replace(function=f"{name}(x)")
        for name in (
            "log", "log1p", "log2", "log10", "atan", "asin", "acos", "asinh", "acosh", "atanh",
            "cbrt",
        )
    },
    # Operand y is the exponential, or ln 2 times it.
    Operations.EXPM1: Operation(
        ("t_o = t_y",), slopes=("m_y",), function="x > 40.0 ? y : expm1(x)"
    ),
    Operations.EXP2: Operation(
        (f"t_o = {1.0 / math.log(2.0)!r}*t_y",), slopes=("m_y",),
        function=f"saturates ? {1.0 / math.log(2.0)!r}*y : exp2(x)",
    ),
}  # fmt: skip


def n_results(kind: int) -> int:
    """Return the number of an operation's results, each of which has a series."""
    written = [line[2] for line in OPERATIONS[kind].series] if kind in OPERATIONS else ["o"]
    return max(map("opq".index, written)) + 1
