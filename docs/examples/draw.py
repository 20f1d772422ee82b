"""Pictures of the examples of torques.

``python -m docs.examples.draw``, in a checkout, writes a picture of each example, such as
``slew.svg``, and its numbers, such as ``slew.csv``, beside this file.
"""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pyharness.model.report import Picture, numbers
from pyharness.model.trajectory import Array
from pyharness.views.pictures import saved

_HERE = Path(__file__).parent
_NAMES = ("$\\omega_1$", "$\\omega_2$", "$\\omega_3$")


class Plot(NamedTuple):
    """The label and scale of an axis, and its curves by their names in the legend."""

    label: str
    curves: dict[str, Array]
    scale: str = "linear"


def _components(label: str, values: Array) -> Plot:
    return Plot(label, dict(zip(_NAMES, values.T, strict=True)))


def _flat_spin(found: Any) -> list[Plot]:
    return [
        Plot("angle to momentum (deg)", {"long axis": found.angle}),
        Plot("energy (J)", {"energy": found.energy}),
    ]


def _gravity_capture(found: Any) -> list[Plot]:
    return [
        Plot("angle to vertical (deg)", {"long axis": found.angle}),
        Plot(
            "rate / rate of orbit",
            {
                "$\\omega_3/n$": found.found.omega[:, 2] / found.orbit,
                "along the orbit": np.ones(len(found.time)),
            },
        ),
    ]


def _magnetic_detumbling(found: Any) -> list[Plot]:
    return [
        _components("$\\omega$ (rad/s)", found.found.omega),
        Plot("rate / rate of orbit", {"$|\\omega|/n$": found.rate}, "log"),
    ]


def _dual_spin_turn(found: Any) -> list[Plot]:
    omega = found.found.omega
    return [
        Plot("$\\omega$ (rad/s)", {_NAMES[0]: omega[:, 0], _NAMES[2]: omega[:, 2]}),
        Plot("angle to momentum (deg)", {"axis of the wheel": found.angle}),
    ]


def _slew(found: Any) -> list[Plot]:
    return [
        _components("$\\omega$ (rad/s)", found.found.omega),
        Plot("error (deg)", {"error": found.error}, "log"),
    ]


def _reaction_wheel(found: Any) -> list[Plot]:
    body = found.moments[2] * found.found.omega[:, 2]
    return [
        Plot("momentum (N m s)", {"body": body, "wheel": found.stored}),
        Plot("angle (deg)", {"body": found.angle}),
    ]


PLOTS: dict[str, Callable[[Any], list[Plot]]] = {
    "flat_spin": _flat_spin,
    "gravity_capture": _gravity_capture,
    "magnetic_detumbling": _magnetic_detumbling,
    "dual_spin_turn": _dual_spin_turn,
    "slew": _slew,
    "reaction_wheel": _reaction_wheel,
}


def picture(name: str) -> Picture:
    """Run an example, and return its picture: two plots against time."""
    from matplotlib.figure import Figure

    found = import_module(f"docs.examples.{name}")
    time, unit = found.time, "s"
    if orbit := getattr(found, "orbit", None):
        time, unit = found.time * orbit / (2.0 * np.pi), "orbits"
    figure = Figure(figsize=(7.2, 2.9), layout="constrained")
    rows: list[list[Any]] = []
    plots = PLOTS[name](found)
    for axes, (label, curves, scale) in zip(figure.subplots(1, 2), plots, strict=True):
        for curve, values in curves.items():
            axes.plot(time, values, linewidth=1.2, label=curve)
            shown = curve.translate(str.maketrans("", "", "$\\_"))
            pairs = zip(time.tolist(), values.tolist(), strict=True)
            rows += [[shown, *(float(f"{each:.6g}") for each in pair)] for pair in pairs]
        axes.set(xlabel=f"time ({unit})", ylabel=label, yscale=scale)
        axes.grid(visible=True, linewidth=0.3)
        axes.legend(fontsize=8)
    return Picture(figure, numbers("curve time value", rows))


def main() -> None:
    """Draw the pictures of all examples."""
    for name in PLOTS:
        for file, content in saved(picture(name), str(_HERE / f"{name}.svg")).items():
            Path(file).write_bytes(content)


if __name__ == "__main__":
    main()
