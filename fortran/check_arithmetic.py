"""Refuse flags that change the arithmetic: check_arithmetic.py SOURCE COMPILER FLAG...

Meson can't run this test with flang, to which it passes options for C.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

CHANGED = 77  # exit status of the program


def fault(source: str, command: Sequence[str]) -> str | None:
    """Return why the compiler is refused, in one line, or None if the program finds no fault."""
    said = " ".join(dict.fromkeys(command))
    with TemporaryDirectory() as folder:
        program = Path(folder, "program")
        done = subprocess.run(
            [*command, source, "-o", program], capture_output=True, text=True, check=False
        )
        if done.returncode:
            return f"'{said}' does not compile {source}: {' '.join(done.stderr.split())}"
        status = subprocess.run([program], capture_output=True, check=False).returncode
    if status != CHANGED:
        # A library of the compiler may be missing, which the kernels do not need.
        if status:
            print(f"what '{said}' compiles does not run here: its arithmetic is not tested")
        return None
    return (
        f"'{said}' removes or reorders operations, or flushes subnormal numbers to zero: leave out "
        "options such as -Ofast, -ffast-math, -funsafe-math-optimizations, -ffinite-math-only, "
        "-freciprocal-math and -fno-signed-zeros"
    )


if __name__ == "__main__":
    if found := fault(sys.argv[1], sys.argv[2:]):
        print(found)
        sys.exit(1)
