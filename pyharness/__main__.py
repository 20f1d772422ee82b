"""`python -m pyharness`, and what the command `pyharness` starts."""

import sys

from pyharness.cli import interruption


def start() -> None:
    """Run the command line and leave with its exit code, soon where it was interrupted."""
    interruption.leave_when_interrupted()
    from pyharness.cli.main import main

    code = interruption.run_interruptible(main)
    if code == interruption.CODE:
        interruption.leave_interrupted()
    sys.exit(code)


if __name__ == "__main__":
    start()
