"""Pictures of an attitude, and animations of a brick."""

import io
import os
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.attitude import matrices, turned_to_space
from pyharness.model.changing import Changing
from pyharness.model.distribution import check_package, install_command
from pyharness.model.errors import InputError, kind_of
from pyharness.model.output_files import check_writable, write_files
from pyharness.model.scene import breaks_triangle
from pyharness.model.values import Triple

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pyharness.model.trajectory import Trajectory

ANIMATIONS = ("gif", "html")
_COLORS = ("#c1272d", "#0a7d3c", "#1f4e9e")  # of body axes 1, 2, 3
_PAUSE = 0.05  # s between frames; a GIF stores it in hundredths of a second
# Shortest and longest animation (s); a motion of a length between them is shown in true time.
_SHORTEST, _LONGEST = 2.0, 10.0
_EDGES = [
    (a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1
]  # of a brick, as pairs of corners; bit k of a corner's number is the sign of coordinate k


def draw_sphere(axes: Any, found: "Trajectory") -> None:
    """Draw the directions of body axes and omega in space; dots and a cross mark the end."""
    assert found.attitude is not None
    _frame(axes)
    turned = matrices(found.attitude)
    for axis, color in enumerate(_COLORS):
        path = turned[:, :, axis]
        axes.plot(*path.T, color=color, linewidth=0.9, label=f"axis {axis + 1} of the body")
        axes.plot(*path[-1:].T, color=color, marker="o", markersize=4)
    omega = turned_to_space(found.attitude, found.omega)
    size = np.linalg.norm(omega, axis=1)
    omega = omega[size > 0.0] / size[size > 0.0, None]
    axes.plot(*omega.T, color="black", linewidth=1.3, label="omega: herpolhode")
    axes.plot(*omega[-1:].T, color="black", marker="x", markersize=5)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2, fontsize=8, frameon=False)
    axes.set_title("in space; dots and cross: the end", fontsize=9)


def _frame(axes: Any) -> None:
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 25), np.linspace(0.0, np.pi, 13))
    ball = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    axes.plot_wireframe(*ball, color="0.8", linewidth=0.4)
    axes.set_box_aspect((1, 1, 1), zoom=0.88)
    axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(-1, 1), xlabel="X", ylabel="Y", zlabel="Z")
    for each in (axes.xaxis, axes.yaxis, axes.zaxis):
        each.set_ticks([-1, 0, 1])
        each.pane.set_visible(False)


class _Motion(NamedTuple):
    name: str
    time: Array  # s, of each frame, (n,)
    omega: Array  # rad/s, about the axes of space, (n, 3)
    turned: Array  # rotation matrices from body to space, (n, 3, 3)
    corners: Array  # of the brick, about the body axes, (8, 3)


def check_animation(path: object, moments: Triple | Changing | None) -> str:
    """Return `path` as text; raise InputError for unknown formats, or if no brick has `moments`."""
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"animate: {kind_of(path)}; allowed: a path, as text or a Path")
    name = os.fsdecode(path)
    if _form(name) not in ANIMATIONS:
        raise InputError(f"animate '{name}': unknown format; allowed: .gif, .html")
    if isinstance(moments, Changing):
        raise InputError(
            "animate: the inertia changes with time, and a brick has constant moments; "
            "give constant moments"
        )
    if moments is None:
        raise InputError(
            "animate: the body has no moments, which determine the brick that is drawn; "
            "give moments"
        )
    if breaks_triangle(moments):
        raise InputError(
            "animate: one moment exceeds the sum of the others, so that no brick has these "
            "moments; give others"
        )
    check_package("matplotlib", "animate", install_command("plots"))
    check_writable(name, "animate")
    return name


def animate(found: "Trajectory", path: str | os.PathLike[str]) -> None:
    name = check_animation(path, found.moments)
    write_files({name: _animation(found, _form(name))}, "animate")


