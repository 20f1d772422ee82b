"""The command line."""

import sys
from contextlib import suppress


def say(text: str) -> None:
    """Write to stderr, where that is not full or closed: it has no say in how a command ends."""
    with suppress(OSError, ValueError):
        sys.stderr.write(text)
        sys.stderr.flush()
