"""Refuse compilers that change the arithmetic: check_arithmetic.py CHECK SOURCE COMMAND...

CHECK is pyharness/model/arithmetic.py; SOURCE has its function in Fortran, or is "-" for C. Meson
can't run this test with flang, to which it passes options for C.
"""

import runpy
import sys
from pathlib import Path


def main(check: str, source: str, *command: str) -> int:
    """Print the fault, or why nothing is known; return 1 if there is a fault."""
    made = runpy.run_path(check)
    try:
        fault = made["check_compiler"](command, None if source == "-" else Path(source))
    except made["UncheckedError"] as error:
        # A library of the compiler may be missing, which the kernels do not need.
        fault = None
        print(f"the arithmetic is not checked: {error}")
    if fault:
        print(fault)
    return int(fault is not None)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
