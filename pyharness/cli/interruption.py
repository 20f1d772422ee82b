"""Interruption: Ctrl-C ends a command with a one-line message and exit status 130.

Python may lose a KeyboardInterrupt: an import may replace it by another exception, and a finalizer
or callback may drop it. This module therefore records the signal, and raises the exception again.
"""

import atexit
import contextlib
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import Any

from pyharness.cli import end_progress, say

_AGAIN = 0.25  # time (s) after which a dropped interrupt is raised again
_MOST = 3  # number of interrupts after which the process ends at once
_PATIENCE = 2.0  # longest time (s) of an interrupted process's cleanup
CODE = 130
LINE = "pyharness: interrupted\n"


class _Interruption:
    def __init__(self) -> None:
        self.count = 0
        self.is_reported = False

    def leave_at_once(self, *_: object) -> None:
        """End the process without cleanup, and print LINE if not yet done."""
        try:
            if not self.is_reported:
                os.write(2, LINE.encode())
        finally:
            os._exit(CODE)

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Raise KeyboardInterrupt or, at the third interrupt, end the process at once."""
        self.count += 1
        if self.count >= _MOST:
            self.leave_at_once()
        # The timer repeats the exception until the interrupt is reported.
        signal.signal(signal.SIGALRM, self._again)
        signal.setitimer(signal.ITIMER_REAL, _AGAIN, _AGAIN)
        raise KeyboardInterrupt

    def _again(self, *_: object) -> None:
        # Do not interrupt code with its own handler of SIGINT.
        is_ours = signal.getsignal(signal.SIGINT) == self.interrupt
        if is_ours and not self.is_reported and not _is_pending():
            raise KeyboardInterrupt


_STATE = _Interruption()
_SHOW_WARNING = warnings.showwarning


def came() -> bool:
    return _STATE.count > 0


def leave_when_interrupted() -> bool:
    """Make Ctrl-C end the process at once; return False if SIGINT is ignored.

    Call this only while nothing needs cleanup.
    """
    # Shells start background processes with SIGINT ignored, which must remain so.
    if not callable(signal.getsignal(signal.SIGINT)):
        return False
    signal.signal(signal.SIGINT, _STATE.leave_at_once)
    return True


def run_interruptible(main: Callable[[], int]) -> int:
    """Run a command; return its exit status, or 130 if interrupted."""
    hook, escaped, code = sys.unraisablehook, False, CODE
    try:
        sys.unraisablehook = partial(_report_unraisable, hook)
        warnings.showwarning = _show_warning
        if callable(signal.getsignal(signal.SIGINT)):
            signal.signal(signal.SIGINT, _STATE.interrupt)
        code = main()
    except BaseException as error:
        # Any exception after an interrupt counts as a consequence.
        if not came() and not isinstance(error, KeyboardInterrupt):
            raise
        escaped = True
    leave_when_interrupted()
    if came() or escaped:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        report()
        return CODE
    return code


def report() -> int:
    """Print LINE, at most once, and return 130."""
    if not _STATE.is_reported:
        _STATE.is_reported = came()
        end_progress()
        say(LINE)
    return CODE


def leave(code: int) -> None:
    """Remove temporary files and end the process with exit status `code`.

    If `code` is 130, kill child processes.
    """
    if code == CODE:
        # Suppress messages of ending threads and finalizers.
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        if "multiprocessing" in sys.modules:
            import multiprocessing

            for child in multiprocessing.active_children():
                child.kill()
        tidying = threading.Thread(target=atexit._run_exitfuncs, daemon=True)
        tidying.start()
        tidying.join(_PATIENCE)
    else:
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):
            stream.flush()
    # Python's own exit would wait for threads, and Ctrl-C might be ignored or kill the process.
    os._exit(code)


def _is_pending() -> bool:
    error: BaseException | None = sys.exception()
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__context__
    return False


def _show_warning(*arguments: Any, **more: Any) -> None:
    # Suppress warnings from other threads and unfinished work after an interrupt.
    if not came():
        _SHOW_WARNING(*arguments, **more)


def _report_unraisable(hook: Callable[[Any], Any], unraisable: Any) -> None:
    if not (came() and issubclass(unraisable.exc_type, KeyboardInterrupt)):
        hook(unraisable)
