"""Floating-point exceptions in the compiled entries: an answer must report each of them.

A kernel that overflows, or exceeds its work limit on numbers too large, reports it by its status.
An infinite quotient of the stop test is returned. If a call raises the flag invalid, divide-by-zero
or overflow, and its answer does not report this, it is called again with traps. They end the
process at the place of the exception. Since the first call runs without traps, tests that overflow
need no mark.
"""

import ctypes
import ctypes.util
import faulthandler
import functools
import platform
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from pyharness.engine.plan.plan import RK4_OR_TAYLOR
from pyharness.engine.prepared.solver import CODES as _CODES
from pyharness.model.codes import Methods, Operations, Places, Statuses
from pyharness.model.extension import GAVE_UP, OVERFLOW, SENSITIVE

_ON_ARM = platform.machine().lower() in ("arm64", "aarch64")
INVALID = 1
DIVIDE = 2 if _ON_ARM else 4
TOO_LARGE = 4 if _ON_ARM else 8
_TRAPPED = INVALID | DIVIDE | TOO_LARGE
_TRIES_AGAIN = (_CODES[RK4_OR_TAYLOR], _CODES["quick"])
_EXTREME = 1e60  # its fifth power overflows, and the fifth power of its inverse underflows
# Bodies in a batch share the flags of a processor, so that no answer can report its own. Their bits
# are those of single runs, which are guarded. Methods without branches compute both sides of a
# choice, and leave uncertain results to a single solution. Answers in other words are bytes; those
# in binary64 come from the guarded entry.
_UNGUARDED = (
    "run_programs", "solve_ensemble", "solve_many_rows", "solve_packed_many", "turn_rows",
    "run_program_in_word", "functions_of_word",
)  # fmt: skip
_NAMES = {INVALID: "invalid", DIVIDE: "divide by zero", TOO_LARGE: "overflow"}


class UntoldException(AssertionError):
    """The error if an answer does not report an exception, and traps did not end the process."""


def guard(module: ModuleType) -> int:
    """Put a guard before every compiled entry of an extension; return their number."""
    _print_places(module)
    count = 0
    for name in dir(module):
        entry = getattr(module, name)
        if type(entry).__name__ == "fortran" and callable(entry) and name not in _UNGUARDED:
            setattr(module, name, guarded(name, entry))
            count += 1
    return count


def guarded(name: str, entry: Callable[..., Any]) -> Callable[..., Any]:
    """Return an entry that raises nothing unreported."""
    results = (entry.__doc__ or "").partition(" = ")[0].split(",")
    library = _mathematics()

    def call(*args: Any, **named: Any) -> Any:
        library.feclearexcept(_TRAPPED)
        answer = entry(*args, **named)
        raised = library.fetestexcept(_TRAPPED)
        if not raised:
            return answer
        found = dict(zip(results, answer if isinstance(answer, tuple) else (answer,), strict=True))
        if np.ndim(found.get("status", 0)):
            # Bodies in a batch share the flags of a processor; one that is refused may raise them.
            if np.any(found["status"]):
                return answer
            found["status"] = 0
        packed = name in ("solve_packed", "solve_packed_attitude")
        method = args[0][Places.METHOD] if packed else None
        is_tape = name in ("tape_rows", "tape_step", "tape_derivatives") or method == Methods.TAPE
        # A tape has integers in the places of numbers.
        numbers = args[1:] if is_tape else args
        has_infinity = bool(raised & TOO_LARGE) or not _finite((*numbers, *named.values()))
        if is_tape and (
            found["status"] in (OVERFLOW, Statuses.STALLED) or _has_roots(args[0], packed)
        ):
            # The torque that the user wrote may be singular, as 1/0 is, and steps over a zero of a
            # root's argument compute the torque beyond it.
            has_infinity = True
        if is_tape or (name == "solve_packed" and method in _TRIES_AGAIN):
            # An attempt with too long steps may overflow; shorter steps or the series then follow.
            found["status"] = OVERFLOW
        untold = raised & ~_told(found, has_infinity)
        if not untold or _are_extreme((*numbers, found.get("rows", 0.0))):
            return answer
        words = ", ".join(word for bit, word in _NAMES.items() if untold & bit)
        print(f"\n{name}: {words}, untold; again with traps: {args}", file=sys.stderr)
        faulthandler.dump_traceback()
        if hasattr(library, "feenableexcept"):
            library.feclearexcept(_TRAPPED)
            library.feenableexcept(untold)
            try:
                entry(*args, **named)
            finally:
                library.fedisableexcept(_TRAPPED)
        raise UntoldException(f"{name}: {words}")

    return functools.wraps(entry, assigned=("__doc__",), updated=())(call)


def _has_roots(numbers: np.ndarray, is_packed: bool) -> bool:
    """Return whether a tape has operations that are undefined at some arguments."""
    tape = numbers[Places.WAVES :] if is_packed else numbers
    operations = tape[8 : 8 + 2 * int(tape[2])].view(np.int32)[::4]
    return not set(operations).isdisjoint((Operations.SQRT, Operations.LOG, Operations.QUOTIENT))


def _told(found: dict[str, Any], has_infinity: bool) -> int:
    """Return the exceptions that an answer reports."""
    told = 0
    if found.get("status") in (OVERFLOW, GAVE_UP) and has_infinity:
        # Infinity minus infinity is invalid, and a step of one over infinity is zero; neither is
        # reported by itself.
        told |= _TRAPPED
    if found.get("status") == SENSITIVE and has_infinity:
        # A perturbation, and the error propagated with it, overflowed.
        told |= _TRAPPED
    if np.isinf(found.get("stop_quotient", 0.0)):
        told |= DIVIDE
    # A velocity that overflows does not end a run, and is returned as it is.
    velocity = found["rows"][5:, : found["n_rows"]] if "ier_rows" in found else np.zeros(1)
    if has_infinity and not np.isfinite(velocity).all():
        told |= _TRAPPED
    return told


def _finite(args: tuple[Any, ...]) -> bool:
    return all(np.isfinite(np.asarray(each, dtype=float)).all() for each in args)


def _are_extreme(args: tuple[Any, ...]) -> bool:
    """Whether products of the numbers leave the range, which other tests check."""
    for each in args:
        sizes = np.abs(np.asarray(each, dtype=float))
        sizes = sizes[sizes > 0.0]  # NaN has no size
        if sizes.max(initial=1.0) > _EXTREME or sizes.min(initial=1.0) < 1.0 / _EXTREME:
            return True
    return False


@functools.cache
def _mathematics() -> ctypes.CDLL:
    return ctypes.CDLL(ctypes.util.find_library("m"))


def _print_places(module: ModuleType) -> None:
    """Let the Fortran library, if the extension has one, print the lines that led to a trap."""
    library = ctypes.CDLL(module.__file__ or "")
    if hasattr(library, "_gfortran_set_options"):
        # Four options as gfortran's own main programs pass them; the last enables the backtrace.
        library._gfortran_set_options(4, (ctypes.c_int * 4)(68, 8191, 0, 1))
