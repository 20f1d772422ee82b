"""The last omega of a scene by every entry point, and a ball, whose omega is an integral."""

from typing import Any

import numpy as np
import pytest

from pyharness import Scene, Stepper, prepare, solve, solve_many
from pyharness.model.trajectory import Array


def ball(torque: Any = None, omega: Any = (0.3, 0.0, 0.0)) -> Scene:
    given = {} if torque is None else {"torque": torque}
    return Scene("ball", omega, moments=(1.0, 1.0, 1.0), **given)


def ends_of(
    scene: Scene, end: float, tolerance: float = 1e-9, of_steps: float | None = None
) -> dict[str, Array]:
    """Return omega at the end (s) by the name of the entry point."""
    stepper, start = Stepper(scene, of_steps or tolerance), np.array(scene.omega)
    stepper.until(end)
    return {
        "solve": solve(scene, [end], tolerance=tolerance).omega[0],
        "dense output": solve(scene, end, tolerance=tolerance, dense_output=True).omega[-1],
        "prepare": np.asarray(prepare(scene, tolerance=tolerance)(start, end)),
        "solve_many": solve_many(scene, end, omega=[start], tolerance=tolerance).omega[0],
        "stepper": np.asarray(stepper.omega),
    }


def check_ends(found: dict[str, Array], wanted: Any, **limit: Any) -> None:
    """Compare omega at the end by every entry point with its true value."""
    for name, omega in found.items():
        assert omega == pytest.approx(wanted, **limit), name
