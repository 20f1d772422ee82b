"""`python -m tests.methods.free_rotor_campaign COUNT SEED [TARGET]`: free_rotor.h and the kernel.

COUNT random scenes, in equal parts of the kinds of `free_motions`, are solved by the header and by
the Fortran kernel of the closed form. TARGET is `cc`, the C compiler `$CC` (default), `clang`, or
`wasm`, which is WebAssembly by clang, run by node. The package ziglang has both of the latter.

Times are up to 1e6 s in binary64. In binary32 they are up to 1e3 s, and the scenes are rounded to
binary32 first. The command prints for each precision the numbers of scenes that both solve and that
only one of them solves, and the largest difference of a component, with its scene. A difference of
omega is relative to the largest |omega| of the motion. Exit status 1 if a difference exceeds
`BOUNDS`, or if only one of them solves a scene, apart from phases that are too large for binary32.
"""

import ctypes
import importlib.util
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pyharness import get_include
from pyharness.model.extension import extension
from pyharness.scenes.free_motions import KINDS, draw

SOURCE = Path(__file__).with_name("free_rotor.c")
FLAGS = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{get_include()}"]
CC = shlex.split(os.environ.get("CC", "cc"))
OK, INVALID, RANGE, PHASE, OVERFLOW = range(5)
# Largest differences from the kernel: at most 1.0e-15 and 4e-7 with three compilers.
BOUNDS = {"binary64": 2e-15, "binary32": 1e-6}
_CHUNK = 20_000


def compiled(target: Path, source: Path = SOURCE, flags: Sequence[str] = (), cc: Any = CC) -> Path:
    """Compile a C program with every warning as an error."""
    subprocess.run([*cc, *FLAGS, *flags, str(source), "-o", str(target), "-lm"], check=True)
    return target


def compiled_library(folder: Path) -> Any:
    """Compile the header as a shared library in a folder, and load the library."""
    return ctypes.CDLL(str(compiled(folder / "free_rotor.so", flags=["-shared", "-fPIC"])))


def command(target: str, folder: Path) -> list[str] | None:
    """Compile `SOURCE` for a target in a folder; return the command, None if tools are missing."""
    zig = importlib.util.find_spec("ziglang") and [sys.executable, "-m", "ziglang", "cc"]
    if target == "cc":
        return [str(compiled(folder / "scenes"))]
    if target == "clang":
        clang = zig or (shutil.which("clang") and ["clang"])
        return [str(compiled(folder / "scenes-clang", cc=clang))] if clang else None
    node = shutil.which("node")
    if not zig or node is None:
        return None
    built = compiled(folder / "scenes.wasm", flags=["-target", "wasm32-wasi"], cc=zig)
    script = folder / "run.mjs"
    script.write_text(
        'import { readFileSync } from "node:fs";\n'
        'import { WASI } from "node:wasi";\n'
        'const args = ["scenes", ...process.argv.slice(3)];\n'
        'const wasi = new WASI({ version: "preview1", args });\n'
        "const built = await WebAssembly.compile(readFileSync(process.argv[2]));\n"
        "wasi.start(await WebAssembly.instantiate(built, wasi.getImportObject()));\n"
    )
    return [node, "--no-warnings", str(script), str(built)]


def solved(program: Sequence[str], word: str, scenes: Any) -> tuple[Any, Any]:
    """Return a program's states of scenes (moments, omega, attitude, time), and its codes."""
    given = np.ascontiguousarray(scenes, float).tobytes()
    output = subprocess.run([*program, word], input=given, check=True, capture_output=True).stdout
    found = np.frombuffer(output).reshape(len(scenes), 8)
    return found[:, :7], found[:, 7].astype(int)


def of_kernel(scenes: Any) -> tuple[Any, Any]:
    """Return the kernel's states of scenes, and its statuses, of which 0 is a complete solution."""
    found, ended = np.full((len(scenes), 7), np.nan), np.empty(len(scenes), int)
    solution = extension().torque_free_attitude_solution
    for i, scene in enumerate(scenes):
        rows, attitudes, n_rows, ended[i] = solution(scene[:3], scene[3:6], scene[6:10], scene[10:])
        if n_rows == 1:
            found[i, :3], found[i, 3:] = rows[:, 0], attitudes[:, 0]
    return found, ended


