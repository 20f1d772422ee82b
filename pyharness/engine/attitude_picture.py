"""Pictures of an attitude, and an animation of a brick."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.engine.solve import solve
from pyharness.model.attitude import matrices
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory, turned_to_space

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ANIMATIONS = ("gif", "html")
_COLORS = ("#c1272d", "#0a7d3c", "#1f4e9e")  # of body axes 1, 2, 3
_PAUSE = 0.05  # s between frames; a GIF stores it in hundredths of a second
# Shortest and longest animation (s); between them it runs in true time.
_SHORTEST, _LONGEST = 2.0, 10.0
_EDGES = [
    (a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1
]  # of a brick, as pairs of corners; bit k of a corner's number is the sign of coordinate k


def draw_sphere(axes: Any, found: Trajectory) -> None:
    """Draw the paths in space of the body axes (ends: dots) and omega's direction (end: cross)."""
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


def check_animation(path: str, scene: Scene) -> None:
    """Raise InputError unless `path` ends in .gif or .html, and a brick has the scene's moments."""
    if _form(path) not in ANIMATIONS:
        raise InputError(f"--animate '{path}': unknown format; allowed: .gif, .html")
    if scene.changing is not None:
        raise InputError(
            "--animate: the scene's inertia changes with time, and a brick has constant moments; "
            "give constant moments"
        )
    if scene.moments is None:
        raise InputError(
            "--animate: the scene has no moments, which determine the brick that is drawn; "
            "give moments"
        )
    if scene.is_impossible:
        raise InputError(
            "--animate: one moment exceeds the sum of the others, so that no brick has these "
            "moments; give others"
        )


def animation(scene: Scene, method: str, tolerance: float | None, end: float, path: str) -> bytes:
    """Return an animated brick until `end` (s) as bytes, GIF or HTML by the ending of `path`.

    The brick has the scene's moments. A motion shorter than 2 s is stretched to 2 s, and one longer
    than 10 s is compressed to 10 s. Raise InputError if the motion overflows before `end`.
    """
    from matplotlib import rc_context
    from matplotlib.animation import FuncAnimation
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    seconds = min(_LONGEST, max(_SHORTEST, abs(end)))
    count = 1 + round(seconds / _PAUSE)
    seconds = (count - 1) * _PAUSE
    times = [end * n / (count - 1) for n in range(count)]
    found = solve(scene, times, method, tolerance, attitude=True)
    if not found.has_all_rows:
        raise InputError("--animate: the motion overflows before the end; use a shorter time")
    assert found.attitude is not None
    figure = Figure(figsize=(4.6, 4.9), dpi=80)
    update = _scene_of_brick(figure, scene, found, abs(end) / seconds)
    if _form(path) == "html":
        played = FuncAnimation(figure, update, frames=count, interval=1000.0 * _PAUSE)
        with rc_context({"animation.embed_limit": 100.0}):
            page = played.to_jshtml(default_mode="loop")
        head = f"<!doctype html><meta charset='utf-8'><title>{_escape(scene.name)}</title>"
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


def _scene_of_brick(figure: "Figure", scene: Scene, found: Trajectory, rate: float) -> Any:
    """Return the function that draws row n of `found` and returns the changed artists."""
    axes: Any = figure.add_axes((0.02, 0.02, 0.96, 0.86), projection="3d")
    _frame(axes)
    assert found.attitude is not None
    corners, turned = _brick(scene), matrices(found.attitude)
    omega = turned_to_space(found.attitude, found.omega)
    omega = omega / max(1e-300, np.linalg.norm(omega, axis=1).max())
    edges = [axes.plot([], [], [], color="black", linewidth=1.2)[0] for _ in _EDGES]
    arms = [axes.plot([], [], [], color=color, linewidth=2.0)[0] for color in _COLORS]
    (arrow,) = axes.plot([], [], [], color="0.4", linewidth=1.5, linestyle="--")
    pace = "true time"
    if abs(rate - 1.0) > 1e-9:
        pace = f"{rate:.3g} times as fast" if rate > 1.0 else f"{1.0 / rate:.3g} times as slow"
    title = figure.suptitle("", fontsize=9)

    def update(frame: int) -> list[Any]:
        at = corners @ turned[frame].T
        for line, (a, b) in zip(edges, _EDGES, strict=True):
            line.set_data_3d(*at[[a, b]].T)
        for axis, line in enumerate(arms):
            line.set_data_3d(*np.array([np.zeros(3), turned[frame][:, axis]]).T)
        arrow.set_data_3d(*np.array([np.zeros(3), omega[frame]]).T)
        title.set_text(f"{scene.name}\nt = {found.time[frame]:.3f} s, {pace}; dashed: omega")
        return [*edges, *arms, arrow]

    return update


def _brick(scene: Scene) -> Array:
    """Return the corners of a brick, (8, 3); each side is at least 1 % of the longest."""
    moments = np.array(scene.moments)
    sides = np.sqrt(np.maximum(0.0, moments.sum() - 2.0 * moments))
    sides = np.maximum(sides, 0.01 * sides.max())
    half = 0.9 * sides / np.linalg.norm(sides)
    signs = np.array([[1.0 if n >> k & 1 else -1.0 for k in range(3)] for n in range(8)])
    corners: Array = signs * half
    return corners


def _form(path: str) -> str:
    return Path(path).suffix.lstrip(".").lower()


def _escape(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;")
