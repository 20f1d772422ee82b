"""The result of `solve_many`: states of many bodies."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Maybe
from pyharness.model.arrays import buffer_of, check_rows, only_one, rows_of, spread
from pyharness.model.distribution import check_package, checked_axes
from pyharness.model.ensemble_bodies import html_of, summary_of, trajectory_of_body
from pyharness.model.errors import InputError, known
from pyharness.model.fields import ENSEMBLE_ROWS
from pyharness.model.inertia import SYMMETRIC, symmetric_matrix
from pyharness.model.torque_law import FRAMES
from pyharness.model.trajectory import Array, BatchResult, Trajectory, turned_to_space

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame
    from scipy.spatial.transform import Rotation
    from xarray import Dataset


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(BatchResult):
    """The states of many bodies, from `solve_many`: a sequence of their trajectories.

    Attributes
    ----------
    omega : ndarray, shape (n, 3)
        Angular velocities about the body axes, rad/s; NaN for a body without a result.
    status : ndarray of int8, shape (n,)
        How each computation ended: 0 `complete`, 2 `overflow` (omega or the torque becomes infinite
        or undefined), 3 `refused` (the method does not apply), 4 `gave up` (work limit exceeded, or
        no correct digit of the phase left), 6 `sensitive` (amplified rounding errors exceed the
        tolerance), 9 `sliding` (a switch of the torque would change back and forth without end),
        10 `stalled` (no step is short enough for the tolerance).
    attitude : ndarray, shape (n, 4), or None
        Unit quaternions from body to space, scalar first. This attribute and the following ones are
        None if they were not requested.
    estimates : ndarray, shape (n, 2), or None
        The estimated errors and the error amplifications, as columns.
    t_events, y_events : list of list of ndarray, or None
        Times (s) and states of events, indexed by function, then by body. For k events, the shapes
        are (k,), and (k, 3) or (k, 7); None for a body without a result.
    sensitivities : dict of ndarray, or None
        By name of a parameter with m values, the derivatives of the final states with respect to
        it, shape (n, 3, m) or (n, 7, m); NaN for a body without a result.
    refusals : dict of str, or None
        The reasons for refused bodies (at most a hundred), and for missing events and
        sensitivities, by index of the body.
    own, names : ndarray, shape (n, k), or None, and tuple of str
        The values and names of the scene's own states (`Scene.states`).
    times : ndarray, shape (m,), or None
        The times (s) of all bodies' results. Each array of results then has a second axis of length
        m.
    t_end : ndarray, shape (n,), or None
        The final times (s); None with `times`.
    leaves : str or None
        Whether compiled code (``compiled``) or an ``interpreter`` computed the Taylor series of a
        recorded torque, with the reason if `compiled` was requested but impossible; and how many
        bodies could not be solved side by side, with the reason.

    Examples
    --------
    >>> from pyharness import case_scene, solve_many
    >>> starts = [[0.0, 1.0, 10.0], [0.0, 2.0, 5.0]]
    >>> found = solve_many(case_scene(2), 1.0, omega=starts)
    >>> found.omega.shape
    (2, 3)
    >>> found.has_result
    array([ True,  True])
    >>> [body.y[:2, 0].round(3).tolist() for body in found]
    [[-0.959, 0.284], [1.197, -1.602]]
    """

    attitude: Maybe[Array] = None
    estimates: Maybe[Array] = None
    t_events: Maybe[list[list[Maybe[Array]]]] = field(default=None, repr=False)
    y_events: Maybe[list[list[Maybe[Array]]]] = field(default=None, repr=False)
    sensitivities: Maybe[dict[str, Array]] = field(default=None, repr=False)
    refusals: Maybe[dict[int, str]] = field(default=None, repr=False)
    times: Maybe[Array] = None
    own: Maybe[Array] = field(default=None, repr=False)
    names: tuple[str, ...] = ()
    leaves: str | None = field(default=None, repr=False)
    t_end: Maybe[Array] = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.omega)

    @overload
    def __getitem__(self, body: int) -> Trajectory: ...
    @overload
    def __getitem__(self, body: slice) -> list[Trajectory]: ...
    def __getitem__(self, body: int | slice) -> Trajectory | list[Trajectory]:
        """Return the trajectory of a body, without scene, or of several bodies."""
        numbers = range(len(self))[body]  # which raises IndexError
        if isinstance(numbers, int):
            return trajectory_of_body(self, numbers)
        return [trajectory_of_body(self, each) for each in numbers]

    def __iter__(self) -> Iterator[Trajectory]:
        return (trajectory_of_body(self, each) for each in range(len(self)))

    @property
    def t(self) -> Maybe[Array]:
        """The attribute `times`, shape (m,), or else `t_end`, shape (n,)."""
        return self.t_end if self.times is None else self.times

    @property
    def y(self) -> Array:
        """The states: omega, the attitude if computed, own states; shape (n, k) or (n, k, m)."""
        parts = [each for each in (self.omega, self.attitude, self.own) if each is not None]
        found: Array = np.concatenate(parts, axis=-1)
        return found if self.times is None else found.swapaxes(1, 2)

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether each body has all results, shape (n,)."""
        rows = self.has_result.reshape(len(self), -1)
        found: NDArray[np.bool_] = np.logical_and.reduce(rows, axis=1, dtype=np.bool_)
        return found

    @property
    def message(self) -> str:
        """A sentence on how the computations ended."""
        return summary_of(self)

    def rotation(self) -> "Rotation":
        """Return the final attitudes as SciPy rotations, from body to space.

        Raise InputError without attitudes, or with `times`: then use `found[i].rotation()`.
        """
        if self.attitude is None or self.times is not None:
            what = "no attitudes" if self.attitude is None else "several times"
            raise InputError(
                f"rotation: the bodies have {what}; allowed: attitudes at t_end, or "
                "found[i].rotation() of a body"
            )
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self.attitude[:, [1, 2, 3, 0]])

    def _repr_html_(self) -> str:
        return html_of(self)

    @property
    def states(self) -> dict[str, Array]:
        """The scenes' own states by name, shape (n,) or (n, m); empty if they have none."""
        return {} if self.own is None else dict(zip(self.names, self._last(self.own), strict=True))

    @staticmethod
    def _last(array: Array) -> Array:
        return np.moveaxis(array, -1, 0)

    @property
    def error(self) -> Maybe[Array]:
        """The estimated errors, shape (n,) or (n, m), as in `Trajectory`; NaN where unknown."""
        return None if self.estimates is None else self.estimates[..., 0]

    @property
    def growth(self) -> Maybe[Array]:
        """The error amplifications, or upper bounds, shape (n,) or (n, m); NaN where unknown."""
        return None if self.estimates is None else self.estimates[..., 1]

    def angular_momentum(
        self, frame: str = "body", *, moments: Any = None, inertia: Any = None
    ) -> Array:
        """Return the angular momentum of each body, whose moments or inertia must be given.

        Parameters
        ----------
        frame : {"body", "space"}
            The axes of the components.
        moments : array, shape (n, 3) or (3,)
            Principal moments, kg m2.
        inertia : array, shape (n, 3, 3) or (3, 3)
            Inertia matrices (kg m2) instead of moments.

        Returns
        -------
        ndarray, shape (n, 3) or (n, m, 3)
            The angular momenta, kg m2/s.

        Raises
        ------
        InputError
            If not exactly one of `moments` and `inertia` is given, or it has neither 1 nor n rows;
            if a matrix is not symmetric, the frame is unknown, or "space" is requested without
            attitudes.
        """
        frame = known("frame", frame, FRAMES)
        given = only_one({"moments": moments, "inertia": inertia})
        if not given:
            raise InputError("neither moments nor inertia is given; give one of them")
        if given == "inertia":
            matrices = rows_of(given, inertia, 3, 3)
            _check_symmetric(given, matrices)
        else:
            matrices = rows_of(given, moments, 3)[:, :, None] * np.eye(3)
        n = len(self.omega)
        check_rows(given, matrices, n)
        momentum: Array = np.einsum("bij,b...j->b...i", spread(matrices, n), self.omega)
        if frame == "body":
            return momentum
        if self.attitude is None:
            raise InputError("the bodies have no attitudes; give attitude to solve_many")
        turned = turned_to_space(self.attitude.reshape(-1, 4), momentum.reshape(-1, 3))
        return turned.reshape(momentum.shape)

    def energy(self, *, moments: Any = None, inertia: Any = None) -> Array:
        """Return the kinetic energy (J) of each body, shape (n,) or (n, m).

        The arguments are as in `angular_momentum`.
        """
        momentum = self.angular_momentum(moments=moments, inertia=inertia)
        energy: Array = 0.5 * (self.omega * momentum).sum(axis=-1)
        return energy

    def with_times(self, times: Array) -> "Ensemble":
        """Return this result for n * m bodies as a view for n bodies at m times (s)."""

        def divided(array: Any) -> Any:
            return None if array is None else array.reshape(-1, len(times), *array.shape[1:])

        names = (*ENSEMBLE_ROWS, "status", "own")
        return replace(self, times=times, **{name: divided(getattr(self, name)) for name in names})

    def to_pandas(self) -> "DataFrame":
        """Return the states as a pandas DataFrame.

        Returns
        -------
        pandas.DataFrame
            Its index is `body`, from 0, or `body` and `time` (s). Its columns are `omega1` to
            `omega3` (rad/s), `ended`, and, if present, `q0` to `q3`, `error`, `growth`, and the own
            states (`Scene.states`) by name. ``attrs["units"]`` has the units.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        check_package("pandas", "to_pandas", "pip install pandas")
        from pandas import DataFrame, MultiIndex, RangeIndex

        columns = {
            name: array.reshape(-1) for _, names, array in self._columns()
            for name, array in zip(names, self._last(array), strict=True)
        }  # fmt: skip
        bodies = RangeIndex(len(self.omega), name="body")
        index = (
            bodies
            if self.times is None
            else MultiIndex.from_product([bodies, self.times], names=["body", "time"])
        )
        frame = DataFrame({**columns, "ended": self.ended.reshape(-1)}, index=index)
        frame.attrs["units"] = {name: unit for unit, names, _ in self._columns() for name in names}
        return frame

    def _columns(self) -> list[tuple[str, tuple[str, ...], Array]]:
        found = [
            (each.unit, each.columns, getattr(self, name)) for name, each in ENSEMBLE_ROWS.items()
        ]
        found.append(("", self.names, self.own))
        return [(unit, names, array) for unit, names, array in found if array is not None]

    def to_xarray(self) -> "Dataset":
        """Return the states as an xarray Dataset.

        Returns
        -------
        xarray.Dataset
            Its variables are `omega` (dimensions `body`, `time` if there are `times`, and `axis`),
            `ended`, and, if present, `attitude` (with the dimension `component` in place of
            `axis`), `error`, `growth` and own states (`Scene.states`).

        Raises
        ------
        InputError
            If xarray is not installed.
        """
        check_package("xarray", "to_xarray", "pip install xarray")
        from xarray import Dataset

        first = ("body",) if self.times is None else ("body", "time")
        coordinates: dict[str, Any] = {"axis": [1, 2, 3]}
        if self.times is not None:
            coordinates["time"] = ("time", self.times.copy(), {"units": "s"})
        variables: dict[str, Any] = {"ended": (first, self.ended)}
        for name, each in ENSEMBLE_ROWS.items():
            array = getattr(self, name)
            if array is not None and each.dimension:
                variables[name] = ((*first, each.dimension), array.copy(), {"units": each.unit})
                if each.dimension != "axis":
                    coordinates[each.dimension] = list(each.columns)
            elif array is not None:
                parts = zip(each.columns, self._last(array), strict=True)
                variables |= {column: (first, part.copy()) for column, part in parts}
        variables |= {name: (first, values.copy()) for name, values in self.states.items()}
        return Dataset(variables, coordinates)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the three components of omega of all bodies with matplotlib.

        With `times`, it draws the median and the middle 90 % of the bodies; otherwise the
        cumulative distribution of the final values.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            The diagram; by default a new one.

        Returns
        -------
        matplotlib.axes.Axes
            The diagram, with legend and units.

        Raises
        ------
        InputError
            If matplotlib is not installed, `ax` is no Axes, or no body has a result.
        """
        ax = checked_axes(ax)
        omega = self.omega[self.has_result.reshape(len(self.omega), -1).all(axis=1)]
        if not len(omega):
            raise InputError("plot: no body has a result; allowed: an Ensemble with results")
        unit = "angular velocity (rad/s)"
        if self.times is None:
            for axis, values in enumerate(np.sort(omega, axis=0).T, 1):
                fractions = np.arange(1, len(values) + 1) / len(values)
                ax.step(values, fractions, where="post", label=rf"$\omega_{axis}$")
            ax.set(xlabel=unit, ylabel="fraction of the bodies")
        else:
            low, middle, high = np.quantile(omega, (0.05, 0.5, 0.95), axis=0)
            for axis in range(3):
                (line,) = ax.plot(self.times, middle[:, axis], label=rf"$\omega_{axis + 1}$")
                ax.fill_between(
                    self.times, low[:, axis], high[:, axis], alpha=0.25, color=line.get_color()
                )
            ax.set(xlabel="time (s)", ylabel=f"{unit}: median, 5 to 95 %")
        ax.legend()
        return ax

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the ensemble to a file, from which `Ensemble.load` restores it bit for bit.

        The file has the format of `numpy.savez`, with an array for each attribute.

        Parameters
        ----------
        path : str or path
            A new file without an ending gets ``.npz``. An existing file is replaced.

        Raises
        ------
        InputError
            If the file can't be written, or its name has the ending of a text file.
        """
        from pyharness.model.ensemble_file import save_ensemble

        save_ensemble(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> "Ensemble":
        """Return the ensemble that `Ensemble.save` wrote to a file.

        Raises
        ------
        InputError
            If the file can't be read, was not written by `Ensemble.save`, has another version, was
            changed or damaged, or is larger than a quarter of this machine's memory.
        """
        from pyharness.model.ensemble_file import load_ensemble

        return Ensemble(**load_ensemble(path))

    def estimates_of(self, piece: slice) -> Array:
        """Return errors and amplifications of bodies in `piece`, (2, m); (2, 0) if unrequested."""
        return _NO_ESTIMATES if self.estimates is None else self.estimates[piece].T


_NO_ESTIMATES = np.empty((2, 0), order="F")


def place_for(
    out: "Ensemble | Array | None", n: int, with_attitude: bool, with_estimates: bool = False
) -> Ensemble:
    """Return an Ensemble for n bodies: `out`, one whose omega is the array `out`, or a new one."""
    shape = (n, 3)
    if out is None or isinstance(out, np.ndarray):
        omega = np.empty(shape) if out is None else buffer_of("out", out, shape, "d")
        attitude = np.empty((n, 4)) if with_attitude else None
        estimates = np.empty((n, 2)) if with_estimates else None
        return Ensemble(omega, np.empty(n, np.int8), attitude, estimates)
    if not isinstance(out, Ensemble):
        raise InputError("out has the wrong type; allowed: an Ensemble, or an array of float64")
    buffer_of("out.omega", out.omega, shape, "d")
    buffer_of("out.status", out.status, (n,), "b")
    for name, width, is_requested, request in (
        ("attitude", 4, with_attitude, "attitude"),
        ("estimates", 2, with_estimates, "estimates=True"),
    ):
        array = getattr(out, name)
        if (array is None) == is_requested:
            raise InputError(
                f"out.{name}: allowed: an array with {request}, None without {request}"
            )
        if array is not None:
            buffer_of(f"out.{name}", array, (n, width), "d")
    return out


def _check_symmetric(name: str, matrices: Array) -> None:
    with np.errstate(over="ignore"):
        away = np.abs(matrices - matrices.swapaxes(1, 2)).max(axis=(1, 2))
    for i in np.flatnonzero(away > SYMMETRIC * np.abs(matrices).max(axis=(1, 2)))[:1]:
        symmetric_matrix(f"{name} of body {i}" if len(matrices) > 1 else name, matrices[i].tolist())
