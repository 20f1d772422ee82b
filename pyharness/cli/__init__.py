"""The command line, and the functions that write its text to a stream."""

import sys
from contextlib import suppress
from typing import TextIO

from pyharness.model.errors import printable

# Control characters of lines and columns; a page of TAPE6 may contain a form feed.
_LAYOUT = "\n\t\f"


def shown(text: str) -> str:
    """Return a text in the form in which this program writes it to a terminal or a file.

    Names may come from third-party files and command lines. Their control characters could steer a
    terminal, and are replaced by escape sequences; no other function does this.
    """
    return printable(text, _LAYOUT)


def write_text(stream: TextIO, text: str) -> None:
    """Write a text to a stream of this process.

    A character that the stream's encoding lacks is written as an escape sequence.
    """
    encoding = stream.encoding or "utf-8"
    stream.write(shown(text).encode(encoding, "backslashreplace").decode(encoding))


def say(text: str) -> None:
    """Write to stderr; a failure, as of a full or closed stderr, does not end the command."""
    with suppress(OSError, ValueError):
        write_text(sys.stderr, text)
        sys.stderr.flush()
