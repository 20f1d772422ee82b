"""A process that has imported the libraries, and runs each test command in a copy of itself.

Most of the time of a short test would be these imports. A line of standard input has the arguments
of pytest and the file for its output. The answers are the number of the copy and its exit status.
"""

import importlib
import json
import os
import sys

# No plugin of pytest, which must be imported by pytest itself, and nothing that may be mutated.
LIBRARIES = ("numpy", "scipy.integrate", "scipy.optimize", "scipy.special", "mpmath", "pytest")


def main() -> None:
    """Answer requests until standard input ends."""
    for library in LIBRARIES:
        importlib.import_module(library)
    for line in sys.stdin:
        arguments, place = json.loads(line)
        copy = os.fork()
        if copy == 0:
            _run(arguments, place)
        print(copy, flush=True)
        _, status = os.waitpid(copy, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _run(arguments: list[str], place: str) -> None:
    import pytest

    # A process group of its own, so that whatever the tests start ends with it.
    os.setsid()
    nothing = os.open(os.devnull, os.O_RDONLY)
    output = os.open(place, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for old, new in enumerate((nothing, output, output)):
        os.dup2(new, old)
    code = int(pytest.main(arguments))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    main()
