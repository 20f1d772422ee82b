"""Ctrl-C: it ends every kernel at once, and leaves the interpreter as it was."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from types import ModuleType

import numpy as np
import pytest
import scipy.integrate  # noqa: F401  (an interrupt within its import may be lost)

from pyharness import Scene, prepare, run_many, solve, solve_many, torques
from pyharness.model import extension as room
from pyharness.model.extension import extension
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.thesis.compiled import run
from tests.cli.interrupts import hearing
from tests.conftest import Patch

# An idle machine needs some hundredths of a second; uninterrupted, each call takes many seconds.
PATIENCE = 1.5

FREE = Scene("free", (0.3, 1.1, 2.7), moments=(40.0, 30.0, 20.0))
PUSHED = replace(FREE, torque=TorqueLaw(constant=(1.0, 2.0, 3.0)))


def _waves(count: int) -> tuple[Wave, ...]:
    return tuple(((1.0 / count, 0.5 / count, 0.0), 1.0 + n / count) for n in range(count))


DRIVEN = replace(FREE, torque=TorqueLaw(sines=_waves(3)))
CROWDED = replace(FREE, torque=TorqueLaw(sines=_waves(15_000)))
IN_SPACE = replace(PUSHED, torque=TorqueLaw((1.0, 2.0, 3.0), frame="space"))
RECORDED = replace(FREE, torque=torques.wheels((1.0, 2.0, 3.0)))
SPHERE = replace(CROWDED, moments=(40.0, 40.0, 40.0))
BUSY = replace(FREE, torque=TorqueLaw(cosines=_waves(300)), step_size=1e-6, steps=1_000_000)
UNIT = (1.0, 0.0, 0.0, 0.0)
TIMES = [0.001 * n for n in range(1, 50_000)]


def _method(scene: Scene, name: str, time: float, tolerance: float = 1e-12) -> Callable[[], object]:
    return lambda: solve(scene, [time], name, tolerance, effort=1e6)


def _prepared(scene: Scene, name: str, time: float, tolerance: float) -> Callable[[], object]:
    solver = prepare(scene, name, tolerance, effort=1e6)
    return lambda: solver(np.array(scene.omega), time)


def _linear() -> object:
    matrix = np.eye(2500, order="F") + 0.001
    return room.extension().solve_linear(matrix, matrix[:, :1])


def _many(program: str, threads: int) -> object:
    starts = np.full((64, 3), BUSY.omega)
    return run_many(
        BUSY, Listing.corrected(program), omega=starts, may_stop=False, threads=threads, effort=1e9
    )


def _bodies(method: str, threads: int) -> object:
    starts = np.full((2000, 3), PUSHED.omega)
    return solve_many(
        PUSHED, 1e6, omega=starts, method=method, step=1e-4, threads=threads, effort=1e6
    )


def _alone(attitude: object) -> object:
    """Return bodies that the single-body kernel solves in one step each."""
    starts = np.full((3000, 3), CROWDED.omega)
    return solve_many(CROWDED, 1e-3, omega=starts, tolerance=1e-12, threads=1, attitude=attitude)


LONG: dict[str, Callable[[], object]] = {
    "taylor": _method(PUSHED, "taylor", 1e5),
    "taylor-waves": _method(CROWDED, "taylor", 1e5),
    "space-torque": lambda: solve(IN_SPACE, [1e5], effort=1e6, attitude=True),
    "recorded": _method(RECORDED, "taylor", 1e9),
    "recorded-prepared": _prepared(RECORDED, "taylor", 1e9, 1e-12),
    "quick": _prepared(FREE, "quick", 1e6, 1e-6),
    "quick-waves": _prepared(DRIVEN, "quick", 1e6, 1e-6),
    "prepared-series": _prepared(CROWDED, "auto", 1e6, 1e-12),
    "rk4": _method(replace(PUSHED, step_size=1e-7), "rk4", 1e3, 1.0),
    "rk4-waves": _method(replace(CROWDED, step_size=1e-4), "rk4", 1e3, 1.0),
    "improved-euler": _method(replace(DRIVEN, step_size=1e-7), "improved-euler", 1e3, 1.0),
    "rk4-short-steps": lambda: solve(
        replace(CROWDED, step_size=1.0), TIMES, "rk4", 1.0, effort=1e6
    ),
    "gauss-1": _method(DRIVEN, "gauss-1", 1e3, 1e-8),
    "gauss-8": _method(CROWDED, "gauss-8", 1e5),
    "sphere": lambda: solve(SPHERE, TIMES, "closed-form", 1e-12, effort=1e6),
    **{name: partial(run, BUSY, Listing.corrected(name), may_stop=False) for name in PROGRAMS},
    **{f"many-{name}": partial(_many, name, 1) for name in PROGRAMS},
    "many-threads": partial(_many, "four-term", 2),
    **{f"bodies-{name}": partial(_bodies, name, 1) for name in ("taylor", "rk4", "gauss-2")},
    "bodies-threads": partial(_bodies, "taylor", 2),
    "bodies-recorded": lambda: solve_many(
        RECORDED, 200.0, omega=np.full((60_000, 3), RECORDED.omega), tolerance=1e-6, threads=1
    ),
    **{f"bodies-alone-{name}": partial(_alone, q) for name, q in (("omega", None), ("q", UNIT))},
    "linear-solver": _linear,
    "dop853": _method(PUSHED, "dop853", 1e4, 1e-3),
    "lsoda": _method(PUSHED, "lsoda", 1e4, 1e-3),
    "radau": _method(PUSHED, "radau", 1e4, 1e-3),
    "reference": _method(PUSHED, "reference", 1e4),
}
# Methods of SciPy, in Python, or prepared before: they do not call kernels through `extension`.
DOORLESS = [
    *("dop853", "lsoda", "radau", "reference"),
    *("quick", "quick-waves", "prepared-series", "recorded-prepared"),
]


class _Keyboard:
    """A keyboard that presses Ctrl-C once, a while after the first call of `press`."""

    pressed = 0.0

    def press(self) -> None:
        if not self.pressed:
            self.pressed = time.perf_counter() + 0.1
            signal.setitimer(signal.ITIMER_REAL, 0.1)

    def door(self) -> ModuleType:
        """Return the extension, and press: the time before the call of a kernel does not count."""
        self.press()
        return extension()


@pytest.fixture
def keyboard() -> Iterator[_Keyboard]:
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    yield _Keyboard()
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.sampled
@pytest.mark.parametrize("name", LONG)
def test_kernel_ends_at_once(name: str, keyboard: _Keyboard, monkeypatch: Patch) -> None:
    methods = [f"engine.methods.{each}" for each in ("taylor", "closed_form", "gauss")]
    rooms = [f"engine.prepared.many_{each}" for each in ("laws", "scenes", "tape", "prepared")]
    for each in (*methods, *rooms, "thesis.compiled", "thesis.many", "model.extension"):
        monkeypatch.setattr(f"pyharness.{each}.extension", keyboard.door)
    if name in DOORLESS:
        keyboard.press()
    with pytest.raises(KeyboardInterrupt):
        LONG[name]()
    assert -0.02 < time.perf_counter() - keyboard.pressed < PATIENCE


def test_interpreter_and_solver_go_on(keyboard: _Keyboard) -> None:
    """The interrupted solver returns the same bits afterwards."""
    solver, start = prepare(PUSHED, "taylor", effort=1e6), np.array(PUSHED.omega)
    wanted = solver(start, 2.0)
    keyboard.press()
    with pytest.raises(KeyboardInterrupt):
        solver(start, 1e5)
    np.testing.assert_array_equal(solver(start, 2.0), wanted)
    assert solver.status == "complete"


@pytest.mark.campaign
def test_other_threads_are_not_disturbed(keyboard: _Keyboard) -> None:
    """Python raises the signal in the main thread: a kernel in another thread runs to its end."""
    wanted = solve(PUSHED, [5e3], "taylor")
    with ThreadPoolExecutor(1) as pool:
        found = pool.submit(solve, PUSHED, [5e3], "taylor")
        keyboard.press()
        with pytest.raises(KeyboardInterrupt):
            time.sleep(60.0)
    np.testing.assert_array_equal(found.result().omega, wanted.omega)


@pytest.mark.campaign
def test_handler_that_does_not_raise_runs_on_the_way(keyboard: _Keyboard) -> None:
    wanted = solve(PUSHED, [5e3], "taylor")
    calls: list[float] = []
    signal.signal(signal.SIGALRM, lambda *_: calls.append(time.perf_counter()))
    signal.setitimer(signal.ITIMER_REAL, 0.01)
    found = solve(PUSHED, [5e3], "taylor")
    assert time.perf_counter() - calls[0] > 0.01
    np.testing.assert_array_equal(found.omega, wanted.omega)


def test_command_line_says_so_in_a_line() -> None:
    """Run all commands side by side, and interrupt each some time after its start."""
    commands = (
        "run --case 5 --method taylor --times 1e5 --effort 1e6",
        "compare --case 5 --steps 100000 --effort 1e6",
        "stress --only threads",
    )
    start = "print(flush=True); from pyharness.__main__ import start; start()"
    pipe = subprocess.PIPE
    with hearing():
        running = [
            subprocess.Popen(
                [sys.executable, "-c", start, *each.split()], stdout=pipe, stderr=pipe, text=True
            )
            for each in commands
        ]
    for each in running:
        assert each.stdout is not None
        each.stdout.readline()
    time.sleep(0.5)
    pressed = time.perf_counter()
    for each in running:
        each.send_signal(signal.SIGINT)
    try:
        for command, each in zip(commands, running, strict=True):
            _, said = each.communicate(timeout=60)
            assert (each.returncode, said) == (130, "pyharness: interrupted\n"), command
            assert time.perf_counter() - pressed < 2.0 * PATIENCE, command
    finally:
        for each in running:
            each.kill()
            each.communicate()


def test_interrupted_while_the_command_line_is_read_in() -> None:
    """An import may call `exec`, after which Python remembers the signal and would die by it."""
    code = (
        "import sys, pyharness.__main__ as m; from types import ModuleType\n"
        "def main(): exec('raise KeyboardInterrupt')\n"
        "sys.modules['pyharness.cli.main'] = cli = ModuleType('cli'); cli.main = main; m.start()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "pyharness: interrupted\n")
