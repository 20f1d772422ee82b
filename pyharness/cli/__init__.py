"""The command line, and functions that write its text."""

import sys
from contextlib import suppress
from typing import TextIO

from pyharness.model.errors import printable

# Control characters that are not escaped, because they separate lines, columns and pages. TAPE6, a
# printer page of the programs, may contain a form feed.
_LAYOUT = "\n\t\f"


def shown(text: str) -> str:
    """Return a text with control characters, as in third-party names, escaped."""
    return printable(text, _LAYOUT)


def write_text(stream: TextIO, text: str) -> None:
    """Write a text, escaping characters that the stream can't encode."""
    encoding = stream.encoding or "utf-8"
    stream.write(shown(text).encode(encoding, "backslashreplace").decode(encoding))


def say(text: str) -> None:
    """Write a text to stderr, ignoring errors such as a closed stream."""
    with suppress(OSError, ValueError):
        write_text(sys.stderr, text)
        sys.stderr.flush()
