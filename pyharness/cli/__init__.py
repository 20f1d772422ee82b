"""The command line, and functions that write its text and the progress bar."""

import sys
from contextlib import suppress
from typing import Any, TextIO

from pyharness.model.errors import printable

# Characters that `shown` does not escape: they separate lines, columns and printed pages.
_LAYOUT = "\n\t\f"
_bar: Any = None  # None if no progress bar is shown


def shown(text: str) -> str:
    """Return a text with control characters escaped."""
    return printable(text, _LAYOUT)


def write_text(stream: TextIO, text: str) -> None:
    """Write a text, escaping characters that the stream cannot encode."""
    encoding = stream.encoding or "utf-8"
    stream.write(shown(text).encode(encoding, "backslashreplace").decode(encoding))


def say(text: str) -> None:
    """Write a text to stderr, ignoring errors such as a closed stream."""
    with suppress(OSError, ValueError):
        write_text(sys.stderr, text)
        sys.stderr.flush()


class _Terminal:
    """A stream to stderr that ignores write errors."""

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)

    def write(self, text: str) -> None:
        with suppress(OSError, ValueError):
            sys.stderr.write(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            sys.stderr.flush()


def progress(done: int, total: int, what: str) -> None:
    """Show a progress bar on a terminal: `done` of `total` parts; `what` names the current part."""
    global _bar
    if not sys.stderr.isatty():
        return
    if _bar is None or _bar.total != total or done < _bar.n:
        end_progress()
        from tqdm import tqdm

        # No monitor thread, because this process may start other processes.
        tqdm.monitor_interval = 0
        _bar = tqdm(total=total, leave=False, dynamic_ncols=True, file=_Terminal())
    _bar.set_description_str(shown(what), refresh=False)
    _bar.update(done - _bar.n)


def end_progress() -> None:
    global _bar
    if _bar is not None:
        bar, _bar = _bar, None
        bar.close()
