"""A prepared solver as a function for compiled code; checks of arguments that C code refused."""

import math
import reprlib
from ctypes import PYFUNCTYPE, c_double, c_int, c_void_p
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pyharness.model.attitude import IDENTITY, unit_quaternion
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.values import number, three_floats


class CompiledCall(NamedTuple):
    """A prepared solver as a function for compiled code.

    ``function(data, start, t_end, state)`` reads doubles at the address `start`: omega (rad/s), and
    for an attitude solver a unit quaternion. It writes the state at `t_end` (s) to `state`, and
    returns a status of `pyharness.h`, 0 if complete. `data` is valid while `solver` exists.
    """

    function: Any
    data: int
    solver: object


def compiled_call(solver: Any) -> CompiledCall:
    from pyharness import _solver

    # PYFUNCTYPE, unlike CFUNCTYPE, raises KeyboardInterrupt after Ctrl-C if Python code calls it.
    prototype = PYFUNCTYPE(c_int, c_void_p, c_void_p, c_double, c_void_p)
    return CompiledCall(prototype(_solver.SOLVE_AT), solver._address, solver)


def get_include() -> str:
    """Return the folder of `pyharness.h`, the header for C code that calls solvers of `prepare`.

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
    return str(Path(__file__).parents[2] / "include")


def check_call(
    scene: Scene, with_attitude: bool, omega0: object, t_end: object, third: object
) -> tuple[tuple[float, ...], float]:
    """Return the checked initial state and `t_end` (s) of a call that the C code refused.

    `third` is the attitude or `out`.
    """
    start, time = three_floats("omega", omega0), number("t_end", t_end)
    if scene.changing is not None and math.isfinite(time):
        scene.changing.check([time])
    if with_attitude:
        usual = scene.attitude or IDENTITY
        return (*start, *(usual if third is None else unit_quaternion("attitude", third)[0])), time
    if third is not None and (found := _no_buffer(third)):
        raise InputError(f"out: {found}; allowed: a writable array of three float64 side by side")
    return start, time


def _no_buffer(out: object) -> str:
    """Return "" if three floats can be written into `out`, else a description of it."""
    if not isinstance(out, np.ndarray):
        try:
            return reprlib.repr(out)
        except ValueError:  # Python refuses to print an integer of too many digits
            return "a number of too many digits to be shown"
    flags = out.flags
    if out.dtype.char != "d" or not out.dtype.isnative or out.shape != (3,):
        return f"{out.dtype} of shape {out.shape}"
    if not flags.writeable:
        return "an array that is read-only"
    return "" if flags.c_contiguous and flags.aligned else f"an array with strides {out.strides}"
