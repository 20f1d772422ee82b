"""The entry point of `python -m pyharness` and of the command `pyharness`."""

# `signal` would import other modules too, which takes some 10 ms.
import _signal as signal  # type: ignore[import-not-found]  # noqa: PLC2701
import os


def _leave(*_: object) -> None:
    try:
        os.write(2, b"pyharness: interrupted\n")
    finally:
        os._exit(130)


# The handler precedes all other imports, during which Ctrl-C would print the interpreter's
# traceback. A shell starts background processes with SIGINT ignored, which must remain so.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _leave)


def start() -> None:
    """Run the command line, and exit with its status."""
    from pyharness.cli import interruption
    from pyharness.cli.main import main

    interruption.leave(interruption.run_interruptible(main))


if __name__ == "__main__":
    start()
