"""The reports of the commands `run` and `plan`, and the picture of a trajectory."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.assumptions import assumption_records
from pyharness.model.attitude import IDENTITY
from pyharness.model.fields import ROWS
from pyharness.model.listing import Listing
from pyharness.model.report import Column, Picture, Report, Table, digits, words
from pyharness.model.scene import Scene
from pyharness.model.scene_report import ending, estimates, heading, scene_title
from pyharness.model.trajectory import Array, Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pyharness.engine.plan.plan import Plan
    from pyharness.truth.bounded import ErrorBound

_NUMBER = digits(".6g")
_ATTITUDE = {
    "3-1-3": tuple(Column(name, _NUMBER, unit="deg") for name in ("phi", "theta", "psi")),
    "3-2-1": tuple(Column(name, _NUMBER, unit="deg") for name in ("yaw", "pitch", "roll")),
    "matrix": tuple(
        Column(f"R{i}{j}", _NUMBER, name=f"R{i}{j}") for i in (1, 2, 3) for j in (1, 2, 3)
    ),
}
_POINTS = 2001  # of a curve from dense output, at least
_MOST_MARKS = 100  # points marked on such a curve
_END: dict[str, Any] = {
    "color": "black", "marker": "x", "linestyle": "none", "clip_on": False, "zorder": 5,
}  # fmt: skip


def trajectory_report(
    scene: Scene,
    method: str,
    listing: Listing | None,
    title: str,
    trajectory: Trajectory,
    form: str = "quaternion",  # of the attitude; or 3-1-3, 3-2-1, matrix
    word: str | None = None,  # a thesis program's arithmetic; None is binary64
    bound: "ErrorBound | None" = None,
) -> Report:
    printed = {name: each for name, each in ROWS.items() if each.heads}
    blocks: list[tuple[tuple[Column, ...], Array]] = []
    for name, each in printed.items():
        values, names = getattr(trajectory, name), zip(each.heads, each.columns, strict=True)
        if name == "attitude" and values is not None and form in _ATTITUDE:
            blocks.append((_ATTITUDE[form], _shown(values, form)))
        elif values is not None:
            unit = each.unit if each.unit != "1" else ""
            columns = tuple(Column(head, _NUMBER, unit=unit, name=name) for head, name in names)
            blocks.append((columns, values))
    states = trajectory.states
    blocks += [((Column(name, _NUMBER, name=name),), states[name]) for name in states]
    shown = [column for each, _ in blocks for column in each]
    rows = np.column_stack([values for _, values in blocks])
    numbers = Table(shown, rows)
    steps = np.arange(1, len(rows) + 1)
    # A terminal has the width for a matrix's nine elements and the time alone.
    kept = [0, *range(5, len(shown))] if form == "matrix" else list(range(len(shown)))
    counted = Table(
        [Column("step", digits(".0f")), *(shown[k] for k in kept)],
        np.column_stack([steps, rows[:, kept]]),
    )

    bounds: list[str] = []
    if bound is not None:
        bounds.append(f"reference: error of any omega at most {bound.text()}")
        if bound.turned is not None:
            bounds.append(f"reference: error of any attitude at most {bound.turned.text('rad')}")
        bounds += [f"WARNING: {bound.warning}"] if bound.warning else []

    def record() -> dict[str, Any]:
        from pyharness.model import records

        singular = 0 if trajectory.ier is None else int(np.count_nonzero(trajectory.ier))
        arrays = {name: getattr(trajectory, name) for name in printed}
        return {
            "scene": records.scene_record(scene),
            "method": method,
            "listing": None if listing is None else records.listing_record(listing),
            **({} if word is None else {"word": word}),
            "trajectory": {
                **{name: None if x is None else x.tolist() for name, x in arrays.items()},
                **({"states": {name: x.tolist() for name, x in states.items()}} if states else {}),
                "tolerance": trajectory.tolerance,
                **records.estimate_record(trajectory),
            },
            **({} if bound is None else {"reference_bound": bound.record()}),
            **records.ending_record(trajectory),
            **({"reason": trajectory.reason} if trajectory.reason else {}),
            **({"singular_steps": singular} if singular else {}),
            "build": records.build_record(),
            "assumptions": assumption_records([(scene, [listing] if listing else [])]),
        }

    return Report(
        "run",
        text=[
            [*heading(scene, filter(None, [listing])), title],
            [counted],
            [ending(trajectory), *estimates(trajectory), *bounds],
        ],
        record=record,
        data=numbers,
        pictures={"omega": lambda: _picture(f"{scene_title(scene)}: {title}", trajectory, numbers)},
    )


def _shown(attitude: Array, form: str) -> Array:
    from pyharness.model.attitude import SEQUENCES, angles, matrices

    if form in SEQUENCES:
        return angles(attitude, form)
    return matrices(attitude).reshape(-1, 9)


def _picture(title: str, trajectory: Trajectory, numbers: Table) -> Picture:
    from matplotlib.figure import Figure

    has_attitude = trajectory.attitude is not None and len(trajectory.time) > 0
    figure = Figure(figsize=(12.5 if has_attitude else 7.0, 7.0), dpi=110, layout="constrained")
    curve = _dense(trajectory)
    has_marks = len(trajectory.time) == 1 or (
        curve is not trajectory and len(trajectory.time) <= _MOST_MARKS
    )
    style: dict[str, Any] = {"color": "black", "linewidth": 1.2}
    marks: dict[str, Any] = {"color": "black", "linestyle": "", "marker": ".", "markersize": 5}
    note = f"x: {ending(trajectory)}" if not trajectory.has_all_rows else ""
    left: Any = figure
    if has_attitude:
        from pyharness.model.attitude_picture import draw_sphere

        parts: Any = figure.subfigures(1, 2, width_ratios=(7.0, 5.5))
        left, right = parts
        draw_sphere(right.add_subplot(projection="3d"), curve)
    labels = [*(f"$\\omega_{row + 1}$ (rad/s)" for row in range(3)), *trajectory.states]
    axes = left.subplots(len(labels), 1, sharex=True)
    paths = [np.column_stack([x.omega, *x.states.values()]) for x in (curve, trajectory)]
    for row, label in enumerate(labels):
        if len(curve.time) > 1:
            axes[row].plot(curve.time, paths[0][:, row], **style)
        if has_marks:
            axes[row].plot(trajectory.time, paths[1][:, row], **marks)
        if note and row < 3:
            mark_end(axes[row], trajectory, row)
        axes[row].set_ylabel(label, parse_math=row < 3)
        axes[row].grid(visible=True, linewidth=0.3)
    axes[-1].set_xlabel("time (s)")
    return Picture(figure, numbers, (title, note))


def _dense(trajectory: Trajectory) -> Trajectory:
    sol = trajectory.sol
    if sol is None or sol.t_min == sol.t_max:
        return trajectory
    times = np.linspace(sol.t_min, sol.t_max, max(_POINTS, len(trajectory.time)))
    omega, *rest = np.split(sol(times).T, [3, 3 if trajectory.attitude is None else 7], axis=1)
    attitude, own = (x if x.size else None for x in rest)
    return replace(trajectory, time=times, omega=omega, attitude=attitude, own=own)


def mark_end(axes: "Axes", trajectory: Trajectory, row: int) -> None:
    """Draw a cross where a component ends, or at the edge if the end is outside."""
    bottom, top = axes.get_ylim()
    axes.plot(trajectory.time[-1:], np.clip(trajectory.omega[-1:, row], bottom, top), **_END)
    axes.set_ylim(bottom, top)


def plan_report(scene: Scene, plan: "Plan") -> Report:
    table = Table(
        words("part computed why"),
        [[part, "yes" if kept else "no", why] for part, kept, why in plan.decisions],
    )

    def record() -> dict[str, Any]:
        from pyharness.model.records import scene_record

        decisions = [each._asdict() for each in plan.decisions]
        found = {"method": plan.method, "closed_form": plan.closed_form, "decisions": decisions}
        supplied = assumption_records([(scene, [])])
        return {"scene": scene_record(scene), "plan": found, "assumptions": supplied}

    head = [*heading(scene), f"method: {plan.method}"]
    return Report("plan", text=[head, [table]], record=record, data=table)


def trajectory_bound(scene: Scene, found: Trajectory, effort: float = 1.0) -> "ErrorBound | None":
    """Return a `reference` trajectory's error bound, proved or estimated; None if not finite."""
    from pyharness.truth.bounded import error_bound

    start = None if found.attitude is None else scene.attitude or IDENTITY
    scene = replace(scene, attitude=start)
    largest = max(*map(abs, scene.omega), float(np.abs(found.omega).max(initial=0.0)))
    claimed = math.inf if found.error is None else found.error
    bound = error_bound(
        scene,
        found.time,
        found.omega,
        claimed * (largest or 1.0),
        found.attitude,
        claimed,
        any_torque=True,
        effort=effort,
    )
    if bound.angle is not None and not math.isfinite(bound.angle):
        bound = bound._replace(angle=None, angle_basis=None)
    return bound if math.isfinite(bound.value) else None
