"""Calls of prepared solvers from compiled code, without Python."""

from ctypes import PYFUNCTYPE, c_double, c_int, c_void_p
from pathlib import Path
from typing import Any, NamedTuple


class CompiledCall(NamedTuple):
    """A prepared solver as a function for compiled code, such as numba's.

    ``function(data, start, t_end, state)`` reads doubles at the address `start`: omega (rad/s), and
    for an attitude solver a unit quaternion. It writes the state at `t_end` (s) to the address
    `state`, and returns a status of `pyharness.h`, 0 if complete. `data` is valid while `solver`
    exists.
    """

    function: Any
    data: int
    solver: object


def compiled_call(solver: Any) -> CompiledCall:
    """Return a prepared solver as a function for compiled code."""
    from pyharness import _solver

    # PYFUNCTYPE, unlike CFUNCTYPE, raises KeyboardInterrupt after Ctrl-C if Python code calls it.
    prototype = PYFUNCTYPE(c_int, c_void_p, c_void_p, c_double, c_void_p)
    return CompiledCall(prototype(_solver.SOLVE_AT), solver._address, solver)


def get_include() -> str:
    """Return the folder of `pyharness.h`, with which C code calls prepared solvers.

    Returns
    -------
    str
        The path of the folder, for a compiler's option ``-I``.

    Examples
    --------
    >>> from pathlib import Path
    >>> from pyharness import get_include
    >>> sorted(path.name for path in Path(get_include()).glob("*.h"))
    ['pyharness.h']
    """
    return str(Path(__file__).parent.parent / "include")
