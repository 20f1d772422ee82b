"""The report of the command `rotations`, with a picture of polhodes and growth rates."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.checks.theory.rotations import (
    Rates,
    SteadyRotation,
    SteadyRotations,
    steady_rotations,
)
from pyharness.model.assumptions import assumption_records
from pyharness.model.records import build_record, scene_record
from pyharness.model.report import Column, Picture, Report, Section, Table, digits, numbers, words
from pyharness.model.scene import Scene, Triple
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.scene_report import heading, scene_title
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array

_TIMES = ("doubling_time", "period", "flip_interval", "linear_until")
_FULL = (
    "place omega1 omega2 omega3 rate1_re rate1_im rate2_re rate2_im rate3_re rate3_im stable "
    + " ".join(_TIMES)
)
_KEY = (
    "w1 to w3: omega of the rotation, rad/s. stable: whether no perturbation grows, neither as "
    "exp(Q t) nor as t. doubling, period: time in which a perturbation doubles, and its period, s. "
    "flips: shortest time between flips, s. linear: time after which the linear approximation has "
    "an error of a tenth, s. Q: rates of equation 32, 1/s."
)


def rotations_report(scene: Scene, found: SteadyRotations) -> Report:
    perturbed = f"perturbation: {found.disturbance:g} of the rotation"
    text: list[Section] = [[*heading(scene), perturbed], [found.told]]
    if found.rotations:
        text += [[_KEY], [_table(found.rotations)]]
    return Report(
        "rotations",
        text=text,
        record=lambda: {
            "scene": scene_record(scene),
            "told": found.told,
            "disturbance": found.disturbance,
            "rotations": [_record(each) for each in found.rotations],
            "build": build_record(),
            "assumptions": assumption_records([(scene, [])]),
        },
        data=numbers(_FULL, [_row(each) for each in found.rotations]),
        pictures={"rotations": partial(rotations_picture, scene)},
    )


def _table(rotations: Sequence[SteadyRotation]) -> Table:
    columns = [
        *words("rotation"),
        *(Column(f"w{axis}", digits(".4g")) for axis in (1, 2, 3)),
        Column("stable", lambda stable: "yes" if stable else "no", left=True),
        *(Column(head, digits(".3g")) for head in ("doubling", "period", "flips", "linear")),
        Column("Q", _rates, left=True, fit="wrap"),
    ]
    rows = [[each.place, *each.omega, each.stable, *_times(each), each.rates] for each in rotations]
    return Table(columns, rows)


def _rates(rates: Rates) -> str:
    first, second, third = rates
    if not any(rates):
        return "0"
    if second == 0.0 and first == -third:
        return f"0, +-{_complex(first)}"
    if second == third.conjugate() and second.imag:
        return f"{first.real:.4g}, {_complex(second)}"
    if first == second.conjugate() and first.imag:
        return f"{_complex(first)}, {third.real:.4g}"
    return ", ".join(_complex(each) for each in rates)


def _complex(rate: complex) -> str:
    if rate.imag == 0.0:
        return f"{rate.real:.4g}"
    return f"{rate.real:.4g}+-{rate.imag:.4g}i" if rate.real else f"{rate.imag:.4g}i"


def _times(each: SteadyRotation) -> list[float | None]:
    return [getattr(each, name) for name in _TIMES]


def _row(each: SteadyRotation) -> list[Any]:
    parts = [part for rate in each.rates for part in (rate.real, rate.imag)]
    return [each.place, *each.omega, *parts, each.stable, *_times(each)]


def _record(each: SteadyRotation) -> dict[str, Any]:
    return {
        "place": each.place,
        "omega": list(each.omega),
        "rates": [[rate.real, rate.imag] for rate in each.rates],
        "stable": each.stable,
        **dict(zip(_TIMES, _times(each), strict=True)),
    }


if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Direction to the viewer: components along the axes of the smallest, which points upwards, middle
# and largest moment.
_VIEW = np.array([0.36, 0.72, 0.60])
_GRID = 101
_HIDDEN = 0.22  # opacity of curves behind the sphere
_SEPARATRIX: dict[str, Any] = {"color": "#c02020", "linewidth": 1.8}
_POLHODE: dict[str, Any] = {"color": "#1040a0", "linewidth": 0.9}
_MIDDLES = {(0.72, -0.36): 2, (-0.5, 0.5): 2, (0.7, 0.3): 1, (-0.7, -0.3): 1, (0.3, 0.7): 3,
            (-0.3, -0.7): 3}  # fmt: skip
# Largest angle (rad) of each curve from the axis that it encircles; 90 degrees on the separatrix.
_ANGLES = tuple(math.radians(degrees) for degrees in (18.0, 36.0, 54.0, 72.0))
_POINTS = 181


def rotations_picture(scene: Scene) -> Picture:
    """Return a picture of a scene's polhodes, and of growth rates about all bodies' middle axes.

    The scene must have moments.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.9), dpi=100, layout="constrained")
    sphere, square = figure.subplots(1, 2)
    rows = _sphere(sphere, scene) + _square(square, scene)
    return Picture(figure, numbers("panel curve x y z", rows), [scene_title(scene)])


