"""Trajectories as objects of pandas, xarray and matplotlib, under SciPy's names, and as files."""

import math
import os
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Array
from pyharness.model.distribution import check_package, install_command
from pyharness.model.errors import InputError, kind_of
from pyharness.model.mechanics import Mechanics
from pyharness.model.report import counted, short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame
    from xarray import Dataset

    from pyharness.model.dense_output import DenseOutput
    from pyharness.model.trajectory import Stop, Trajectory

_SMOOTH = 1000  # points of a line through dense output
# Number of first, and of last, rows in HTML.
_SHOWN = 3


class _Quantity(NamedTuple):
    name: str
    long_name: str
    unit: str
    columns: tuple[str, ...]  # names of the components; one name if each row has a number
    values: NDArray[Any]


class Conversions(Mechanics):
    """A base class of trajectories with conversions, and the names of SciPy's `solve_ivp`."""

    recorded_time: Array
    velocity: Array | None
    steps: int
    evaluations: int
    ended: str
    stop: "Stop | None"
    ier: NDArray[np.int32] | None
    error: float | None
    growth: float | None
    reason: str | None
    tolerance: float | None
    sol: "DenseOutput | None"

    if TYPE_CHECKING:

        @property
        def digits(self) -> float | None:
            """The number of correct decimal digits of omega."""

        @property
        def has_all_rows(self) -> bool:
            """Whether all requested rows are present."""

    @property
    def t(self) -> Array:
        """The attribute `time` (s), shape (n,)."""
        return self.time

    @property
    def y(self) -> Array:
        """The state at each time in columns: omega (rad/s), (3, n), or with quaternion, (7, n)."""
        if self.attitude is None:
            return self.omega.T
        return np.concatenate([self.omega.T, self.attitude.T])

    @property
    def success(self) -> bool:
        """Whether the integration reached all requested times, or a terminal event."""
        return self.status >= 0

    @property
    def status(self) -> int:
        """The ending as in SciPy: 0 if all times were reached, 1 for a terminal event, else -1."""
        if self.ended == "event":
            return 1
        return 0 if self.has_all_rows else -1

    @property
    def message(self) -> str:
        """A sentence that says how the integration ended."""
        if self.stop is not None:
            return (
                f"The Lipschitz test ended the run at step {self.stop.step}, because the Lipschitz "
                f"quotient of {self.stop.variable} was {short(self.stop.quotient)} 1/s."
            )
        if self.ended == "event":
            return "A terminal event ended the integration; the rows end before it or at it."
        if self.ended in ("overflow", "singular"):
            last = f"the last row is at t = {self.time[-1]:g} s" if len(self.time) else "no row"
            reason = self.reason or "omega or the torque became infinite or NaN"
            return f"{reason[0].upper()}{reason[1:]}; {last}."
        if self.ended == "unchecked":
            return (
                "The integration reached all requested times, but may have passed a short change "
                "of the torque, whose series ends before."
            )
        if self.ended != "sensitive":
            return "The integration reached all requested times."
        by = "" if self.growth is None else f", amplified by {short(self.growth)},"
        left = counted(math.floor(self.digits or 0.0), "correct digit")
        return (
            f"The integration reached all requested times, but rounding errors{by} exceed the "
            f"tolerance; omega has {left}."
        )

    @property
    def nfev(self) -> int:
        """The attribute `evaluations`."""
        return self.evaluations

    def to_pandas(self) -> "DataFrame":
        """Return the rows as a DataFrame of pandas.

        Returns
        -------
        pandas.DataFrame
            Its index is `time` (s). Its columns, if present, are `omega1` to `omega3` (rad/s),
            `velocity1` to `velocity3` (m/s), `q0` to `q3`, `recorded_time` (s, if it differs from
            `time`) and `ier`. ``attrs["units"]`` has the units.

        Raises
        ------
        InputError
            If pandas is not installed.

        Examples
        --------
        >>> from pyharness import case_scene, solve
        >>> frame = solve(case_scene(1), [1.0, 2.0]).to_pandas()
        >>> float(frame.loc[2.0, "omega1"]), frame.attrs["units"]["omega1"]
        (6.0, 'rad/s')
        """
        check_package("pandas", "to_pandas", "pip install pandas")
        from pandas import DataFrame, Index

        columns: dict[str, Any] = {}
        units = {"time": "s"}
        for each in self._quantities():
            parts = each.values.reshape(len(self.time), len(each.columns)).T
            columns.update(zip(each.columns, parts, strict=True))
            units.update(dict.fromkeys(each.columns, each.unit))
        frame = DataFrame(columns, index=Index(self.time.copy(), name="time"))
        frame.attrs["units"] = units
        return frame

    def to_xarray(self) -> "Dataset":
        """Return the rows as a Dataset of xarray.

        Returns
        -------
        xarray.Dataset
            Its variables, if present, are `omega` and `velocity` (dimensions `time` and `axis`),
            `attitude` (`time` and `component`), `recorded_time` (if it differs from `time`) and
            `ier`. Each has `units` and `long_name`. Attributes say how the integration ended.

        Raises
        ------
        InputError
            If xarray is not installed.

        Examples
        --------
        >>> from pyharness import case_scene, solve
        >>> data = solve(case_scene(1), [1.0, 2.0]).to_xarray()
        >>> float(data.omega.sel(time=2.0, axis=1)), data.omega.units
        (6.0, 'rad/s')
        """
        check_package("xarray", "to_xarray", "pip install xarray")
        from xarray import Dataset

        coordinates: dict[str, Any] = {
            "time": ("time", self.time.copy(), {"units": "s", "long_name": "time"}),
            "axis": ("axis", [1, 2, 3], {"long_name": "number of the body axis"}),
        }
        variables: dict[str, Any] = {}
        for each in self._quantities():
            dimensions: tuple[str, ...] = ("time",)
            if each.name == "attitude":
                names = list(each.columns)
                about = {"long_name": "component of the quaternion, scalar first"}
                coordinates["component"] = ("component", names, about)
                dimensions += ("component",)
            elif len(each.columns) > 1:
                dimensions += ("axis",)
            attributes = {"units": each.unit, "long_name": each.long_name}
            variables[each.name] = (dimensions, each.values.copy(), attributes)
        described = ("ended", "steps", "evaluations", "error", "growth", "tolerance")
        facts = {} if self.scene is None else {"title": self.scene.name}
        facts |= {name: getattr(self, name) for name in described}
        known = {name: value for name, value in facts.items() if value is not None}
        return Dataset(variables, coordinates, known)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the three components of omega over time with matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            The diagram in which to draw. The default is a new one.

        Returns
        -------
        matplotlib.axes.Axes
            The diagram, with legend and units. Its lines connect the rows; with dense output they
            are smooth, from `sol.t_min` to `sol.t_max`.

        Raises
        ------
        InputError
            If matplotlib is not installed, or if `ax` is no Axes.

        Examples
        --------
        >>> from pyharness import case_scene, solve
        >>> ax = solve(case_scene(1), [1.0, 2.0]).plot()  # doctest: +SKIP
        >>> ax.get_ylabel()  # doctest: +SKIP
        'angular velocity (rad/s)'
        """
        check_package("matplotlib", "plot", install_command("plots"))
        from matplotlib.axes import Axes

        if ax is None:
            from matplotlib import pyplot

            _, ax = pyplot.subplots()
        elif not isinstance(ax, Axes):
            raise InputError(f"plot: ax is {kind_of(ax)}; allowed: an Axes of matplotlib, or none")
        order = np.argsort(self.time, kind="stable")
        times, omega = self.time[order], self.omega[order]
        if self.sol is not None:
            times = np.union1d(times, np.linspace(self.sol.t_min, self.sol.t_max, _SMOOTH))
            omega = self.sol(times)[:3].T
        marker = "o" if len(times) == 1 else ""
        for axis in range(3):
            ax.plot(times, omega[:, axis], marker=marker, label=rf"$\omega_{axis + 1}$")
        ax.set_xlabel("time (s)")
        ax.set_ylabel("angular velocity (rad/s)")
        ax.legend()
        return ax

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the trajectory with its scene to a file, from which `pyharness.load` restores it.

        The restored numbers are bit-for-bit the same. The file is written completely or not at all.
        Its format is that of `numpy.savez`, with an array for each attribute. The array `scene` is
        the text of a scene file; `header` has other attributes and the operations of a recorded
        torque in JSON.

        Parameters
        ----------
        path : str or path
            The path of the file, usually with the suffix ``.npz``. An existing file is replaced.

        Raises
        ------
        InputError
            If the file can't be written, the torque is opaque, or a program did not run in
            binary64.

        Examples
        --------
        >>> from pyharness import case_scene, load, solve
        >>> solve(case_scene(1), [1.0, 2.0]).save("case-1.npz")  # doctest: +SKIP
        >>> load("case-1.npz").omega[-1]  # doctest: +SKIP
        array([6., 6., 6.])
        """
        from pyharness.model.trajectory_file import save

        save(cast("Trajectory", self), path)

    def _repr_html_(self) -> str:
        facts = {
            "ended": self.message,
            "rows": str(len(self.time)),
            "work": f"{counted(self.steps, 'step')}, "
            f"{counted(self.evaluations, 'evaluation')} of the right-hand side",
        }
        if self.error is not None and self.digits is not None:
            facts["estimated error"] = f"{short(self.error)} of the largest |omega|"
            facts["correct digits"] = f"{self.digits:.1f}"
        if self.growth is not None:
            facts["error amplification"] = short(self.growth)
        title = "Trajectory" if self.scene is None else f"Trajectory of {self.scene.name}"
        lines = [f"<table><caption>{escape(title)}</caption><tbody>"]
        lines += [
            f'<tr><th scope="row" style="text-align: left">{escape(name)}</th>'
            f'<td style="text-align: left">{escape(text)}</td></tr>'
            for name, text in facts.items()
        ]
        return "\n".join([*lines, "</tbody></table>", *self._html_rows()])

    def _html_rows(self) -> list[str]:
        count = len(self.time)
        if not count:
            return []
        quantities = [each for each in self._quantities() if each.name != "ier"]
        heads = ["time (s)"]
        for each in quantities:
            unit = "" if each.unit == "1" else f" ({each.unit})"
            heads += [f"{name}{unit}" for name in each.columns]
        parts = [self.time, *(each.values for each in quantities)]
        cells = "".join(f'<th scope="col">{escape(head)}</th>' for head in heads)
        lines = [f"<table><thead><tr>{cells}</tr></thead><tbody>"]
        kept = list(range(count))
        if count > 2 * _SHOWN + 1:
            kept = [*range(_SHOWN), -1, *range(count - _SHOWN, count)]
        for row in kept:
            values = np.concatenate([np.atleast_1d(part[row]) for part in parts]).tolist()
            texts = ["..."] * len(heads) if row < 0 else [f"{value:.6g}" for value in values]
            lines.append(f"<tr>{''.join(f'<td>{text}</td>' for text in texts)}</tr>")
        return [*lines, "</tbody></table>"]

    def _quantities(self) -> list[_Quantity]:
        about = "angular velocity about the body axes"
        names = tuple(f"omega{axis}" for axis in (1, 2, 3))
        found = [_Quantity("omega", about, "rad/s", names, self.omega)]
        if self.velocity is not None:
            about = "translational velocity along the body axes"
            names = tuple(f"velocity{axis}" for axis in (1, 2, 3))
            found.append(_Quantity("velocity", about, "m/s", names, self.velocity))
        if self.attitude is not None:
            about = "quaternion from body to space"
            names = tuple(f"q{component}" for component in range(4))
            found.append(_Quantity("attitude", about, "1", names, self.attitude))
        if not np.array_equal(self.recorded_time, self.time, equal_nan=True):
            name, about = "recorded_time", "time in the output file of the program"
            found.append(_Quantity(name, about, "s", (name,), self.recorded_time))
        if self.ier is not None:
            about = "error code of the linear solver"
            found.append(_Quantity("ier", about, "1", ("ier",), self.ier))
        return found
