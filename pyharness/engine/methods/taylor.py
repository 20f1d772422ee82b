"""Integration by Taylor series, with adapted order and step size."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pyharness.engine.steps.step_nodes import MOST_STEPS, STEP_NODES, steps_output
from pyharness.engine.system.kernel_input import normalized, trajectory_of
from pyharness.engine.system.recorded import is_recorded, kernel_tape, system_of
from pyharness.engine.system.switch_text import reason_of
from pyharness.model.attitude import IDENTITY
from pyharness.model.dense_output import NODES, Pieces
from pyharness.model.effort import advice
from pyharness.model.errors import WorkLimitError
from pyharness.model.extension import ENDS, GAVE_UP, extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import WITH_ALL_ROWS, Trajectory


def taylor(
    scene: Scene,
    times: Sequence[float],
    tolerance: float,
    effort: float = 1.0,
    with_steps: bool = False,
) -> Trajectory:
    """Return the trajectory of a scene at `times` (s) by Taylor series."""
    # The kernel reads the initial attitude in the first column, and writes a column for each time.
    n_attitudes = 0 if scene.attitude is None else len(times)
    joint = np.empty((4, n_attitudes + 1), order="F")
    joint[:, 0] = scene.attitude or IDENTITY
    n_own = len(scene.states)
    is_tape = is_recorded(scene) or scene.torque.in_space
    kernel = "tape_rows" if is_tape else "taylor_rows"
    given = (kernel_tape(system_of(scene)),) if is_tape else normalized(scene)
    work = np.array([effort, 0.0, -1.0, -1.0, 0.0, 0.0][: 5 + is_tape])
    most = MOST_STEPS if with_steps else 0
    ends = np.empty(most + 1)
    at_nodes = np.empty(((7 if n_attitudes else 3) + n_own, NODES, most + 1), order="F")
    room: dict[str, Any] = {"nodes": STEP_NODES, "n": len(at_nodes), "most": most, "ends": ends}
    room |= {"at_nodes": at_nodes, "n_nodes": NODES}
    if is_tape:
        own = np.zeros((n_own + 1, (len(times) if n_own else 0) + 1), order="F")
        own[:n_own, 0] = [each.start for each in scene.states]
        room |= {"own": own, "own_sizes": [*(each.scale for each in scene.states), 0.0]}
    rows, n_rows, status, steps, kept = getattr(extension(), kernel)(
        *given, scene.omega, times, tolerance,
        n_attitudes=n_attitudes, attitudes=joint, effort=work, **room,
    )  # fmt: skip
    if status == GAVE_UP:
        # After one step the kernel forecasts the work.
        how = "would exceed" if steps == 1 else "exceeded"
        count = "" if steps == 1 else f" after {steps} steps"
        raise WorkLimitError(
            f"taylor {how} its work limit before t = {{time}} s{count}; "
            + advice("use a shorter time or a larger tolerance", effort, work[1]),
            times[n_rows],
        )
    attitudes = joint[:, 1:] if n_attitudes else None
    ended = ENDS[status]
    more: dict[str, Any] = {}
    if n_own:
        more["own"] = own[:n_own, 1 : 1 + n_rows].T
    if is_tape and ended in ("sliding", "sensitive"):
        more["reason"] = reason_of(ended, work[1], int(work[5]))
    last = times[n_rows - 1] if n_rows else 0.0
    if 0 < kept <= most and 0.0 < abs(last) <= abs(ends[kept]):
        edges, values = ends[: kept + 1].copy(), at_nodes[:, :, :kept].T
        # A few steps must not keep the memory of many.
        values = values.copy() if kept < most // 16 else values
        if times[-1] < 0.0:
            edges, values = edges[::-1], values[::-1, ::-1]
        pieces = Pieces(edges, values)
        if ended not in WITH_ALL_ROWS:
            pieces = pieces.up_to(last)
        # The step in which a motion overflows has no polynomial.
        if ended in WITH_ALL_ROWS or np.isfinite(pieces.values).all():
            more["sol"] = steps_output(scene, pieces)
    return trajectory_of(
        times, rows, n_rows, status, steps, int(work[4]), work[2], work[3], attitudes, **more
    )
