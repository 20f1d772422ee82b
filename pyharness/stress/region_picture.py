"""The picture of the regions of linear stability: numbers in, picture out."""

from typing import Any

import numpy as np

from pyharness.model.report import Column, Picture, Table, digits
from pyharness.theory.regions import Regions

# Told apart without colour: by dash and width.
_STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#000000", "linestyle": "solid", "linewidth": 2.2},
    {"color": "#1040a0", "linestyle": (0, (1, 1.2)), "linewidth": 2.2},
    {"color": "#c02020", "linestyle": (0, (6, 2)), "linewidth": 1.8},
    {"color": "#107040", "linestyle": (0, (5, 1.5, 1, 1.5)), "linewidth": 1.1},
    {"color": "#806000", "linestyle": (0, (2, 3)), "linewidth": 1.1},
)
_LEAST = 1e-13


def regions_picture(found: Regions) -> Picture:
    """Draw the regions beside the growth along the imaginary axis."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.8), dpi=100, layout="constrained")
    plane, axis = figure.subplots(1, 2)
    plane.axvspan(found.real[0], 0.0, color="#ededed", zorder=0)
    plane.text(
        -4.5,
        3.25,
        "grey: Gauss collocation, the whole left half-plane",
        fontsize=8,
        color="#505050",
    )
    handles = []
    for each, style in zip(found.regions, _STYLES, strict=True):
        plane.contour(
            found.real, found.imaginary, each.radius, levels=[1.0],
            colors=style["color"], linestyles=[style["linestyle"]],
            linewidths=style["linewidth"],
        )  # fmt: skip
        for sign, alpha in ((1.0, 1.0), (-1.0, 0.35)):
            shown = sign * each.growth > _LEAST
            values = np.where(shown, sign * each.growth, np.nan)
            (line,) = axis.plot(found.distances, values, alpha=alpha, label=each.name, **style)
            if sign > 0.0:
                handles.append(line)
    plane.axhline(0.0, color="#808080", linewidth=0.6)
    plane.axvline(0.0, color="#808080", linewidth=0.6)
    plane.set_aspect("equal")
    plane.set_xlabel("real part of z = h lambda")
    plane.set_ylabel("imaginary part")
    plane.set_title("Where a disturbance does not grow", fontsize=10)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_ylim(_LEAST, 10.0)
    axis.axvline(0.05, color="#808080", linewidth=0.8)
    axis.text(0.053, 2e-13, "Case 2 at .01 s", fontsize=8, color="#505050")
    axis.set_xlabel("z / i: angle of the wobble in a step (rad)")
    axis.set_ylabel("growth of a wobble in a step; faint: decay")
    axis.set_title("Along the imaginary axis: spinning about a stable axis", fontsize=10)
    axis.grid(visible=True, linewidth=0.3)
    figure.legend(
        handles, [each.name for each in found.regions], loc="outside lower center", ncols=3,
        handlelength=5.0, frameon=False, fontsize=9,
    )  # fmt: skip
    columns = [Column("distance", full=digits(".6g"), unit="rad")]
    columns += [Column(each.name, full=digits(".3g")) for each in found.regions]
    rows = np.column_stack([found.distances, *(each.growth for each in found.regions)])
    return Picture(figure, Table(columns, rows))
