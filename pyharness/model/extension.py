"""Access to the compiled Fortran extension."""

from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.codes import Statuses
from pyharness.model.distribution import DISTRIBUTION
from pyharness.model.errors import NotBuiltError
from pyharness.model.torque_law import Wave

COMPLETE, STOPPED, OVERFLOW = Statuses.COMPLETE, Statuses.STOPPED, Statuses.OVERFLOW
REFUSED, GAVE_UP, INTERRUPTED = Statuses.REFUSED, Statuses.GAVE_UP, Statuses.INTERRUPTED
SENSITIVE = Statuses.SENSITIVE
# Names of the statuses, for users, in the order of their codes.
ENDS = tuple(name.lower().replace("_", " ") for name in vars(Statuses) if name.isupper())


def extension() -> ModuleType:
    try:
        module = import_module("pyharness._kernels")
    except ModuleNotFoundError as error:
        raise NotBuiltError(_why_missing()) from error
    except ImportError as error:
        raise NotBuiltError(f"the Fortran extension can't be loaded: {error}") from error
    _check_processor()
    return module


@cache
def _check_processor() -> None:
    from pyharness import _build, _kernels

    if _kernels.choose_instructions(-1) < 0:
        raise NotBuiltError(
            f"the kernels are built for {_build.INSTRUCTION_SETS[0]}, which this processor lacks; "
            "run 'make clean compare', or 'pip install .', which builds for all processors"
        )


def _why_missing() -> str:
    from importlib.metadata import PackageNotFoundError, distribution

    here = Path(__file__).parents[1]
    try:
        installed = Path(str(distribution(DISTRIBUTION).locate_file(here.name)))
    except PackageNotFoundError:
        installed = here
    # Python prefers the folder in which it is started to installed packages.
    if installed != here and any(installed.glob("_kernels.*")):
        return (
            f"Python imported the source folder {here}, which is not built; the installed package "
            f"is {installed}; run from another folder, or use the command pyharness"
        )
    return (
        "the Fortran extension is not built; run 'make compare' in the checkout, or "
        "'pip install .' with a Fortran compiler (meanwhile: --implementation python)"
    )


def columns(waves: tuple[Wave, ...], kind: type = float) -> NDArray[Any]:
    """Return n waves (three amplitudes and a frequency, rad/s) as columns, (4, n)."""
    rows = [(*amplitude, frequency) for amplitude, frequency in waves]
    return np.array(rows, dtype=kind).reshape(-1, 4).T
