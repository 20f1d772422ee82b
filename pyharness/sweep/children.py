"""Child processes that ignore Ctrl-C and end with this process."""

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
    """Block Ctrl-C in all processes and threads that are started within this context.

    A terminal sends SIGINT to all its processes, but only the parent should react. The calling
    thread receives the signal when the context ends.
    """
    # Children inherit a blocked signal. Python would start the resource tracker with the first
    # child, and then unblock the signal.
    _start_tracker()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_tracker() -> None:
    """Start Python's resource tracker, without its warnings of leftover semaphores."""
    warning = "ignore:resource_tracker"
    sys.warnoptions.append(warning)
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.remove(warning)


def end_with_parent() -> None:
    """Start a thread that ends this process when its parent ends, for whatever reason.

    Without a parent in `multiprocessing`, no thread is started.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        # The sentinel is a pipe, whose other end the system closes at the parent's end.
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