def drawn(count: int, source: random.Random) -> Any:
    """Return `count` scenes of each kind of body, with times up to 1e6 s."""
    motions = [draw(source, kind) for kind in KINDS for _ in range(count)]
    return np.array([[*moments, *omega, *q, time] for moments, omega, q, time in motions])


def rounded(scenes: Any) -> Any:
    """Return scenes rounded to binary32, with times of at most 1e3 s."""
    scenes = scenes.copy()
    scenes[:, 10] = np.clip(scenes[:, 10], -1e3, 1e3)
    return scenes.astype(np.float32).astype(float)


def largest_omega(scenes: Any) -> Any:
    """Return |omega| of each motion at the time when the component about the middle axis is 0.

    At that time the component about the axis of the smallest moment is largest. That of a needle
    may be a hundred times |omega| at the time 0.
    """
    moments = scenes[:, :3]
    low, high = moments.min(1, keepdims=True), moments.max(1, keepdims=True)
    with np.errstate(all="ignore"):
        energies = moments * scenes[:, 3:6] ** 2
        at_low = (energies * (high - moments)).sum(1, keepdims=True) / low
        at_high = (energies * (moments - low)).sum(1, keepdims=True) / high
        return np.sqrt((at_low + at_high) / (high - low))[:, 0]


def difference(found: Any, wanted: Any, scenes: Any) -> Any:
    """Return the largest difference of each scene.

    The difference of omega is relative to the largest |omega| of the motion.
    """
    size = np.maximum(np.abs(scenes[:, 3:6]).max(1), np.abs(wanted[:, :3]).max(1))
    size = np.fmax(size, largest_omega(scenes))
    omega = np.abs(found - wanted)[:, :3].max(1) / np.where(size > 0.0, size, 1.0)
    return np.maximum(omega, np.abs(found - wanted)[:, 3:].max(1))


class Tally:
    """The numbers of scenes and the largest difference in one precision."""

    def __init__(self, word: str) -> None:
        """Begin with no scenes; `word` is the precision."""
        self.word = word
        self.both = self.too_long = self.disagreeing = 0
        self.largest = 0.0
        self.worst: Any = None

    def add(self, program: Sequence[str], scenes: Any) -> None:
        """Solve scenes by a program and by the kernel, and compare the results."""
        if self.word == "binary32":
            scenes = rounded(scenes)
        found, ended = solved(program, self.word, scenes)
        wanted, kernel_ended = of_kernel(scenes)
        # The phase of needles, with moments in the ratio of 1e9, is too large for binary32.
        too_long = (ended == PHASE) & (self.word == "binary32")
        self.too_long += int(too_long.sum())
        self.disagreeing += int((((ended == OK) != (kernel_ended == 0)) & ~too_long).sum())
        both = (ended == OK) & (kernel_ended == 0)
        self.both += int(both.sum())
        errors = difference(found[both], wanted[both], scenes[both])
        if len(errors) and errors.max() > self.largest:
            self.largest, self.worst = errors.max(), scenes[both][errors.argmax()]

    def __str__(self) -> str:
        """Return the line of this precision, and the scene of the largest difference."""
        return (
            f"{self.word}: {self.both} solved by both, {self.disagreeing} by only one, "
            f"{self.too_long} with too large a phase; largest difference {self.largest:.1e}\n"
            f"  at {None if self.worst is None else self.worst.tolist()}"
        )

    @property
    def is_passed(self) -> bool:
        """Whether the header and the kernel agree."""
        return self.disagreeing == 0 and self.largest < BOUNDS[self.word]


def compare(count: int, seed: str, program: Sequence[str]) -> list[Tally]:
    """Compare a program on about `count` scenes, drawn from a seed, in both precisions."""
    source = random.Random(seed)
    tallies = [Tally(word) for word in BOUNDS]
    left = count
    while left > 0:
        scenes = drawn(-(-min(left, _CHUNK) // len(KINDS)), source)
        left -= len(scenes)
        for tally in tallies:
            tally.add(program, scenes)
    return tallies


def main(count: str = "100000", seed: str = "1", target: str = "cc") -> int:
    """Print the comparison of `count` scenes."""
    with tempfile.TemporaryDirectory() as folder:
        program = command(target, Path(folder))
        if program is None:
            print(f"{target}: needs the package ziglang, and node for WebAssembly")
            return 1
        tallies = compare(int(count), seed, program)
    for tally in tallies:
        print(tally)
    return 0 if all(tally.is_passed for tally in tallies) else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
