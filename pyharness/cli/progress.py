"""The progress bar, shown if standard error is a terminal."""

import sys
from contextlib import suppress
from typing import Any

from pyharness.cli import shown

_bar: Any = None  # the progress bar on the terminal; None if there is none


class _Terminal:
    """A wrapper of standard error that ignores errors in writing."""

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)

    def write(self, text: str) -> None:
        with suppress(OSError, ValueError):
            sys.stderr.write(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            sys.stderr.flush()


def progress(done: int, total: int, what: str) -> None:
    """Show the completed part of the work, its current part, and the remaining time."""
    global _bar
    if not sys.stderr.isatty():
        return
    if _bar is None or _bar.total != total or done < _bar.n:
        end_progress()
        from tqdm import tqdm

        # Otherwise tqdm would start a monitor thread, but this process may start other processes.
        tqdm.monitor_interval = 0
        _bar = tqdm(total=total, leave=False, dynamic_ncols=True, file=_Terminal())
    _bar.set_description_str(shown(what), refresh=False)
    _bar.update(done - _bar.n)


def end_progress() -> None:
    """Remove the progress bar, if there is one."""
    global _bar
    if _bar is not None:
        bar, _bar = _bar, None
        bar.close()
