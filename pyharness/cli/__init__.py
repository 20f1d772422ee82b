"""The command line, and the functions that write its text to stdout and stderr."""

import sys
from contextlib import suppress
from typing import TextIO

from pyharness.model.errors import printable

# Control characters of lines and columns; a page of TAPE6 may contain a form feed.
_LAYOUT = "\n\t\f"


def shown(text: str) -> str:
    """Return a text with its control characters replaced by escape sequences.

    Names may come from third-party files and command lines, and their control characters could
    steer a terminal. Reports and messages are therefore written through this function.
    """
    return printable(text, _LAYOUT)


def write_text(stream: TextIO, text: str) -> None:
    """Write a text to a stream of this process.

    A character that the stream's encoding lacks is written as an escape sequence.
    """
    encoding = stream.encoding or "utf-8"
    stream.write(shown(text).encode(encoding, "backslashreplace").decode(encoding))


def say(text: str) -> None:
    """Write a text to stderr; a failure to write, as to a closed stderr, is ignored."""
    with suppress(OSError, ValueError):
        write_text(sys.stderr, text)
        sys.stderr.flush()
