"""The compiled extension, and the words that it and Python share."""

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.codes import Statuses
from pyharness.model.errors import NotBuiltError
from pyharness.model.scene import Wave

COMPLETE, STOPPED, OVERFLOW = Statuses.COMPLETE, Statuses.STOPPED, Statuses.OVERFLOW
REFUSED, GAVE_UP, INTERRUPTED = Statuses.REFUSED, Statuses.GAVE_UP, Statuses.INTERRUPTED
SENSITIVE = Statuses.SENSITIVE
# What a user reads.
ENDS = tuple(name.lower().replace("_", " ") for name in vars(Statuses) if name.isupper())


def extension() -> ModuleType:
    """Return the compiled extension; NotBuiltError where there is none."""
    try:
        from pyharness import _kernels
    except ImportError as error:
        raise NotBuiltError(
            "the Fortran extension is not built; run 'make compare' in the checkout, or "
            "'pip install .' with a Fortran compiler (meanwhile: --implementation python)"
        ) from error
    module: ModuleType = _kernels
    return module


def columns(waves: tuple[Wave, ...], kind: type = float) -> NDArray[Any]:
    """Return amplitudes and frequencies as the kernels take them, shape (4, n)."""
    columns: NDArray[Any] = np.empty((4, len(waves)), dtype=kind, order="F")
    for index, (amplitude, frequency) in enumerate(waves):
        columns[:3, index] = amplitude
        columns[3, index] = frequency
    return columns