def _sphere(axes: "Axes", scene: Scene) -> list[list[Any]]:
    assert scene.moments is not None
    rows = []
    low, middle, high = np.eye(3)[np.argsort(scene.moments, kind="stable")]
    toward = _VIEW @ [low, middle, high] / np.linalg.norm(_VIEW)
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.fill(np.cos(turn), np.sin(turn), facecolor="#f4f4f4", edgecolor="#909090", linewidth=0.8)
    for name, curve in polhodes(scene.moments):
        style = _SEPARATRIX if name == "separatrix" else _POLHODE
        x, y, near = _project(curve, low, toward)
        for shown, opacity in ((near >= 0.0, 1.0), (near <= 0.0, _HIDDEN)):
            line = np.where(shown, x, np.nan), np.where(shown, y, np.nan)
            axes.plot(*line, alpha=opacity, **style)
        rows += [["sphere", name, *point] for point in curve.tolist()]
    free = replace(scene, torque=TorqueLaw(), omega=(0.0, 0.0, 1.0))
    for axis, each in enumerate(steady_rotations(free, 0.5).rotations):
        unit = np.array(each.omega)
        for sign in (1.0, -1.0):
            x, y, near = _project(sign * unit[None], low, toward)
            opacity = 1.0 if near[0] > 0.0 else _HIDDEN
            face = "black" if each.stable else "white"
            style = {"marker": "o", "markersize": 6.0, "color": "black", "markerfacecolor": face}
            axes.plot(x, y, alpha=opacity, **style)
            if sign > 0.0:
                box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8}
                look: dict[str, Any] = {"textcoords": "offset points", "fontsize": 9, "bbox": box}
                axes.annotate(f"axis {axis + 1}", (x[0], y[0]), (7, 7), **look)
    axes.set_aspect("equal")
    axes.set_axis_off()
    told = "L / |L| without torque\ndot: stable, ring: not stable, red: separatrix"
    axes.set_title(told, fontsize=9)
    return rows


def _project(points: Array, upward: Array, toward: Array) -> tuple[Array, Array, Array]:
    right = np.cross(upward, toward)
    right /= np.linalg.norm(right)
    return points @ right, points @ np.cross(toward, right), points @ toward


