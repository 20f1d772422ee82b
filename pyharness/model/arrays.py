"""Checks of arrays for many bodies, with a row for each body or one row for all."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Array
from pyharness.model.errors import InputError, kind_of
from pyharness.model.values import integer, number, unit_of

_MOST_THREADS = 1024
_REAL = "iuf"
# A test of each number of an array, and a phrase for the allowed numbers.
Rule = tuple[Callable[[Array], NDArray[np.bool_]], str]

ABOVE_ZERO: Rule = (
    lambda x: np.isfinite(x) & (x > 0.0), "a finite number above 0",
)  # fmt: skip
FINITE: Rule = np.isfinite, "finite numbers"
FROM_ZERO: Rule = (lambda x: x >= 0.0, "a number from 0")


def rows_of(where: str, values: object, *shape: int | str, rule: Rule | None = None) -> Array:
    """Return a user's array, of `shape` or (n, *shape), as floats of shape (n, *shape).

    A letter in `shape` means any length.
    """
    if type(values) is float and not shape and rule is None:
        return np.array([values])
    found = numbers_of(where, values)
    own = found.shape[-len(shape) :] if shape else ()
    spare = found.ndim - len(shape)
    if spare not in (0, 1) or (own != shape and not _fits(own, shape)):
        one, many = ", ".join(map(str, shape)), ", ".join(map(str, ("n", *shape)))
        allowed = f"({one}{',' * (len(shape) == 1)}) or ({many})" if shape else "one number or (n,)"
        raise InputError(f"{where}: shape {found.shape}; allowed: {allowed}")
    if rule is not None:
        _check_rule(where, found, rule)
    if spare and found.flags.c_contiguous:
        return found
    return np.ascontiguousarray(found.reshape(-1, *own))


def numbers_of(where: str, values: object) -> Array:
    if type(values) is not np.ndarray:
        if unit_of(values) or isinstance(values, (bytes, bytearray)):
            number(where, values)  # NumPy would drop the unit, or read bytes as numbers
        if hasattr(values, "filled"):  # a masked array: its masked numbers are missing
            values = np.where(values.mask, np.nan, values.data)  # type: ignore[attr-defined]
    try:
        found = np.asarray(values)
    except Exception as error:  # rows of different lengths, or a user-defined class
        raise InputError(
            f"{where}: {kind_of(values)} that is not an array of numbers; allowed: rows of "
            "equal length"
        ) from error
    if found.dtype == np.float64:
        return found
    if found.dtype.kind == "O":
        floats = [number(where, each) for each in found.flat]
        return np.array(floats).reshape(found.shape)
    if found.dtype.kind not in _REAL:
        first = found.flat[0] if found.size else values
        raise InputError(f"{where}: {kind_of(first)} where a number belongs")
    with np.errstate(over="ignore"):
        return found.astype(np.float64, copy=False)


def count_bodies(rows: Mapping[str, Array]) -> int:
    counts = {len(each) for each in rows.values()}
    n = 0 if 0 in counts else max(counts, default=1)
    if not counts <= {1, n}:
        # A wrong number of final times must not count as the number of bodies.
        others = [len(each) for name, each in rows.items() if name != "t_end"]
        n = max(others) if n else 0
        for name, each in rows.items():
            check_rows(name, each, n)
    return n


def check_rows(name: str, array: Array, n: int) -> None:
    if len(array) not in (1, n):
        several = "; for several times of each body use times= of solve_many"
        raise InputError(
            f"{name}: {len(array)} rows; allowed: 1, or {n}, the number of bodies"
            f"{several if name == 't_end' else ''}"
        )


def row_of(array: Array, i: int) -> Any:
    return array[0 if len(array) == 1 else i]


def only_one(given: Mapping[str, object]) -> str:
    """Return the name of the argument that is not None, or ""; raise InputError for two."""
    names = [name for name, value in given.items() if value is not None]
    if len(names) > 1:
        raise InputError(f"{' and '.join(names)} are both given; give one of them")
    return names[0] if names else ""


def threads_of(threads: object) -> int:
    found = integer("threads", threads)
    if not 1 <= found <= _MOST_THREADS:
        raise InputError(f"threads is {found}; allowed: 1 to {_MOST_THREADS}")
    return found


def buffer_of(where: str, array: Any, shape: tuple[int, ...], kind: str) -> Any:
    right = isinstance(array, np.ndarray) and array.shape == shape and array.dtype == kind
    if not (right and array.flags.c_contiguous and array.flags.writeable and array.flags.aligned):
        raise InputError(
            f"{where}: allowed: a writable array of {np.dtype(kind)}, shape {shape}, in one piece"
        )
    return array


def spread(rows: Array, n: int) -> Array:
    if len(rows) == n:
        return rows
    return np.ascontiguousarray(np.broadcast_to(rows, (n, *rows.shape[1:])))


def rows_within(rows: Array, piece: slice) -> Array:
    if len(rows) > 1:
        return rows[piece]
    return np.ascontiguousarray(np.broadcast_to(rows, (piece.stop - piece.start, *rows.shape[1:])))


def unit_quaternions(rows: Array) -> Array:
    """Return normalised quaternions, (n, 4); NaN where the norm is 0 or not finite."""
    with np.errstate(all="ignore"):
        found = rows / np.abs(rows).max(axis=1, keepdims=True)
        units: Array = found / np.sqrt((found * found).sum(axis=1, keepdims=True))
    return units


def _fits(own: tuple[int, ...], shape: tuple[int | str, ...]) -> bool:
    return all(isinstance(want, str) or have == want for have, want in zip(own, shape, strict=True))


def _check_rule(where: str, values: Array, rule: Rule) -> None:
    holds, allowed = rule
    good = holds(values)
    if not good.all():
        place = np.unravel_index(int(np.argmin(good)), values.shape)
        index = "".join(f"[{each}]" for each in place)
        raise InputError(f"{where}{index} is {values[place]:g}; allowed: {allowed}")
