"""Prepared solvers in several threads: own answers, and nothing that is left behind."""

import copy
import gc
import sys
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Scene, Solver, case_scene, prepare
from pyharness.engine.prepared.compiled_call import check_call
from pyharness.model.trajectory import Array
from tests.engine.test_prepared import RUNAWAY


@pytest.mark.campaign
def test_call_leaks_no_reference() -> None:
    solver, start, out = prepare(case_scene(2)), np.array([0.0, 1.0, 10.0]), np.empty(3)
    single = start.astype("f4")

    def left_behind() -> int:
        for _ in range(200):
            solver(start, 1.0)
            solver(start, 1.0, out=out)
            solver([0.0, 1.0, Fraction(1)], 1, out=None)
            solver(single, 1.0)
            with suppress(InputError):
                solver(start, None)  # type: ignore[arg-type]
            copy.copy(solver)(start, 1.0)
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    left_behind()
    watched = solver, start, out, check_call, solver.plan, Solver
    counts = [sys.getrefcount(each) for each in watched]
    tracemalloc.start()
    left = [left_behind() for _ in range(4)]
    tracemalloc.stop()
    # An object for each call would be five thousand bytes at least; other code leaves a few.
    assert min(after - before for before, after in pairwise(left)) < 3000
    assert [sys.getrefcount(each) for each in watched] == counts


@pytest.fixture
def _hasty() -> Iterator[None]:
    """Let the interpreter switch threads at every opportunity."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def in_threads(count: int, work: Callable[[int], Any]) -> list[Any]:
    """Call `work` in `count` threads, all at once, each with its own number."""
    gate = threading.Barrier(count)

    def begin(number: int) -> Any:
        gate.wait()
        return work(number)

    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(begin, range(count)))


@pytest.mark.usefixtures("_hasty")
@pytest.mark.parametrize("shared", [True, False])
def test_threads_at_once_get_their_own_answers(shared: bool) -> None:
    """Test status, steps and results; of 18 000 calls 134 were once wrong."""
    scene = Scene("", (1.0, 1.0, 1.0), moments=(3.0, 2.0, 1.0), step_size=0.01)
    # The times are long enough for two kernels to run at once.
    calls = [(np.full(3, 1.0 + k), t) for k in range(4) for t in (0.05, 10.0, 40.0, 1e300)]

    def answer(solver: Solver, call: tuple[Array, float]) -> tuple[bytes, str, int]:
        return solver(*call).tobytes(), solver.status, solver.steps

    solver = prepare(scene, "rk4")
    wanted = [answer(solver, call) for call in calls]
    ends = {("complete", 5), ("complete", 1000), ("complete", 4000), ("gave up", 0)}
    assert {each[1:] for each in wanted} == ends

    def work(number: int) -> int:
        own = solver if shared else prepare(scene, "rk4")
        out, wrong = np.empty(3), 0
        for k in range(1000):
            at = (k * (number + 1) + number) % len(calls)
            found = own(*calls[at], out=out) if k % 2 else own(*calls[at])
            wrong += (found.tobytes(), own.status, own.steps) != wanted[at]
        return wrong

    assert in_threads(6, work) == [0] * 6


def test_status_is_of_the_threads_own_last_call() -> None:
    solver = prepare(RUNAWAY, "taylor", 1e-9)
    assert np.isnan(solver(RUNAWAY.omega, 2.0)).all()
    steps = solver.steps
    assert (solver.status, steps > 1) == ("overflow", True)

    def work(number: int) -> tuple[str, int, str]:
        before = solver.status, solver.steps
        solver(RUNAWAY.omega, 0.01)
        return *before, solver.status

    # A new thread may have the address of an ended one, and must not get its status.
    for _ in range(20):
        assert in_threads(4, work) == [("complete", 0, "complete")] * 4
    assert (solver.status, solver.steps) == ("overflow", steps)


def test_many_threads_leave_nothing_behind() -> None:
    solver = prepare(case_scene(5))
    start = np.ones(3)
    solver(start, 1.0)
    size = sys.getsizeof(solver)
    for _ in range(200):
        thread = threading.Thread(target=solver, args=(start, 1.0))
        thread.start()
        thread.join()
    assert sys.getsizeof(solver) < size + 300
    in_threads(50, lambda number: solver(start, 1.0))
    assert size + 1500 < sys.getsizeof(solver) < size + 15000