def _square(axes: "Axes", scene: Scene) -> list[list[Any]]:
    side = np.linspace(-1.0, 1.0, _GRID)
    first, third = np.meshgrid(side, side)
    growth = growth_of_bodies(first, third)
    shades = axes.contourf(first, third, growth, levels=np.linspace(0.0, 1.0, 11), cmap="Blues")
    axes.figure.colorbar(shades, ax=axes, label="Re Q / spin", shrink=0.85)
    # Lines on which two moments are equal.
    for ends in (([0, 0], [-1, 1]), ([-1, 1], [0, 0]), ([-1, 1], [-1, 1])):
        axes.plot(*ends, color="#505050", linewidth=0.8)
    for place, middle in _MIDDLES.items():
        axes.text(*place, f"axis {middle}\nmiddle", fontsize=8, ha="center", va="center")
    marked: dict[tuple[float, float], list[str]] = {}
    outside = []
    scenes = [(f"{number}", case_scene(number)) for number in case_numbers()]
    for label, each in [*scenes, *([] if scene.case else [("this scene", scene)])]:
        a, _, c = each.euler_coefficients
        if each.is_impossible:
            outside.append(label)
        else:
            marked.setdefault((a, 0.0 - c), []).append(label)
    rows = []
    for (x, y), labels in marked.items():
        axes.plot(x, y, marker="o", markersize=5.0, color="#c02020")
        axes.annotate(
            ", ".join(labels), (x, y), (6, 5), textcoords="offset points", fontsize=9,
            color="#c02020", fontweight="bold",
        )  # fmt: skip
        height = float(growth_of_bodies(np.array(x), np.array(y)))
        rows += [["case", label, x, y, height] for label in labels]
    axes.set_aspect("equal")
    axes.set_xlabel("K1 = A = (I2 - I3) / I1")
    axes.set_ylabel("K3 = -C = (I2 - I1) / I3")
    told = "growth about the middle axis, all bodies\nred: cases"
    told += f"; outside, no body: {', '.join(outside)}" if outside else ""
    axes.set_title(told, fontsize=9)
    table = np.column_stack([first.ravel(), third.ravel(), growth.ravel()]).tolist()
    return rows + [["bodies", "Re Q / spin", *row] for row in table]


def polhodes(moments: Triple) -> Iterator[tuple[str, Array]]:
    """Yield names and points, shape (n, 3), of torque-free curves of L / abs(L).

    L is the angular momentum in body axes.
    """
    high, middle, low = sorted(range(3), key=lambda axis: moments[axis])
    j = min(moments) / np.array(moments)
    if j[high] == j[low]:
        return
    turn = np.linspace(0.0, 2.0 * np.pi, _POINTS)
    unit = np.eye(3)
    for axis, far in ((high, low), (low, high)):
        if j[axis] == j[middle]:
            continue
        flat = (j[middle] - j[axis]) / (j[far] - j[axis])
        for angle in _ANGLES:
            to_middle = math.sin(angle) * np.sin(turn)
            to_far = math.sin(angle) * math.sqrt(flat) * np.cos(turn)
            up = np.sqrt(1.0 - to_middle**2 - to_far**2)
            for sign in (1.0, -1.0):
                curve = np.outer(to_middle, unit[middle]) + np.outer(to_far, unit[far])
                name = f"around axis {'+' if sign > 0.0 else '-'}{axis + 1}"
                yield name, curve + np.outer(sign * up, unit[axis])
    # Angle of the separatrix's planes from the axis of the largest 1 / I.
    tilt = math.atan2(math.sqrt(j[high] - j[middle]), math.sqrt(j[middle] - j[low]))
    for sign in (1.0, -1.0):
        across = math.cos(tilt) * unit[high] + sign * math.sin(tilt) * unit[low]
        yield "separatrix", np.outer(np.cos(turn), unit[middle]) + np.outer(np.sin(turn), across)


def growth_of_bodies(first: Array, third: Array) -> Array:
    """Return the growth rate about each body's middle axis, divided by the spin.

    `first` and `third` are Euler's coefficients A and -C.
    """
    # The growth rate is the largest real part of the roots of equation 32.
    a, c = first, -third
    # A body has A + B + C + ABC = 0. At two corners, for bodies without extent, B is arbitrary.
    with np.errstate(invalid="ignore"):
        b = -(a + c) / (1.0 + a * c)
    b = np.where(np.isfinite(b), b, 0.0)
    return np.asarray(np.sqrt(np.maximum.reduce([b * c, c * a, a * b, np.zeros_like(a)])))
