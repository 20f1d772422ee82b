"""The truth of the campaign: omega at the end in some 31 digits, and the growth K, in milliseconds.

`pairs.c` beside this file, compiled when it is first asked for. It is held to `truth/reference.py`
in `test_estimates.py`.
"""

import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.integer_series import exact_body

MOST_STEPS = 40_000
DIGITS_LOST = 1e-29  # of the pairs, over their many steps, before the motion multiplies it
COMPILER = os.environ.get("CC", "cc")
_WHY = (
    "", "takes too many steps", "leaves every bound", "needs too much memory",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Truth:
    """What is so at the end, and on the way to it."""

    omega: Array  # shape (3,); rounded to binary64 (rad/s)
    remainder: Array  # shape (3,); what rounding took (rad/s)
    largest: float  # largest abs of any component of omega on the way (rad/s)
    turns: float
    # largest norm of the derivative of omega at the end by omega at any time before; infinite
    # beyond 1e300
    growth: float
    steps: int

    def error(self, omega: Array) -> float:
        """Return the largest error of any component over the largest omega on the way."""
        return float(np.abs(omega - self.omega - self.remainder).max()) / self.largest

    @property
    def doubt(self) -> float:
        """What the truth itself may be wrong by, over the largest omega on the way."""
        return DIGITS_LOST * self.growth


def truth_of(scene: Scene, time: float, most_steps: int = MOST_STEPS) -> Truth:
    """Return the truth of a scene at `time` (s), on either side of 0.

    InputError where omega leaves every bound before, or more steps would be needed.
    """
    law = scene.torque
    moments, products = exact_body(scene)

    def over_moments(vector: Sequence[float]) -> list[float]:
        return _pairs([Fraction(x) / moment for x, moment in zip(vector, moments, strict=True)])

    waves: list[float] = []
    for cosine, some in ((0.0, law.sines), (1.0, law.cosines)):
        for amplitude, frequency in some:
            waves += [*over_moments(amplitude), frequency, cosine]
    inputs = (_pairs(products), over_moments(law.constant), over_moments(law.rate))
    found, steps = (ctypes.c_double * 9)(), ctypes.c_int()
    status = _library().pairs_truth(
        *(_array(each) for each in inputs), len(waves) // 8, _array(waves), _array(scene.omega),
        ctypes.c_double(time), most_steps, found, ctypes.byref(steps),
    )  # fmt: skip
    if status:
        raise InputError(f"pairs: the solution {_WHY[status]}")
    omega, remainder = np.array(found[:3]), np.array(found[3:6])
    largest, angle, growth = found[6:]
    return Truth(omega, remainder, largest, angle / (2.0 * np.pi), growth, steps.value)


def _pairs(values: Sequence[Fraction]) -> list[float]:
    large = [float(x) for x in values]
    return large + [float(x - Fraction(y)) for x, y in zip(values, large, strict=True)]


def _array(values: Sequence[float]) -> ctypes.Array[ctypes.c_double]:
    return (ctypes.c_double * len(values))(*values)


def compiler_here() -> bool:
    """Whether there is a C compiler."""
    return shutil.which(COMPILER) is not None


@functools.cache
def _library() -> ctypes.CDLL:
    source = Path(__file__).with_name("pairs.c")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "pairs.so"
        # A sum contracted to a fused operation would lose what two-term sums are after.
        flags = ["-O3", "-march=native", "-ffp-contract=off", "-Wno-psabi", "-shared", "-fPIC"]
        command = [COMPILER, *flags, "-o", str(library), str(source), "-lm"]
        subprocess.run(command, check=True)
        return ctypes.CDLL(str(library))
