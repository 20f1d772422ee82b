"""Processes that work for this one: they hear no Ctrl-C, and end when it does."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from multiprocessing import connection, resource_tracker


@contextlib.contextmanager
def deaf_children() -> Iterator[None]:
    """Let no process or thread that this thread starts meanwhile ever hear a Ctrl-C.

    A terminal sends it to all processes, and what follows is the business of this one. This thread
    hears it afterwards.
    """
    # What is blocked is so in children too. This process of Python's own would be started with the
    # first of them, and unblock it.
    _start_tracker()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_tracker() -> None:
    """Start the process that removes semaphores, without its warnings of what was left to it.

    After a Ctrl-C it outlives this process, and would write them below the line that ends it.
    """
    warning = "ignore:resource_tracker"
    sys.warnoptions.append(warning)
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.remove(warning)


def end_with_parent() -> None:
    """End this process as soon as the one that started it has ended, however that came about."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        # The other end of a pipe, which the system closes when the parent is gone.
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
