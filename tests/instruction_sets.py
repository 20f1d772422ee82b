"""Instruction sets that the kernels are compiled for, and those that this processor has."""

import os
import platform

import numpy as np

from pyharness import _build  # noqa: PLC2701

LEVELS = ("plain", "avx2", "avx512")
BEST = len(LEVELS) - 1
# `make cross-check` and .ci/weekly try other instruction sets than the best of their machine.
CHOSEN = LEVELS.index(os.environ.get("PYHARNESS_INSTRUCTIONS", LEVELS[BEST]))
# NumPy's new and old names for them.
_NAMES = ({"X86_V3", "AVX2"}, {"X86_V4", "AVX512_SKX"})


def level_of_processor() -> int:
    """Return the highest level of this processor, according to NumPy and not to levels.c."""
    simd = np.show_config(mode="dicts")["SIMD Extensions"]
    found = {*simd["baseline"], *simd["found"]}
    return sum(not names.isdisjoint(found) for names in _NAMES)


def levels_here() -> list[int]:
    """Return the levels that are compiled, and that this processor has, in order."""
    compiled = sorted(LEVELS.index(name) for name in _build.INSTRUCTION_SETS)
    return [level for level in compiled if level <= level_of_processor()]


def fuses_here() -> bool:
    """Whether this processor has a fused multiply-add."""
    return level_of_processor() > 0 or platform.machine().lower() in ("arm64", "aarch64")
