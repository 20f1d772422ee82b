"""`python -m pyharness`, and what the command `pyharness` starts."""

import os
import signal


def _leave(*_: object) -> None:
    try:
        os.write(2, b"pyharness: interrupted\n")
    finally:
        os._exit(130)


# Before anything else is imported: until here, a Ctrl-C ends in a traceback of the interpreter.
# Where it is ignored, as a shell does for what runs in the background, it stays so.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _leave)


def start() -> None:
    """Run the command line and leave with its exit code, soon where it was interrupted."""
    from pyharness.cli import interruption
    from pyharness.cli.main import main

    interruption.leave(interruption.run_interruptible(main))


if __name__ == "__main__":
    start()
