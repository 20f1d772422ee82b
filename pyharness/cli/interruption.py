"""Ctrl-C on the command line: one line and exit code 130, whenever it comes.

A KeyboardInterrupt can come between any two instructions, and not all code lets it through: an
import may turn it into another error, a finalizer or a callback drops it. So what counts is that
the signal came, not which exception arrives; and one that was dropped is raised again.
"""

import atexit
import contextlib
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from types import FrameType
from typing import Any, TextIO

from pyharness.cli import say, say_again

_AGAIN = 0.25  # s, after which a dropped interrupt is raised again
_MOST = 3  # of them, by the user, until nothing is waited for any more
_PATIENCE = 2.0  # s, for what is tidied up when a process ends
CODE = 130
LINE = "pyharness: interrupted\n"


class _Interruption:
    """How often the user interrupted, whether that was reported, and what happens when it comes."""

    def __init__(self) -> None:
        self.count = 0
        self.is_reported = False

    def leave_at_once(self, *_: object) -> None:
        """End the process now: nothing was begun that would have to be tidied up."""
        try:
            if not self.is_reported:
                os.write(2, LINE.encode())
        finally:
            os._exit(CODE)

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Raise KeyboardInterrupt, and see to it that it is not dropped."""
        self.count += 1
        if self.count >= _MOST:
            self.leave_at_once()
        signal.signal(signal.SIGALRM, self._again)
        signal.setitimer(signal.ITIMER_REAL, _AGAIN, _AGAIN)
        raise KeyboardInterrupt

    def _again(self, *_: object) -> None:
        # Who has another handler for a while is not to be disturbed.
        is_ours = signal.getsignal(signal.SIGINT) == self.interrupt
        if is_ours and not self.is_reported and not _is_on_its_way():
            raise KeyboardInterrupt


_STATE = _Interruption()
_SHOW_WARNING = warnings.showwarning


def came() -> bool:
    """Return whether the user has interrupted this command."""
    return _STATE.count > 0


def leave_when_interrupted() -> bool:
    """Let Ctrl-C end the process at once, with its line; return False where it is ignored.

    It is for times in which nothing has to be tidied up: while modules are imported, and after the
    results are written.
    """
    # A shell starts what runs in the background with the signal ignored, and so it stays.
    if not callable(signal.getsignal(signal.SIGINT)):
        return False
    signal.signal(signal.SIGINT, _STATE.leave_at_once)
    return True


def run_interruptible(main: Callable[[], int]) -> int:
    """Return the exit code of a command, 130 where the user has interrupted it."""
    hook, escaped, code = sys.unraisablehook, False, CODE
    try:
        sys.unraisablehook = _quiet_of(hook)
        warnings.showwarning = _show_warning
        if callable(signal.getsignal(signal.SIGINT)):
            signal.signal(signal.SIGINT, _STATE.interrupt)
        code = main()
    except BaseException as error:
        # What an interrupt became on its way is no error of its own.
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
    """Say in one line that the command was interrupted, and return its exit code."""
    if not _STATE.is_reported:
        _STATE.is_reported = came()
        say_again("")  # wipes how far it was
        say(LINE)
    return CODE


def leave(code: int) -> None:
    """End the process with an exit code; temporary files are removed before.

    Python itself would wait for threads, free all memory piece by piece, and drop an interrupt, or
    die by its signal. After an interrupt nothing is waited for, neither processes nor threads.
    """
    if code == CODE:
        # The line is written; what threads and finalizers have to say of their end is no news.
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
    os._exit(code)


def _is_on_its_way() -> bool:
    """Return whether a KeyboardInterrupt is being handled: what runs now is tidying up."""
    error: BaseException | None = sys.exception()
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__context__
    return False


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    # Other threads may go on a little, and what was begun is not finished: no news to the user.
    if not came():
        _SHOW_WARNING(message, category, filename, lineno, file, line)


def _quiet_of(hook: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return the hook of errors that nobody can catch, without a word on interrupts."""

    def told(unraisable: Any) -> None:
        if not (came() and issubclass(unraisable.exc_type, KeyboardInterrupt)):
            hook(unraisable)

    return told
