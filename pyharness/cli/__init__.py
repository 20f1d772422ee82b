"""The command line."""

import sys
from contextlib import suppress
from typing import TextIO

from pyharness.model.errors import printable

# What lines and columns are made of; a page of TAPE6 may hold a form feed.
_LAYOUT = "\n\t\f"
_WIPED = "\r\x1b[K"


def shown(text: str) -> str:
    """Return a text as this program writes it, to a terminal or a file.

    Names come from files and command lines of others: what in them steers a terminal is written as
    an escape sequence, here and nowhere else.
    """
    return printable(text, _LAYOUT)


def write_text(stream: TextIO, text: str, before: str = "") -> None:
    """Write to a stream of this process; what its encoding lacks as an escape sequence.

    `before` is our own, and may steer a terminal.
    """
    encoding = stream.encoding or "utf-8"
    stream.write(before + shown(text).encode(encoding, "backslashreplace").decode(encoding))


def say(text: str, before: str = "") -> None:
    """Write to stderr, where that is not full or closed: it has no say in how a command ends."""
    with suppress(OSError, ValueError):
        write_text(sys.stderr, text, before)
        sys.stderr.flush()


def say_again(text: str) -> None:
    """Write a line to stderr in place of the one before, where that is a terminal."""
    if sys.stderr.isatty():
        say(text, _WIPED)
