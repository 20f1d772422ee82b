"""Torques that a compiled function of the user computes."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pyharness.model.errors import InputError, kind_of

SIGNATURE = "void (double, double *, double *, double *, void *)"
_ALLOWED = (
    "allowed: a scipy.LowLevelCallable, a function of ctypes or a cfunc of numba with the "
    f"signature {SIGNATURE}, for the time, omega, the attitude, the torque and the user's data"
)
_NUMBERS = ctypes.POINTER(ctypes.c_double)
_PROTOTYPE = ctypes.CFUNCTYPE(
    None, ctypes.c_double, _NUMBERS, _NUMBERS, _NUMBERS, ctypes.c_void_p
)  # fmt: skip
_CTYPES_FUNCTION: Any = _PROTOTYPE.__base__
# The flag of ctypes for functions that must hold the lock of the interpreter.
_PYTHON_API = 4


@dataclass(frozen=True)
class CompiledTorque:
    """A compiled function as the function of an opaque torque.

    Its addresses, or 0, are valid as long as `owner` exists.
    """

    address: int
    data: int
    owner: object = field(compare=False, repr=False)

    def __call__(self, time: float, omega: Any, attitude: Any = (np.nan,) * 4) -> list[float]:
        """Return the torque (N m) at `time` (s); the default attitude is NaN."""
        torque = _numbers([0.0] * 3)
        function = _PROTOTYPE(self.address)
        function(time, _numbers(omega), _numbers(attitude), torque, self.data or None)
        return list(torque)


def compiled_torque(function: Any) -> CompiledTorque | None:
    """Return a compiled function, or None; raise InputError for another signature."""
    from scipy import LowLevelCallable

    given = getattr(function, "ctypes", function)  # a cfunc of numba has this attribute
    if isinstance(given, _CTYPES_FUNCTION):
        if given.argtypes is None:
            raise InputError(f"[torque]: the function of ctypes has no argtypes; {_ALLOWED}")
        given = LowLevelCallable(given)
    if not isinstance(given, LowLevelCallable):
        return None
    signature = given.signature.replace("const ", "")
    if signature.replace(" ", "") != SIGNATURE.replace(" ", ""):
        raise InputError(f"[torque]: the compiled function is {signature}; {_ALLOWED}")
    if getattr(given.function, "_flags_", 0) & _PYTHON_API:
        raise InputError(
            f"[torque]: the compiled function is {kind_of(given.function)} that needs the lock of "
            "the interpreter; allowed: a function of CFUNCTYPE or CDLL"
        )
    # SciPy's C code finds the addresses in this capsule too (scipy/_lib/src/ccallback.h).
    capsule = tuple.__getitem__(given, 0)
    name = _api("PyCapsule_GetName", ctypes.c_char_p)(capsule)
    address = _api("PyCapsule_GetPointer", ctypes.c_void_p, ctypes.c_char_p)(capsule, name)
    data = _api("PyCapsule_GetContext", ctypes.c_void_p)(capsule)
    return CompiledTorque(address, data or 0, (function, given))


def _numbers(values: Sequence[float]) -> Any:
    return (ctypes.c_double * len(values))(*values)


def _api(name: str, result: Any, *arguments: Any) -> Any:
    """Return a function of Python's C interface."""
    return ctypes.PYFUNCTYPE(result, ctypes.py_object, *arguments)((name, ctypes.pythonapi))
