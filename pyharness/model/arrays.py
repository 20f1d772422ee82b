"""What is given for many bodies, as arrays: checked once, the first bad row named."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pyharness.model.errors import InputError, kind_of
from pyharness.model.trajectory import Array
from pyharness.model.values import number

_REAL = "iuf"
# A test, and what it allows.
Rule = tuple[Callable[[Array], NDArray[np.bool_]], str]

above_zero: Rule = (
    lambda x: np.isfinite(x) & (x > 0.0), "a finite number above 0",
)  # fmt: skip
is_finite: Rule = np.isfinite, "finite numbers"
from_zero: Rule = (lambda x: x >= 0.0, "a number from 0")


def rows(where: str, values: object, width: int, rule: Rule) -> Array:
    """Return an array of shape (width,) or (n, width), or of () or (n,), of what a rule allows.

    InputError, which begins with `where` and the number of a row, for anything else.
    """
    found = _real(where, values)
    if found.ndim > (width > 1) + 1 or (width > 1 and found.shape[-1:] != (width,)):
        shapes = "(3,) or (n, 3)" if width > 1 else "one number or (n,)"
        shape = "one number" if found.ndim == 0 else f"of shape {found.shape}"
        raise InputError(f"{where} is {shape}; allowed: {shapes}")
    holds, allowed = rule
    good = holds(found)
    if not good.all():
        place = np.unravel_index(int(np.argmin(good)), found.shape)
        index = "".join(f"[{each}]" for each in place)
        raise InputError(f"{where}{index} is {found[place]:g}; allowed: {allowed}")
    return found


def _real(where: str, values: object) -> Array:
    try:
        found = np.asarray(values)
    except Exception as error:  # rows of different lengths, or a class of the user's
        raise InputError(f"{where}: {kind_of(values)} that is no array of numbers") from error
    if found.dtype.kind == "O":
        # Fractions, decimals, whole numbers beyond 64 bits; what is no number says so.
        floats = [number(where, each) for each in found.flat]
        return np.array(floats).reshape(found.shape)
    if found.dtype.kind not in _REAL:
        first = found.flat[0] if found.size else values
        raise InputError(f"{where}: {kind_of(first)} where a number belongs")
    with np.errstate(over="ignore"):
        return np.array(found, dtype=np.float64)


def one_count(inputs: dict[str, Array]) -> int:
    """Return the number of bodies; InputError where arrays have not as many rows."""
    widths = {"step_size": 1, "lipschitz": 1}
    counts = {
        name: len(each)
        for name, each in inputs.items()
        if each.ndim == 2 or (each.ndim == 1 and name in widths)
    }
    if len(set(counts.values())) > 1:
        said = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise InputError(f"the arrays have not as many rows: {said}")
    return next(iter(counts.values()), 1)


def spread(values: Array, n: int, width: int) -> Array:
    """Return an array with a row for each body, in one piece."""
    return np.ascontiguousarray(np.broadcast_to(values, (n, width) if width > 1 else (n,)))
