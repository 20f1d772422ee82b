"""What is said on stderr: for the user's eyes, without a say in how a command ends."""

import os
import sys


def say(text: str) -> None:
    """Write to stderr; where it is full or closed, fall silent for good."""
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except (OSError, ValueError):
        # Python would try the rest again at its end, and change the exit code.
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115  (as long as the process)
