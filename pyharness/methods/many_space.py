"""Many bodies as a scene for each: torques about the axes of space, and full inertia matrices.

Torques about the axes of space are solved one body after the other, by prepared solvers.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.methods.many_scenes import waves_of
from pyharness.methods.many_starts import for_each_piece, numbers_of, rows_of, times_of
from pyharness.methods.prepared import prepare
from pyharness.methods.registry import check_torque
from pyharness.model.codes import Statuses
from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS
from pyharness.model.scene import Scene, TorqueLaw, Triple
from pyharness.model.trajectory import Array

_REST: Triple = (0.0, 0.0, 0.0)
NO_ATTITUDE = (
    "the torque is about the axes of space, and no attitude is given; allowed: attitude0, scenes "
    "with an attitude, or a torque about the axes of the body"
)


@dataclass(frozen=True, eq=False)
class SpaceBodies:
    """Bodies for a call each: arrays of one row are shared by all."""

    n: int
    scene_of: Callable[[int], Scene]  # an InputError of a body refuses that body alone
    omega0: Array
    attitude0: Array
    times: Array

    def solve(
        self, method: str, tolerance: float, effort: float, threads: int
    ) -> tuple[Array, NDArray[np.int8], Array]:
        """Return angular velocities, statuses and attitudes."""
        omega, attitude = np.full((self.n, 3), np.nan), np.full((self.n, 4), np.nan)
        status = np.full(self.n, Statuses.REFUSED, np.int8)

        def enter(piece: slice, given_up: NDArray[np.int32]) -> None:
            for i in range(piece.start, piece.stop):
                if given_up[0]:
                    return
                try:
                    solver = prepare(self.scene_of(i), method, tolerance, effort, attitude=True)
                    start, turn = _row(self.omega0, i), _row(self.attitude0, i)
                    omega[i], attitude[i] = solver(start, float(_row(self.times, i)), turn)
                except InputError:
                    continue
                status[i] = ENDS.index(solver.status)

        for_each_piece(enter, self.n, threads)
        return omega, status, attitude


def acts_in_space(scene: Scene, arrays: Iterable[object]) -> bool:
    """Whether a torque about the axes of space acts: that of a scene, or arrays in its frame."""
    named = any(each is not None for each in arrays)
    return scene.torque.in_space or (scene.torque.frame == "space" and named)


def space_bodies(scene: Scene, t_end: Any, method: str, arrays: dict[str, Any]) -> SpaceBodies:
    """Return the bodies of a scene and of arrays, None where `solve_many` was given no array."""
    check_torque(scene, method, attitude=True)
    if arrays["coefficients"] is not None or scene.coefficients is not None:
        raise InputError(
            "the torque is about the axes of space, and bodies are given by coefficients; allowed: "
            "moments or inertia"
        )
    attitude0 = scene.attitude if arrays["attitude0"] is None else arrays["attitude0"]
    if attitude0 is None:
        raise InputError(NO_ATTITUDE)
    omega0 = scene.omega if arrays["omega0"] is None else arrays["omega0"]
    rows = _rows(arrays)
    rows["omega0"], rows["attitude0"] = (
        rows_of("omega0", omega0, 3),
        rows_of("attitude0", attitude0, 4),
    )
    rows["t_end"] = times_of(t_end)
    n = _count(rows)

    def scene_of(i: int) -> Scene:
        return replace(_scene_of(scene, rows, i, "space"), omega=_REST, attitude=None)

    return SpaceBodies(n, scene_of, rows["omega0"], rows["attitude0"], rows["t_end"])


def inertia_scenes(scene: Scene, arrays: dict[str, Any]) -> list[Scene | None]:
    """Return a scene for each full inertia matrix or torque; None for a body that is none."""
    rows = _rows(arrays)
    found: list[Scene | None] = []
    for i in range(_count(rows) if rows else 1):
        try:
            found.append(_scene_of(scene, rows, i, "body"))
        except InputError:
            found.append(None)
    return found


def _rows(arrays: dict[str, Any]) -> dict[str, Array]:
    """Return the arrays of bodies and torques, those of one row shared by all."""
    rows = {
        name: rows_of(name, arrays[name], 3)
        for name in ("moments", "torque_constant", "torque_rate")
        if arrays[name] is not None
    }
    for name in ("sines", "cosines"):
        if arrays[name] is not None:
            rows[name] = waves_of(name, arrays[name])
    if arrays["inertia"] is not None:
        found = numbers_of("inertia", arrays["inertia"])
        if found.ndim not in (2, 3) or found.shape[-2:] != (3, 3):
            raise InputError(f"inertia: shape {found.shape}; allowed: (3, 3) or (n, 3, 3)")
        rows["inertia"] = found.reshape(-1, 3, 3)
    return rows


def _count(rows: dict[str, Array]) -> int:
    """Return how many bodies there are; InputError for arrays that do not fit together."""
    counts = {len(each) for each in rows.values()}
    n = 0 if 0 in counts else max(counts)
    for name, each in rows.items():
        if len(each) not in (1, n):
            raise InputError(
                f"{name}: {len(each)} rows; allowed: 1, or as many as there are bodies, {n}"
            )
    return n


def _scene_of(scene: Scene, rows: dict[str, Array], i: int, frame: str) -> Scene:
    own = {name: _row(each, i) for name, each in rows.items()}
    law = scene.torque
    torque = TorqueLaw(
        own.get("torque_constant", law.constant),
        own.get("torque_rate", law.rate),
        _waves(own["sines"]) if "sines" in own else law.sines,
        _waves(own["cosines"]) if "cosines" in own else law.cosines,
        frame,
    )
    body: dict[str, Any] = {}
    if "moments" in own or "inertia" in own:
        body = {
            "moments": own.get("moments"), "inertia": own.get("inertia"), "coefficients": None,
        }  # fmt: skip
    return replace(scene, torque=torque, **body)


def _waves(rows: Array) -> list[tuple[Array, float]]:
    return [(row[:3], float(row[3])) for row in rows]


def _row(array: Array, i: int) -> Any:
    return array[0 if len(array) == 1 else i]
