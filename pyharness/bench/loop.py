"""Timing of prepared calls in interleaved rounds."""

import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from pyharness.checks.compare.timing import SLOW, Clock, seconds
from pyharness.model.progress import Progress

_Row = TypeVar("_Row")
Say = Callable[[str], None]  # receives the name of the current part


class Task(Protocol):
    """A task to measure, such as a workload; messages name it by `place`."""

    @property
    def place(self) -> str: ...


_Task = TypeVar("_Task", bound=Task)


@dataclass(frozen=True)
class Call(Generic[_Row]):
    """A call to be timed, and the row that records its time."""

    run: Callable[[], object] | None  # None if the call failed and is not timed
    clock: Clock
    row: Callable[..., _Row]  # returns the row from the keyword argument `seconds` (s or None)


def timed(
    tasks: Sequence[_Task],
    calls: Callable[[_Task, Say], Iterable[Call[_Row]]],
    progress: Progress,
    length: float,
    rounds: int,
    statistic: Callable[[Sequence[float]], float] = statistics.median,
    slow: float = SLOW,
) -> Iterator[_Row]:
    """Yield a row for each call that `calls` prepares for a task.

    The arguments from `length` on are as in `checks.compare.timing.seconds`.
    """
    for number, task in enumerate(tasks):

        def say(text: str, number: int = number, place: str = task.place) -> None:
            progress(number, len(tasks), f"{place}: {text}")

        found = list(calls(task, say))
        runs = [each.run for each in found if each.run]
        clocks = [each.clock for each in found if each.run]
        times = iter(seconds(runs, length, rounds, say, statistic, clocks, slow))
        for each in found:
            yield each.row(seconds=next(times) if each.run else None)