def _animation(found: "Trajectory", form: str) -> bytes:
    from matplotlib import rc_context
    from matplotlib.animation import FuncAnimation
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    first, last = _ends(found)
    seconds = min(_LONGEST, max(_SHORTEST, abs(last - first)))
    count = 1 + round(seconds / _PAUSE)
    motion = _motion(found, np.linspace(first, last, count))
    figure = Figure(figsize=(4.6, 4.9), dpi=80)
    update = _scene_of_brick(figure, motion, abs(last - first) / ((count - 1) * _PAUSE))
    if form == "html":
        played = FuncAnimation(figure, update, frames=count, interval=1000.0 * _PAUSE)
        with rc_context({"animation.embed_limit": 100.0}):
            page = played.to_jshtml(default_mode="loop")
        head = f"<!doctype html><meta charset='utf-8'><title>{escape(motion.name)}</title>"
        return (head + page).encode()
    canvas: Any = FigureCanvasAgg(figure)
    frames = []
    for frame in range(count):
        update(frame)
        canvas.draw()
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("P"))
    stream = io.BytesIO()
    frames[0].save(
        stream, "gif", save_all=True, append_images=frames[1:], duration=1000.0 * _PAUSE, loop=0
    )
    return stream.getvalue()


def _ends(found: "Trajectory") -> tuple[float, float]:
    ends = found.time[[0, -1]].tolist() if len(found.time) else [0.0, 0.0]
    if found.sol is not None:
        # If the rows are all before 0, the motion runs backward from 0.
        ends = [found.sol.t_min, found.sol.t_max][:: -1 if ends[1] < 0.0 else 1]
    if ends[0] == ends[1]:
        one = f"animate: the trajectory ({found.ended}) is at one time only"
        if found.sol is None:
            raise InputError(f"{one}; give two or more times that it reaches, or dense_output=True")
        raise InputError(f"{one}; give times other than 0 that it reaches")
    return ends[0], ends[1]


def _motion(found: "Trajectory", times: Array) -> _Motion:
    attitude, omega = found.attitude, found.omega
    assert attitude is not None
    if found.sol is not None:
        states = found.sol(times)
        omega, attitude = states[:3].T, states[3:7].T
    else:
        order = np.argsort(found.time)
        between = 0.5 * (found.time[order][1:] + found.time[order][:-1])
        rows = order[np.searchsorted(between, times)]
        times, omega, attitude = found.time[rows], omega[rows], attitude[rows]
    name = "" if found.scene is None else found.scene.name
    omega = turned_to_space(attitude, omega)
    return _Motion(name, times, omega, matrices(attitude), _brick(found))


def _scene_of_brick(figure: "Figure", motion: _Motion, rate: float) -> Any:
    axes: Any = figure.add_axes((0.02, 0.02, 0.96, 0.86), projection="3d")
    _frame(axes)
    corners, turned = motion.corners, motion.turned
    omega = motion.omega / max(1e-300, np.linalg.norm(motion.omega, axis=1).max())
    edges = [axes.plot([], [], [], color="black", linewidth=1.2)[0] for _ in _EDGES]
    arms = [axes.plot([], [], [], color=color, linewidth=2.0)[0] for color in _COLORS]
    (arrow,) = axes.plot([], [], [], color="0.4", linewidth=1.5, linestyle="--")
    pace = "true time"
    if abs(rate - 1.0) > 1e-9:
        pace = f"{rate:.3g} times as fast" if rate > 1.0 else f"{1.0 / rate:.3g} times as slow"
    title = figure.suptitle("", fontsize=9, parse_math=False)
    name = f"{motion.name}\n" if motion.name else ""

    def update(frame: int) -> list[Any]:
        at = corners @ turned[frame].T
        for line, (a, b) in zip(edges, _EDGES, strict=True):
            line.set_data_3d(*at[[a, b]].T)
        for axis, line in enumerate(arms):
            line.set_data_3d(*np.array([np.zeros(3), turned[frame][:, axis]]).T)
        arrow.set_data_3d(*np.array([np.zeros(3), omega[frame]]).T)
        title.set_text(f"{name}t = {motion.time[frame]:.3f} s, {pace}; dashed: omega")
        return [*edges, *arms, arrow]

    return update


def _brick(found: "Trajectory") -> Array:
    moments = np.array(found.moments)
    sides = np.sqrt(np.maximum(0.0, moments.sum() - 2.0 * moments))
    sides = np.maximum(sides, 0.01 * sides.max())
    half = 0.9 * sides / np.linalg.norm(sides)
    signs = np.array([[1.0 if n >> k & 1 else -1.0 for k in range(3)] for n in range(8)])
    corners: Array = signs * half if found.axes is None else signs * half @ found.axes.T
    return corners


def _form(path: str) -> str:
    return Path(path).suffix.lstrip(".").lower()
