"""`python -m pyharness`, and what the command `pyharness` starts."""

import atexit
import contextlib
import os
import sys


def start() -> None:
    """Run the command line and leave with its exit code, soon where it was interrupted."""
    try:
        from pyharness.cli.main import main

        code = main()
    except KeyboardInterrupt:
        # While the command line itself was read in.
        sys.stderr.write("pyharness: interrupted\n")
        code = 130
    if code == 130:
        # Not as Python does: it would wait for threads, free all memory piece by piece, and where
        # the signal came within an import, die by the signal itself.
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(Exception):
                stream.flush()
        os._exit(code)
    sys.exit(code)


if __name__ == "__main__":
    start()
