"""What is said on stderr: for the user's eyes, without a say in how a command ends."""

import sys
from contextlib import suppress


def say(text: str) -> None:
    """Write to stderr, where that is not full or closed."""
    with suppress(OSError, ValueError):
        sys.stderr.write(text)
        sys.stderr.flush()
