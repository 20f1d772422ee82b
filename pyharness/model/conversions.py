"""Mechanical quantities of trajectories; trajectories in pandas, xarray, matplotlib and files."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.attitude import turned_to_space
from pyharness.model.changing import Changing
from pyharness.model.distribution import check_package, checked_axes
from pyharness.model.errors import InputError, known
from pyharness.model.fields import FACTS, ROWS, Fields, Quantity
from pyharness.model.torque_law import FRAMES, TorqueLaw
from pyharness.model.values import Triple

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame
    from scipy.spatial.transform import Rotation
    from xarray import Dataset

    from pyharness.model.scene import Scene
    from pyharness.model.trajectory import Trajectory

_SMOOTH = 1000  # points of a line through dense output


@dataclass(frozen=True, eq=False, repr=False)
class Conversions(Fields):
    """The base class of trajectories.

    With a changing inertia, quantities use the inertia at each time.
    """

    def rotation(self) -> "Rotation":
        """Return the attitudes as SciPy rotations, which rotate vectors from body to space.

        Returns
        -------
        scipy.spatial.transform.Rotation
            One rotation for each time.

        Raises
        ------
        InputError
            If the attitude was not requested.
        """
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self._attitudes()[:, [1, 2, 3, 0]])

    def angular_momentum(self, frame: str = "body") -> Array:
        """Return the angular momentum at each time.

        Parameters
        ----------
        frame : {"body", "space"}
            The axes of the components.

        Returns
        -------
        ndarray, shape (n, 3)
            The angular momentum, kg m2/s.

        Raises
        ------
        InputError
            If the body has no moments, the frame is unknown, or "space" is requested without an
            attitude.
        """
        frame = known("frame", frame, FRAMES)
        momentum = self._momentum(self.omega)
        return momentum if frame == "body" else turned_to_space(self._attitudes(), momentum)

    def energy(self) -> Array:
        """Return the kinetic energy of the rotation at each time.

        Returns
        -------
        ndarray, shape (n,)
            The energy, J.

        Raises
        ------
        InputError
            If the body has no moments.
        """
        energy: Array = 0.5 * (self.omega * self._momentum(self.omega)).sum(axis=1)
        return energy

    def power(self) -> Array:
        """Return the power of the torque, its scalar product with omega, at each time.

        Returns
        -------
        ndarray, shape (n,)
            The power, W; NaN where the torque is singular.

        Raises
        ------
        InputError
            If the body has no moments, or `solve` did not make the trajectory.

        References
        ----------
        H. Goldstein, C. Poole and J. Safko, Classical Mechanics, 3rd edition, 2002, section 5.3.

        Examples
        --------
        >>> from pyharness import Scene, solve
        >>> from pyharness.torques import damping
        >>> scene = Scene("damped", (0, 0, 2), moments=(3, 2, 1), torque=damping(0.5))
        >>> solve(scene, [0.0, 2.0]).power().round(6)
        array([-2.      , -0.270671])
        """
        self._checked_moments()
        torque, omega = self._scene_of_solve().torque, self.omega
        if isinstance(torque, TorqueLaw):
            values = [torque.at(time) for time in self.time.tolist()]
            if torque.in_space:
                omega = turned_to_space(self._attitudes(), omega)
        else:
            # A torque that ignores the attitude gets an arbitrary one.
            needed = torque.needs_attitude
            attitudes = self._attitudes() if needed else np.eye(4)[[0] * len(self.time)]
            own = np.zeros((len(self.time), 0)) if self.own is None else self.own
            columns = (self.time, self.omega, attitudes, own)
            rows = zip(*(each.tolist() for each in columns), strict=True)
            values = [torque.at(*row) for row in rows]
        power: Array = (np.array(values).reshape(-1, 3) * omega).sum(axis=1)
        return power

    def work(self) -> Array:
        """Return the work of the torque on the body from 0 to each time.

        The work is the change of the kinetic energy, (omega - omega0) . I (omega + omega0)/2, with
        the inertia I and the initial omega0. This formula loses no digits where omega has changed
        little; its error is the error of omega times the angular momentum. The work of the motors
        of `pyharness.torques.wheels` on the wheels is not included.

        Returns
        -------
        ndarray, shape (n,)
            The work, J.

        Raises
        ------
        InputError
            If the body has no moments, the inertia changes with time, or `solve` did not make the
            trajectory.

        References
        ----------
        H. Goldstein, C. Poole and J. Safko, Classical Mechanics, 3rd edition, 2002, sections 1.1
        and 5.3.
        """
        if isinstance(self._checked_moments(), Changing):
            # The forces that change the inertia change the kinetic energy too.
            raise InputError(
                "work: the inertia changes with time; allowed: a constant inertia; `power` is "
                "available for both"
            )
        start = np.array(self._scene_of_solve().omega)
        work: Array = 0.5 * ((self.omega - start) * self._momentum(self.omega + start)).sum(axis=1)
        return work

    def _momentum(self, omega: Array) -> Array:
        moments = self._checked_moments()
        if isinstance(moments, Changing):
            return moments.momentum(self.time, omega)
        axes = np.eye(3) if self.axes is None else self.axes
        # The rounding of a matrix product may depend on the order in memory, which a file may not
        # preserve.
        ordered = np.ascontiguousarray(omega)
        momentum: Array = ((ordered @ axes) * np.array(moments)) @ axes.T
        return momentum

    def _checked_moments(self) -> Triple | Changing:
        if self.moments is None:
            raise InputError(
                "the body is given by coefficients, and the result needs its moments; give moments"
            )
        return self.moments

    def _scene_of_solve(self) -> "Scene":
        if self.scene is None:
            raise InputError(
                "the trajectory has no scene; allowed: a trajectory that solve has returned"
            )
        return self.scene

    def _attitudes(self) -> Array:
        if self.attitude is None:
            raise InputError("the trajectory has no attitude; request it with attitude=True")
        return self.attitude

    def to_pandas(self) -> "DataFrame":
        """Return the results as a pandas DataFrame.

        Returns
        -------
        pandas.DataFrame
            Its index is `time` (s). Its columns, if present, are `omega1` to `omega3` (rad/s),
            `velocity1` to `velocity3` (m/s), `q0` to `q3`, `recorded_time` (s, if it differs from
            `time`), `ier`, and the names in `Scene.states`. ``attrs["units"]`` has the units.

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
        """Return the results as an xarray Dataset.

        Returns
        -------
        xarray.Dataset
            Its variables, if present, are `omega` and `velocity` (dimensions `time` and `axis`),
            `attitude` (`time` and `component`), `recorded_time` (if it differs from `time`), `ier`
            and the names in `Scene.states`. Each variable has `units` and `long_name`. Attributes
            of the Dataset, if known, are `title` (the scene's name), `ended`, `steps`,
            `evaluations`, `error`, `growth` and `tolerance`.

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
            dimensions = ("time", each.dimension) if each.dimension else ("time",)
            if each.dimension == "component":
                about = {"long_name": "component of the quaternion, scalar first"}
                coordinates[each.dimension] = (each.dimension, list(each.columns), about)
            attributes = {"units": each.unit, "long_name": each.about}
            variables[each.name] = (dimensions, each.values.copy(), attributes)
        facts = {} if self.scene is None else {"title": self.scene.name}
        facts |= {name: getattr(self, name) for name in FACTS}
        known = {name: value for name, value in facts.items() if value is not None}
        return Dataset(variables, coordinates, known)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the three components of omega over time with matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            The diagram; by default a new one.

        Returns
        -------
        matplotlib.axes.Axes
            The diagram, with legend and units. Its lines connect the results; with dense output
            they are smooth curves from `sol.t_min` to `sol.t_max`.

        Raises
        ------
        InputError
            If matplotlib is not installed, or if `ax` is no Axes.

        Examples
        --------
        >>> from pyharness import case_scene, solve
        >>> ax = solve(case_scene(1), [1.0, 2.0]).plot()
        >>> ax.get_ylabel()
        'angular velocity (rad/s)'
        """
        ax = checked_axes(ax)
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

    def animate(self, path: str | os.PathLike[str]) -> None:
        """Write an animation of a brick that has the moments of the body and moves like the body.

        The frames are 0.05 s apart. A motion shorter than 2 s is stretched to 2 s, and one longer
        than 10 s compressed to 10 s. Without dense output, a frame shows the result at the nearest
        time.

        Parameters
        ----------
        path : str or path
            A path that ends in ``.gif`` or ``.html`` (a page with buttons and a slider). An
            existing file is replaced.

        Raises
        ------
        InputError
            If the trajectory has no attitude, or is at one time only; if the body has no constant
            moments, or no brick has these moments; if the file has another ending or can't be
            written; or if matplotlib is not installed.

        Examples
        --------
        >>> from pyharness import Scene, solve
        >>> nut = Scene("nut", (0.02, 6, 0), moments=(0.9, 1.6, 2.3), attitude=(1, 0, 0, 0))
        >>> solve(nut, 10.0, dense_output=True).animate("nut.gif")
        """
        from pyharness.model.attitude_picture import animate

        self._attitudes()
        animate(cast("Trajectory", self), path)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the trajectory with its scene to a file, from which `pyharness.load` restores it.

        Numbers are restored bit for bit. The file has the format of `numpy.savez`, with an array
        for each array attribute; the array `scene` is the text of a scene file.

        Parameters
        ----------
        path : str or path
            A new file without an ending gets ``.npz``. An existing file is replaced.

        Raises
        ------
        InputError
            If the file can't be written or has a text file's ending, the torque is not recorded, or
            a program in an arithmetic other than binary64 computed the trajectory.

        Examples
        --------
        >>> from pyharness import case_scene, solve
        >>> solve(case_scene(1), [1.0, 2.0]).save("case-1.npz")
        """
        from pyharness.model.trajectory_file import save

        save(cast("Trajectory", self), path)

    def _quantities(self) -> list[Quantity]:
        is_late = not np.array_equal(self.recorded_time, self.time, equal_nan=True)
        left_out = {"time"} if is_late else {"time", "recorded_time"}
        found = [
            Quantity(name, each.about, each.unit, each.columns, each.dimension, getattr(self, name))
            for name, each in sorted(ROWS.items(), key=lambda item: not item[1].turns)
            if name not in left_out and getattr(self, name) is not None
        ]
        own = cast("Trajectory", self).states.items()
        return found + [
            Quantity(name, "state of the scene's own", "", (name,), "", each) for name, each in own
        ]
