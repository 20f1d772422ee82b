"""The report of `run`."""

from typing import Any

import numpy as np

from pyharness.model.listing import Listing
from pyharness.model.report import Column, Picture, Report, Table, digits
from pyharness.model.scene import Scene
from pyharness.model.scene_report import ending, heading
from pyharness.model.trajectory import Trajectory

_NUMBER = digits(".6g")
_TIMES = (
    Column("time", _NUMBER, unit="s"),
    Column("TIME", _NUMBER, unit="s", name="recorded_time"),
)
_OMEGA = tuple(Column(f"U{i}", _NUMBER, unit="rad/s", name=f"omega{i}") for i in (1, 2, 3))
_VELOCITY = tuple(Column(f"V{i}", _NUMBER, unit="m/s", name=f"velocity{i}") for i in (1, 2, 3))


def trajectory_report(
    scene: Scene, method: str, listing: Listing | None, title: str, trajectory: Trajectory
) -> Report:
    """Report one trajectory; `listing` is None for a method that is no program."""
    columns = [*_TIMES, *_OMEGA]
    parts = [trajectory.time, trajectory.recorded_time, trajectory.omega]
    if trajectory.velocity is not None:
        columns += _VELOCITY
        parts.append(trajectory.velocity)
    rows = np.column_stack(parts)
    numbers = Table(columns, rows)
    steps = np.arange(1, len(rows) + 1)
    counted = Table([Column("step", digits(".0f")), *columns], np.column_stack([steps, rows]))

    def record() -> dict[str, Any]:
        from pyharness.model.records import (
            build_record,
            ending_record,
            listing_record,
            scene_record,
        )

        velocity = trajectory.velocity
        return {
            "scene": scene_record(scene),
            "method": method,
            "listing": None if listing is None else listing_record(listing),
            "trajectory": {
                "time": trajectory.time.tolist(),
                "recorded_time": trajectory.recorded_time.tolist(),
                "omega": trajectory.omega.tolist(),
                "velocity": None if velocity is None else velocity.tolist(),
            },
            **ending_record(trajectory),
            "build": build_record(),
        }

    def draw() -> Picture:
        from pyharness.methods.picture import trajectory_picture

        return trajectory_picture(f"{scene.name}: {title}", trajectory, numbers)

    return Report(
        "run",
        text=[[*heading(scene), title], [counted], [ending(trajectory)]],
        record=record,
        data=numbers,
        pictures={"omega": draw},
    )
