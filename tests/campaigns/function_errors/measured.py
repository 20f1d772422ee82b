"""Measured errors of the functions, by comparison with mpmath and with exact fractions."""

import ctypes
import json
import math
import os
import random
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from mpmath import libmp
from numpy.typing import NDArray

from pyharness.model.codes import Waves
from tests.campaigns.function_errors import lane_circular, pair_operations
from tests.campaigns.function_errors.nearness import half_pi, hard_angle
from tests.campaigns.function_errors.pair_circular import Method, of_fortran
from tests.campaigns.function_errors.pair_operations import OPERATIONS, Operation
from tests.campaigns.function_errors.sources import JAVASCRIPT, LANES, WIDE, WORD_PAIRS, Pair
from tests.instruction_sets import fuses_here

Numbers = NDArray[np.float64]
_COUNT = 100_000
_LARGEST = int(lane_circular.LIMIT * 2 / 3)


def angles(count: int, seed: int = 1) -> Numbers:
    """Return angles up to 1e6 rad: random ones, and ones near to odd multiples of pi/4 and pi/2."""
    source = np.random.default_rng(seed)
    hard = [float(hard_angle(53, n)) for n in range(1, 20)]
    turns = source.integers(0, 4 * _LARGEST // math.ceil(math.pi), count // 4)
    near = turns * (math.pi / 4) * (1.0 + 2e-16 * source.integers(-3, 4, len(turns)))
    parts = [source.uniform(-1e6, 1e6, count // 4), source.uniform(-0.8, 0.8, count // 2), near]
    return np.concatenate([hard, *parts])


def circular_error(found: Sequence[Numbers], given: Numbers) -> tuple[float, float]:
    """Return the largest errors of sines and cosines in arrays, compared with mpmath."""
    worst = [0.0, 0.0]
    with mpmath.workprec(140):
        for n, angle in enumerate(given.tolist()):
            true = mpmath.cos_sin(mpmath.mpf(angle))
            for k in range(2):
                worst[k] = max(worst[k], abs(float(true[1 - k] - float(found[k][n]))))
    return worst[0], worst[1]


_STUBS = """module kinds
  integer, parameter, public :: dp = selected_real_kind(15)
end module kinds
module bodies
  integer, parameter, public :: LANES = 8
end module bodies
"""
_CALLER = """subroutine call_lanes(n, angle, sine, cosine) bind(c)
  use bodies, only: LANES
  use kinds, only: dp
  use many_circular, only: sine_cosine_lanes
  integer, value :: n
  real(dp), intent(in) :: angle(LANES, n)
  real(dp), intent(inout) :: sine(LANES, n), cosine(LANES, n)
  integer :: i
  do i = 1, n
    call sine_cosine_lanes(LANES, angle(:, i), sine(:, i), cosine(:, i))
  end do
end subroutine call_lanes
"""


def compiled_lanes(folder: Path, given: Numbers, *flags: str) -> tuple[Numbers, Numbers]:
    """Return sines and cosines of the kernel, compiled with our flags and `flags`."""
    text = _STUBS + LANES.read_text() + _CALLER
    (folder / "lanes.f90").write_text(text)
    library = folder / f"lanes{len(flags)}.so"
    compiler = os.environ.get("FC", "gfortran")
    ours = ("-O2", "-ffp-contract=fast", "-ftree-vectorize", "-fno-trapping-math", "-fPIC")
    command = [compiler, *ours, *flags, "-shared", "lanes.f90", "-o", str(library)]
    subprocess.run(command, cwd=folder, check=True)
    angle = np.resize(given, 8 * (len(given) // 8 + 1))
    sine, cosine = np.zeros_like(angle), np.zeros_like(angle)
    pointers = [each.ctypes.data_as(ctypes.c_void_p) for each in (angle, sine, cosine)]
    ctypes.CDLL(str(library)).call_lanes(len(angle) // 8, *pointers)
    return sine[: len(given)], cosine[: len(given)]


def corrected_error(count: int, largest: float, seed: int = 1) -> float:
    """Return the largest error of sine_cosine of two_words.f90, with the C library's functions."""
    source, worst = random.Random(seed), 0.0
    with mpmath.workprec(200):
        for _ in range(count):
            angle = source.uniform(-largest, largest)
            low = 0.5 * math.ulp(angle) * source.uniform(-1.0, 1.0)
            s, c, sl, cl = math.sin(angle), math.cos(angle), math.sin(low), math.cos(low)
            found = s * cl + c * sl, c * cl - s * sl
            if abs(angle) <= 1e6:
                found = s + c * low, c - s * low
            true = mpmath.cos_sin(mpmath.mpf(angle) + mpmath.mpf(low))
            worst = max(worst, *(abs(float(true[1 - k] - found[k])) for k in range(2)))
    return worst


def _exact(x: Any) -> Any:
    return Pair(_exact(x.high), _exact(x.low)) if isinstance(x, Pair) else Fraction(float(x))


def _drawn(kind: str, count: int, source: np.random.Generator) -> Any:
    """Return random numbers or pairs, of which many have few bits or the largest low parts."""
    high = source.uniform(1.0, 2.0, count)
    near = source.random(count) < 0.5
    high[near] = 1.0 + np.floor(high[near] * 2.0**27) * 2.0**-52
    if kind == "s":
        high *= 2.0 ** source.integers(-60, 1, count) * source.choice([-1.0, 1.0], count)
    if kind == "r":
        high *= source.choice([1.0, 2.0], count)
    if kind == "n":
        return high
    share = source.choice([0.0, 0.5, 0.999, 1.0], count, p=[0.1, 0.1, 0.4, 0.4])
    share[share == 0.5] = source.random(int(np.sum(share == 0.5)))
    low = 0.5 * np.spacing(np.abs(high)) * share * source.choice([-1.0, 1.0], count)
    low *= 1.0 - 2.0**-50
    return Pair(high, low)


def operation_error(operation: Operation, count: int, seed: int = 1) -> float:
    """Return the largest relative error of an operation in binary64, in units of 2**-106."""
    source = np.random.default_rng(seed)
    function = pair_operations.routines(53)[operation.source][operation.name]
    given = [_drawn(kind, count, source) for kind in operation.operands]
    result, worst = function(*given), Fraction(0)
    for n in range(count):
        error, size = operation.residual(*[_exact(_at(x, n)) for x in (result, *given)])
        if size:
            worst = max(worst, abs(error / size))
    return float(worst * 2**106)


def _at(x: Any, n: int) -> Any:
    return Pair(x.high[n], x.low[n]) if isinstance(x, Pair) else x[n]


def longer_product_error(count: int, seed: int = 1) -> float:
    """Return the largest relative error of longer_product in binary64, in units of 2**-159."""
    source = np.random.default_rng(seed)
    function = pair_operations.routines(53)[WORD_PAIRS]["longer_product"]
    worst = Fraction(0)
    for _ in range(count):
        x = [source.uniform(1.0, 2.0)]
        for _ in range(2):
            x.append(x[-1] * 2.0**-53 * source.choice([-1.0, 1.0]) * source.uniform(0.9, 1.0))
        y = source.uniform(1.0, 2.0)
        true = sum(map(Fraction, x)) * Fraction(y)
        worst = max(worst, abs(sum(Fraction(float(each)) for each in function(x, y)) / true - 1))
    return float(worst * 2**159)


def reduction_error(method: Method, angle: Fraction) -> Fraction:
    """Return the relative error of the reduced angle of binary128, by the operations of its source.

    The operations are less_quarters of wide_functions.f90.
    """
    own = pair_operations.routines(113)[WIDE]
    turns = round(angle / half_pi()[0])
    with mpmath.workprec(113):
        rest = Pair(_binary128(angle), mpmath.mpf(0))
        for each in method.parts:
            part = own["product_of"](mpmath.mpf(turns), _binary128(each))
            rest = own["sum_of_pairs"](rest, Pair(-part.high, -part.low))
    true = angle - turns * half_pi()[0]
    return abs(sum(Fraction(*libmp.to_rational(x._mpf_)) for x in (rest.high, rest.low)) / true - 1)


def _binary128(x: Fraction) -> Any:
    return mpmath.mpf(x.numerator) / x.denominator


def javascript_ulps(given: Sequence[float]) -> float:
    """Return the largest error of sine and cosine of the JavaScript, in units in the last place."""
    program = (
        f"import {{ sine, cosine }} from {json.dumps(str(JAVASCRIPT))};"
        "import { readFileSync } from 'node:fs';"
        "const given = JSON.parse(readFileSync(0));"
        "console.log(JSON.stringify(given.map((x) => [sine(x), cosine(x)])));"
    )
    node = shutil.which("node")
    assert node
    run = subprocess.run(
        [node, "--input-type=module", "-e", program], input=json.dumps(list(given)), text=True,
        capture_output=True, check=True,
    )  # fmt: skip
    worst = 0.0
    with mpmath.workprec(200):
        for angle, both in zip(given, json.loads(run.stdout), strict=True):
            for value, true in zip(both, mpmath.cos_sin(mpmath.mpf(angle))[::-1], strict=True):
                unit = math.ulp(float(true))
                worst = max(worst, float(abs(mpmath.mpf(value) - true) / unit))
    return worst


def main() -> None:
    given = angles(_COUNT)
    pairs = {"statements": lane_circular.compute(LANES.read_text(), given)}
    if shutil.which(os.environ.get("FC", "gfortran")):
        with tempfile.TemporaryDirectory() as folder:
            for flags in ((), *((("-march=x86-64-v3",),) if fuses_here() else ())):
                pairs[f"compiled {flags}"] = compiled_lanes(Path(folder), given, *flags)
    for name, found in pairs.items():
        sine, cosine = circular_error(found, given)
        print(f"sine_cosine_lanes, {name}: sine {sine:.4g}, cosine {cosine:.4g}")
    for largest in (1e6, 1e15):
        error = corrected_error(_COUNT // 2, largest)
        print(f"sine_cosine of two_words.f90, up to {largest:g} rad: {error:.4g}")
    for operation in OPERATIONS:
        own = operation_error(operation, _COUNT // 4) if operation.source != WIDE else math.nan
        bits = ", ".join(f"{_worst(operation, digits):.2f} at {digits} bits" for digits in (5, 6))
        print(f"{operation.source.name} {operation.name}: {own:.2f} in binary64, {bits} (u**2)")
    print(f"longer_product: {longer_product_error(_COUNT // 4):.2f} u**3")
    method = of_fortran(WIDE.read_text(), Waves.ANGLE_BITS)
    hard = [hard_angle(113, n) for n in range(1, method.limit + 1)]
    reduced = max(reduction_error(method, angle) for angle in hard)
    print(f"reduced angle of binary128: 2**{math.log2(reduced):.2f}")
    source = random.Random(1)
    several = [source.uniform(-1.0, 1.0) * 2.0 ** source.uniform(-30, 30) for _ in range(_COUNT)]
    several += [float(hard_angle(53, n)) for n in range(1, 31)]
    if shutil.which("node"):
        print(f"circular.js: {javascript_ulps(several):.7f} ulp")


def _worst(operation: Operation, digits: int) -> float:
    function = pair_operations.routines(digits)[operation.source][operation.name]
    return pair_operations.worst(operation, function, digits, 1)


if __name__ == "__main__":
    main()
