"""The methods with a fixed step for torques that depend on omega or attitude, in Python.

They are the methods of `pyharness.methods.fixed_step`: equations 29 to 31 of the thesis. The state
is omega, followed by the attitude if the scene has one. The right-hand side is the tape of the
equations of motion, evaluated in plain floats.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from pyharness.methods.problem import trajectory_of
from pyharness.methods.recorded import system
from pyharness.model.codes import Statuses
from pyharness.model.effort import advice
from pyharness.model.errors import TimedError
from pyharness.model.scene import Scene
from pyharness.model.tape import ATTITUDE, FLOATS, N_INPUTS, OMEGA, TIME, Tape, evaluate
from pyharness.model.tape_derivative import with_derivatives
from pyharness.model.trajectory import Trajectory

State = list[float]
Step = Callable[[float, State, float], State]

# Work limit (s), and the times in microseconds that a right-hand side and an operation take.
_MOST_SECONDS = 10.0
_WORK, _OPERATION_WORK = 6.0, 0.5
# The last step may be longer by this fraction, as in fortran/modern/fixed_step.f90.
_EXCESS = 1e-6
_EVALUATIONS = {"improved-euler": 2, "taylor-3": 2, "rk4": 4}


def fixed_state(name: str, scene: Scene, times: Sequence[float], effort: float = 1.0) -> Trajectory:
    """Return the trajectory of a scene with a recorded torque by a method with a fixed step.

    `name` is ``improved-euler``, ``taylor-3`` or ``rk4``. The step size is that of the scene. A
    step that would pass one of `times` (s) is shortened. The trajectory ends early where omega
    overflows or the torque is singular. Attitudes are normalised. `effort` multiplies the work
    limit of some ten seconds. Raise InputError for an opaque torque, and if the steps would take
    longer.
    """
    tape = system(scene)
    step, n_operations = _step(name, tape)
    lengths = np.diff(np.array(times), prepend=0.0)
    counts = np.maximum(1.0, np.trunc(np.abs(lengths) / scene.step_size + (1.0 - _EXCESS)))
    each = _EVALUATIONS[name] * (_WORK + _OPERATION_WORK * n_operations) * 1e-6
    needed = float(counts.sum()) * each / _MOST_SECONDS
    if not needed <= effort:
        raise TimedError(
            f"{name}: {abs(times[-1]) / scene.step_size:.3g} steps of {{time}} s would take too "
            "long; " + advice("use a larger step or a shorter time", effort, needed),
            scene.step_size,
        )
    state: State = [*scene.omega, *(scene.attitude or ())]
    rows = np.full((len(times), len(state)), math.nan)
    n_rows, begin, steps, status = 0, 0.0, 0, Statuses.COMPLETE
    for row, (end, count) in enumerate(zip(times, counts.astype(int).tolist(), strict=True)):
        h = math.copysign(scene.step_size, end - begin)
        try:
            for done in range(count - 1):
                state = step(begin + done * h, state, h)
            last = begin + (count - 1) * h
            state = step(last, state, end - last)
        except (ZeroDivisionError, OverflowError):
            state = [math.nan]
        steps += count
        if not all(map(math.isfinite, state)):
            status = Statuses.OVERFLOW
            break
        rows[row], n_rows, begin = state, row + 1, end
    attitudes = None
    if scene.attitude is not None:
        attitudes = rows[:, 3:].T / np.linalg.norm(rows[:, 3:], axis=1)
    evaluations = _EVALUATIONS[name] * steps
    return trajectory_of(
        times, rows[:, :3].T, n_rows, status, steps, evaluations, attitudes=attitudes
    )


def _step(name: str, tape: Tape) -> tuple[Step, int]:
    """Return the function that takes one step, and the operations of a right-hand side.

    The arguments of the function are the time (s), the state and the step size (s).
    """
    m = len(tape.outputs)
    unused = [0.0] * (N_INPUTS - 1 - m)

    def slopes(time: float, state: State) -> State:
        return evaluate(tape, [time, *state, *unused], FLOATS)

    def improved_euler(time: float, y: State, h: float) -> State:
        k1 = slopes(time, y)
        k2 = slopes(time + h, _moved(y, h, k1))
        return [x + 0.5 * h * (a + b) for x, a, b in zip(y, k1, k2, strict=True)]

    def rk4(time: float, y: State, h: float) -> State:
        k1 = slopes(time, y)
        k2 = slopes(time + 0.5 * h, _moved(y, 0.5 * h, k1))
        k3 = slopes(time + 0.5 * h, _moved(y, 0.5 * h, k2))
        k4 = slopes(time + h, _moved(y, h, k3))
        terms = zip(y, k1, k2, k3, k4, strict=True)
        return [x + h / 6.0 * (a + 2.0 * (b + c) + d) for x, a, b, c, d in terms]

    if name == "improved-euler":
        return improved_euler, len(tape.operations)
    if name == "rk4":
        return rk4, len(tape.operations)
    slots = (TIME, *OMEGA, *ATTITUDE)[: m + 1]
    derivatives = with_derivatives(tape, slots)

    def taylor_3(time: float, y: State, h: float) -> State:
        found = evaluate(derivatives, [time, *y, *unused], FLOATS)
        k = found[:m]
        # The derivative of the slopes along the solution: with respect to time, and to the state.
        along = [1.0, *k]
        rates = [
            sum(a * b for a, b in zip(found[begin : begin + m + 1], along, strict=True))
            for begin in range(m, len(found), m + 1)
        ]
        return [x + h * (a + 0.5 * h * b) for x, a, b in zip(y, k, rates, strict=True)]

    return taylor_3, len(derivatives.operations)


def _moved(state: State, h: float, slopes: State) -> State:
    return [x + h * k for x, k in zip(state, slopes, strict=True)]
