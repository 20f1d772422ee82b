"""The command line, and the functions that write its text to stdout and stderr."""

import sys
from contextlib import suppress
from typing import TextIO

from pyharness.model.errors import printable

# Control characters that are not escaped: they separate lines, columns and pages. A printer page
# (TAPE6) of the programs may contain a form feed.
_LAYOUT = "\n\t\f"


def shown(text: str) -> str:
    """Return a text with its control characters as escape sequences.

    Line breaks, tabs and form feeds are kept. Names in a text may come from third-party files, and
    their control characters could change the state of a terminal. All reports and messages are
    therefore passed through this function.
    """
    return printable(text, _LAYOUT)


def write_text(stream: TextIO, text: str) -> None:
    """Write a text to a stream of this process.

    A character that the stream's encoding lacks is written as an escape sequence.
    """
    encoding = stream.encoding or "utf-8"
    stream.write(shown(text).encode(encoding, "backslashreplace").decode(encoding))


def say(text: str) -> None:
    """Write a text to stderr; an error in writing, for example if stderr is closed, is ignored."""
    with suppress(OSError, ValueError):
        write_text(sys.stderr, text)
        sys.stderr.flush()
