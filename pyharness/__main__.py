"""The entry point of `python -m pyharness` and of the command `pyharness`."""

import os
import signal


def _leave(*_: object) -> None:
    try:
        os.write(2, b"pyharness: interrupted\n")
    finally:
        os._exit(130)


# This comes before all other imports: until here, Ctrl-C ends in a traceback of the interpreter.
# A shell starts background processes with SIGINT ignored; it then stays ignored.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _leave)


def start() -> None:
    """Run the command line and exit with its exit status, promptly if it was interrupted."""
    from pyharness.cli import interruption
    from pyharness.cli.main import main

    interruption.leave(interruption.run_interruptible(main))


if __name__ == "__main__":
    start()
