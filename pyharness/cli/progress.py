"""One progress bar for all verbs, on standard error if that is a terminal."""

import sys
from contextlib import suppress
from typing import Any

from pyharness.cli import shown

_bar: Any = None  # the bar that is on the terminal


class _Terminal:
    """Standard error, without the errors of one that is full or closed."""

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)

    def write(self, text: str) -> None:
        """Write a text."""
        with suppress(OSError, ValueError):
            sys.stderr.write(text)

    def flush(self) -> None:
        """Write what is buffered."""
        with suppress(OSError, ValueError):
            sys.stderr.flush()


def progress(done: int, total: int, what: str) -> None:
    """Show the completed part of a computation, the current part, and the time to go."""
    global _bar
    if not sys.stderr.isatty():
        return
    if _bar is None or _bar.total != total or done < _bar.n:
        end_progress()
        from tqdm import tqdm

        # Its thread would watch for bars that stand still, and this process may start others.
        tqdm.monitor_interval = 0
        _bar = tqdm(total=total, leave=False, dynamic_ncols=True, file=_Terminal())
    _bar.set_description_str(shown(what), refresh=False)
    _bar.update(done - _bar.n)


def end_progress() -> None:
    """Remove the bar from the terminal."""
    global _bar
    if _bar is not None:
        bar, _bar = _bar, None
        bar.close()
