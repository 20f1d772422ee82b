"""The data of the page that animates a torque-free body.

Without JavaScript, the page shows a picture, and a Python program with its output.
"""

import contextlib
import io
from fractions import Fraction
from typing import Any

import numpy as np

from pyharness.checks.theory.flips import flip_times
from pyharness.engine.solve import solve
from pyharness.model.facts import facts
from pyharness.model.report import Picture, numbers
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory, turned_to_space
from pyharness.views.pictures import saved

PROGRAM = """\
from pyharness import Scene, solve

body = Scene("Case 4", omega=(0, 1, 10), moments=(40, 30, 20))
found = solve(body, [1.0, 1e3, 1e6], "closed-form", attitude=True)
print(found.omega.round(6))
print(found.attitude.round(6))
"""
"""Program shown on the page, which solves Case 4 of the thesis."""

AGREEMENT = 2e-15
"""Largest difference between closed-form solutions by the page's script and by Fortran.

It applies to each component of the attitude, and to omega relative to its largest component.
"""

SPEEDS = (0.1, 0.25, 0.5, 1, 2, 10, 100, 1000)
"""Speeds that the page offers, in seconds of motion per second."""

_FLIPS = 3.0  # duration of the motion, in times between flips
_POINTS = 601
_COLOURS = ("#1040a0", "#b02018", "#107040")
_STYLES = ("-", "--", "-.")


def context() -> dict[str, Any]:
    """Return the values for the page's template; `flip` is the time between flips (s)."""
    first = _first()
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(PROGRAM, {})
    flips = [float(flip_times(x.moments or (), x.omega)[0]) for x in (first, case_scene(4))]
    times = dict(zip(("flip", "case_4_flip"), flips, strict=True))
    shown = {"program": PROGRAM, "output": printed.getvalue()}
    limits = {"agreement": AGREEMENT, "speeds": SPEEDS}
    return {"data": data(), "first": first} | times | shown | limits


def data() -> dict[str, Any]:
    """Return the page's bodies (kg m2, rad/s), the name of the first, and the largest time (s)."""
    known = facts("bodies")
    bodies: list[dict[str, Any]] = []
    for each in known["body"]:
        moments = moments_of_box(each["edges"], each["mass"])
        named = {"id": each["id"], "title": each["title"], "case": None}
        bodies.append(named | {"moments": moments, "omega": each["omega"]})
    for number, scene in zip(known["cases"], map(case_scene, known["cases"]), strict=True):
        named = {"id": f"case-{number}", "title": f"Case {number}: {scene.name}", "case": number}
        bodies.append(named | {"moments": scene.moments, "omega": scene.omega})
    return {"bodies": bodies, "first": known["first"], "longest": known["longest"]}


def moments_of_box(edges: list[float], mass: float) -> list[float]:
    """Return the moments (kg m2) of a homogeneous box with `edges` (m) and `mass` (kg)."""
    squares = [Fraction(str(edge)) ** 2 for edge in edges]
    twelfth = Fraction(str(mass)) / 12
    return [float(twelfth * (sum(squares) - square)) for square in squares]


def files() -> dict[str, bytes]:
    return saved(_picture(_first()), "body.svg")


def _first() -> Scene:
    given = data()
    (found,) = [each for each in given["bodies"] if each["id"] == given["first"]]
    return Scene(found["title"], found["omega"], moments=found["moments"])


def _picture(scene: Scene) -> Picture:
    from matplotlib.figure import Figure

    assert scene.moments is not None
    end = _FLIPS * float(flip_times(scene.moments, scene.omega)[0])
    times = np.linspace(0.0, end, _POINTS)
    found = solve(scene, times.tolist(), "closed-form", attitude=True)
    figure = Figure(figsize=(11.0, 3.7), layout="constrained")
    over_time = figure.add_subplot(1, 3, 1)
    ball = figure.add_subplot(1, 3, 2, projection="3d")
    plane = figure.add_subplot(1, 3, 3)
    for axis, (colour, style) in enumerate(zip(_COLOURS, _STYLES, strict=True)):
        label = f"$\\omega_{axis + 1}$"
        over_time.plot(times, found.omega[:, axis], style, color=colour, label=label)
    over_time.set(title="omega about the body's axes", xlabel="time (s)", ylabel="rad/s")
    over_time.legend(loc="upper right", fontsize=8)
    over_time.grid(visible=True, linewidth=0.3)
    _draw_polhode(ball, np.array(scene.moments), found)
    path = _in_plane(found)
    plane.plot(*path.T, color="black", linewidth=0.9)
    plane.plot(*path[:1].T, "o", color="black", markersize=4)
    plane.set(title="herpolhode", xlabel="rad/s", aspect="equal")
    rows = np.column_stack([times, found.omega, path])
    return Picture(figure, numbers("time,s omega1,rad/s omega2 omega3 x y", rows.tolist()))


def _draw_polhode(axes: Any, moments: Array, found: Trajectory) -> None:
    size = np.sqrt(moments @ np.square(found.omega[0]) / moments)
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 33), np.linspace(0.0, np.pi, 17))
    ball = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    ellipsoid = [length * each for length, each in zip(size, ball, strict=True)]
    axes.plot_wireframe(*ellipsoid, color="0.8", linewidth=0.4)
    axes.plot(*found.omega.T, color="black", linewidth=1.5)
    limits = {f"{name}lim": (-length, length) for name, length in zip("xyz", size, strict=True)}
    axes.set(title="polhode", **limits)
    axes.set_box_aspect(size, zoom=1.2)
    axes.view_init(elev=24.0, azim=-30.0)
    axes.set_axis_off()


def _in_plane(found: Trajectory) -> Array:
    """Return omega's components (rad/s) in the plane normal to the angular momentum, (n, 2)."""
    assert found.attitude is not None
    momentum = found.angular_momentum("space")[0]
    up = momentum / np.linalg.norm(momentum)
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    first /= np.linalg.norm(first)
    across = np.column_stack([first, np.cross(up, first)])
    return np.asarray(turned_to_space(found.attitude, found.omega) @ across)
