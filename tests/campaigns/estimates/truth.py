"""The truth of the campaign: omega and attitude to some 31 digits, and the error amplification K.

The kernel is `pairs.c` beside this file, compiled when it is first needed. `test_estimates.py`
compares it with `truth/reference.py` and `truth/free_attitude.py`.
"""

import ctypes
import functools
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

MOST_STEPS = 40_000
DIGITS_LOST = 1e-29  # rounding error of the pairs over many steps, before amplification
COMPILER = os.environ.get("CC", "cc")
_WHY = (
    "", "takes too many steps", "grows without bound", "needs too much memory",
)  # fmt: skip
_COEFFICIENTS, _INERTIA = 0, 1
_ROW = 15


@dataclass(frozen=True, eq=False)
class Truth:
    """The solution at the requested times, and measures of the motion up to the last of them."""

    omega: Array  # shape (n, 3); rounded to binary64 (rad/s)
    remainder: Array  # shape (n, 3); the truth minus `omega` (rad/s)
    attitude: Array | None  # shape (n, 4); rounded to binary64
    attitude_remainder: Array | None
    largest: float  # largest abs of any component of omega until the last time (rad/s)
    turns: float
    # Largest norm of the state-transition matrix from any earlier time to a row; infinite beyond
    # 1e300. With the attitude the state has a small rotation too, and omega in units of `largest`.
    growth: float
    steps: int

    def at_the_end(self) -> "Truth":
        """Return the truth at the last time only."""
        found = replace(self, omega=self.omega[-1:], remainder=self.remainder[-1:])
        if self.attitude is None or self.attitude_remainder is None:
            return found
        attitude, remainder = self.attitude[-1:], self.attitude_remainder[-1:]
        return replace(found, attitude=attitude, attitude_remainder=remainder)

    def error(self, omega: Array) -> float:
        """Return the largest error of any component of omega, relative to the largest omega."""
        return float(np.abs(omega - self.omega - self.remainder).max()) / self.largest

    def angle(self, attitude: Array) -> float:
        """Return the largest angle (rad) between attitudes, shape (n, 4), and the true ones."""
        assert self.attitude is not None
        assert self.attitude_remainder is not None
        w, v = self.attitude[:, :1], self.attitude[:, 1:]
        # The vector part of attitude times the conjugate of the truth. The difference is taken
        # before the products, so that no digits cancel.
        sign = np.sign(np.einsum("ij,ij->i", attitude, self.attitude))[:, None]
        difference = sign * attitude - self.attitude - self.attitude_remainder
        a, b = difference[:, :1], difference[:, 1:]
        vector = b * w - a * v - np.cross(b, v)
        return 2.0 * float(np.sqrt((vector * vector).sum(axis=1)).max())

    @property
    def doubt(self) -> float:
        """The possible error of the truth itself, relative to the largest omega."""
        return DIGITS_LOST * self.growth


def truth_of(
    scene: Scene,
    times: float | Sequence[float],
    most_steps: int = MOST_STEPS,
    attitude: bool = False,
) -> Truth:
    """Return the truth of a scene at `times` (s), which have one sign and go away from 0.

    Times are whole multiples of the unit in the last place of the last of them. Raise InputError if
    omega grows without bound before the last time, or if more than `most_steps` are needed.
    """
    until = np.atleast_1d(np.asarray(times, dtype=np.float64))
    unit = math.ulp(until[-1])
    assert all(Fraction(t) % Fraction(unit) == 0 for t in until.tolist())
    law = scene.law
    body = _body(scene)
    waves: list[float] = []
    for cosine, some in ((0.0, law.sines), (1.0, law.cosines)):
        for amplitude, frequency in some:
            waves += [*_pairs_of(amplitude), frequency, cosine]
    rows, found = np.empty((len(until), _ROW)), (ctypes.c_double * 2)()
    steps = ctypes.c_int()
    with_attitude = attitude or law.in_space
    status = _library().pairs_truth(
        _COEFFICIENTS if scene.coefficients is not None else _INERTIA, _array(body),
        _array(_pairs_of(law.constant)), _array(_pairs_of(law.rate)),
        len(waves) // 8, _array(waves), int(with_attitude), int(law.in_space),
        _array(scene.omega), _array(_unit(scene.attitude or IDENTITY)),
        len(until), _array(until.tolist()), most_steps,
        rows.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), found, ctypes.byref(steps),
    )  # fmt: skip
    if status:
        raise InputError(f"pairs: the solution {_WHY[status]}")
    largest, angle = found
    return Truth(
        rows[:, :3],
        rows[:, 3:6],
        rows[:, 6:10] if with_attitude else None,
        rows[:, 10:14] if with_attitude else None,
        largest,
        angle / (2.0 * np.pi),
        float(rows[:, 14].max()),
        steps.value,
    )


def _body(scene: Scene) -> list[float]:
    """Return A, B, C as pairs, or the inertia matrix and its inverse."""
    if scene.coefficients is not None:
        return _pairs_of(scene.coefficients)
    if scene.inertia is not None:
        matrix = [[Fraction(x) for x in row] for row in scene.inertia]
    else:
        matrix = [[Fraction(0)] * 3 for _ in range(3)]
        for axis, moment in enumerate(scene.moments or ()):
            matrix[axis][axis] = Fraction(moment)
    (a, b, c), (_, d, e), (_, _, f) = matrix
    adjugate = [
        [d * f - e * e, c * e - b * f, b * e - c * d],
        [c * e - b * f, a * f - c * c, b * c - a * e],
        [b * e - c * d, b * c - a * e, a * d - b * b],
    ]
    determinant = a * adjugate[0][0] + b * adjugate[0][1] + c * adjugate[0][2]
    inverse = [[x / determinant for x in row] for row in adjugate]
    numbers: list[float] = []
    for row in (*matrix, *inverse):
        numbers += _pairs(row)
    return numbers


def _unit(values: Sequence[float]) -> list[float]:
    """Return the normalised quaternion as pairs."""
    exact = [Fraction(x) for x in values]
    square = sum(x * x for x in exact)
    # The root to 40 digits, in integer arithmetic.
    scale = 10**40
    root = Fraction(math.isqrt(int(square * scale * scale)), scale)
    return _pairs([x / root for x in exact])


def _pairs_of(values: Sequence[float]) -> list[float]:
    return _pairs([Fraction(x) for x in values])


def _pairs(values: Sequence[Fraction]) -> list[float]:
    large = [float(x) for x in values]
    return large + [float(x - Fraction(y)) for x, y in zip(values, large, strict=True)]


def _array(values: Sequence[float]) -> ctypes.Array[ctypes.c_double]:
    return (ctypes.c_double * len(values))(*values)


def compiler_here() -> bool:
    """Return whether a C compiler is on the PATH."""
    return shutil.which(COMPILER) is not None


@functools.cache
def _library() -> ctypes.CDLL:
    source = Path(__file__).with_name("pairs.c")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "pairs.so"
        # A fused multiply-add would lose the rounding errors that two-term sums recover.
        flags = ["-O3", "-march=native", "-ffp-contract=off", "-Wno-psabi", "-shared", "-fPIC"]
        command = [COMPILER, *flags, "-o", str(library), str(source), "-lm"]
        subprocess.run(command, check=True)
        return ctypes.CDLL(str(library))
