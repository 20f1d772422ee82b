"""Trajectories, and the base class of results for many bodies."""

import math
import textwrap
from dataclasses import dataclass, fields, is_dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Array as Array
from pyharness.model.array_type import Maybe
from pyharness.model.attitude import turned_to_space as turned_to_space
from pyharness.model.continued import scene_at
from pyharness.model.conversions import Conversions
from pyharness.model.extension import ENDS
from pyharness.model.report import counted, short
from pyharness.model.row_errors import error_at, trusted_until

if TYPE_CHECKING:
    from pyharness.model.scene import Scene

# Largest relative rounding error in binary64.
ROUNDING = 2.0**-53
# The endings (`Trajectory.ended`) with all requested rows.
WITH_ALL_ROWS = ("complete", "sensitive", "unchecked")
ENDINGS = (*WITH_ALL_ROWS, "stopped", "overflow", "singular", "sliding", "stalled", "event")
_RESULTS = [ENDS.index(ending) for ending in WITH_ALL_ROWS]
STOP_VARIABLES = ("U1", "U2", "U3", "V1", "V2", "V3", "U", "UV")
_REASONS = {
    "overflow": "omega or the torque became infinite or NaN",
    "refused": "the method does not apply",
    "gave up": "the work limit was exceeded",
}
_WIDTH, _LINES = 100, 10
_LONGEST = 60  # most characters of one value
_SHOWN_ROWS = 3  # number of first, and of last, rows in HTML


def short_repr(result: Any) -> str:
    """Return at most ten lines on a result, with the types and shapes of arrays."""
    shown = [
        f"{each.name}={_short(value)}"
        for each in fields(result)
        if each.repr and (value := getattr(result, each.name)) is not None
    ]
    text = f"{type(result).__name__}({', '.join(shown)})"
    lines = textwrap.wrap(
        text, _WIDTH, subsequent_indent="  ", max_lines=_LINES, placeholder=" ...)",
        break_on_hyphens=False,
    )  # fmt: skip
    return "\n".join(lines)


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"<{value.dtype} {value.shape}>"
    if isinstance(value, (tuple, list)) and value and is_dataclass(value[0]):
        return f"<{len(value)} {type(value[0]).__name__}>"
    name = getattr(value, "name", None)
    if is_dataclass(value):
        return f"<{type(value).__name__}{f' {name!r}' if isinstance(name, str) else ''}>"
    text = " ".join(repr(value).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def singular_steps(ier: NDArray[Any] | None) -> str:
    """Return a phrase on the steps in which a program's matrix was singular, or ""."""
    count = 0 if ier is None else int(np.count_nonzero(ier))
    return f"a singular matrix (IER = 129) in {counted(count, 'step')}" if count else ""


@dataclass(frozen=True)
class Stop:
    """The point at which the Lipschitz test of the Runge-Kutta program ended a run.

    Attributes
    ----------
    step : int
        The number of the step, from 1, whose result is the last row.
    variable : str
        The variable that failed the test: a component of omega (`U1` to `U3`) or of the velocity
        (`V1` to `V3`), the norm of omega (`U`), or the norm of all six components (`UV`).
    quotient : float
        The Lipschitz quotient (1/s): the change of the derivative between two stages, divided by
        the change of the variable; infinite if the variable did not change.

    Examples
    --------
    >>> from pyharness import case_scene, run_program, subset
    >>> stop = run_program(case_scene(2), subset("runge-kutta"), implementation="python").stop
    >>> stop.step, stop.variable
    (25, 'V2')
    """

    step: int
    variable: str
    quotient: float


@dataclass(frozen=True, eq=False)
class Trajectory(Conversions):
    """The results of an integration, one row for each time, and how the integration ended.

    An attribute that was not computed or requested is None.

    Attributes
    ----------
    time : ndarray, shape (n,)
        The true times, s.
    recorded_time : ndarray, shape (n,)
        The variable TIME that a program of the thesis prints, s, which a defect may falsify; for
        other results, `time`.
    omega : ndarray, shape (n, 3)
        Angular velocity about the body axes, rad/s.
    velocity : ndarray, shape (n, 3), or None
        Translational velocity along the body axes, m/s.
    steps, evaluations : int
        The number of steps, and of evaluations of the right-hand side. For SciPy's methods and the
        method `reference`, `steps` is the number of rows.
    ended : str
        With all rows: "complete", "sensitive" (amplified errors may exceed the tolerance), or
        "unchecked" (SciPy may have stepped over a short change of the torque). Early endings:
        "overflow", "stopped" (by the Lipschitz test of the Runge-Kutta program), "singular" (the
        torque is undefined), "sliding" (the torque would jump back and forth without end),
        "stalled" (no step is short enough for the tolerance), or "event" (at a terminal event).
    stop : Stop or None
        Where the Lipschitz test ended the run.
    ier : ndarray of int, shape (n,), or None
        Error codes of the collocation programs' linear solver; 129 for a singular matrix.
    error : float or None
        The largest estimated error of all rows. The error of omega is relative to its largest
        component along the trajectory; the error of the attitude is an angle (rad).
    growth : float or None
        The error amplification: the largest norm of the state-transition matrix of omega from any
        time to the end.
    reason : str or None
        The time and the operation at which a recorded torque ended the integration early; or why
        a result for such a torque, or of a method of SciPy, is "sensitive".
    attitude : ndarray, shape (n, 4), or None
        Quaternions from body to space, scalar first, with continuous signs.
    own : ndarray, shape (n, k), or None
        The own states, in the order of `Scene.states`.
    moments : tuple of three floats, ChangingMoments, ChangingInertia, or None
        Principal moments (kg m2), or a changing inertia; None if the body has coefficients.
    axes : ndarray, shape (3, 3), or None
        The principal axes in columns; None if they are the body axes.
    exact : ndarray of object, shape (n, 8), or None
        Time, recorded time, omega and velocity of a program in an arithmetic other than binary64;
        the other attributes have the nearest floats.
    tolerance : float or None
        The tolerance; None for methods with a fixed step.
    scene : Scene or None
        The scene, if `solve` returned the trajectory.
    sol : DenseOutput or None
        The solution as a function of time; `save` does not write it.
    t_events : list of ndarray, or None
        The times (s) of each function's events, in the order of `time`.
    y_events : list of ndarray, or None
        The states at these times, shape (k, m) for k events and the m unknowns of `y`.
    sensitivities : dict of ndarray, or None
        By name of a parameter with m values, the derivatives of omega (rad/s), shape (n, 3, m), or
        of omega and the quaternion, shape (n, 7, m).

    Examples
    --------
    >>> from pyharness import case_scene, solve
    >>> found = solve(case_scene(2), [0.5, 1.0])
    >>> found.ended, found.omega.shape
    ('complete', (2, 3))
    """

    __repr__ = short_repr

    @property
    def digits(self) -> Maybe[float]:
        """The number of correct decimal digits of omega, from `error`, or None."""
        return digits_left(self.error)

    def error_at(self, time: float) -> Maybe[float]:
        """Return the estimated error at `time` (s), in the unit of `error`; None if unknown.

        The motion is solved again until this time. Trajectories from files do not know it.
        """
        return error_at(self, time)

    @property
    def trusted_until(self) -> Maybe[float]:
        """The time (s) of the last row before `error_at` exceeds the tolerance, or None.

        Later rows of a sensitive result may be wrong. Short spans are solved again to find it. It
        is None if errors are unknown, or the rows are on both sides of time 0.
        """
        return trusted_until(self)

    @property
    def has_all_rows(self) -> bool:
        """Whether all requested rows are present."""
        return self.ended in WITH_ALL_ROWS

    @property
    def t(self) -> Array:
        """The attribute `time` (s), shape (n,)."""
        return self.time

    @property
    def y(self) -> Array:
        """The state at each time in columns, shape (m, n).

        The rows are omega (rad/s), the quaternion if requested, and own states.
        """
        parts = [each.T for each in (self.omega, self.attitude, self.own) if each is not None]
        return np.concatenate(parts) if len(parts) > 1 else parts[0]

    @property
    def states(self) -> dict[str, Array]:
        """The own states by name, each of shape (n,)."""
        if self.own is None or self.scene is None:
            return {}
        return {each.name: self.own[:, k] for k, each in enumerate(self.scene.states)}

    def scene_at(self, time: float | None = None) -> "Scene":
        """Return the scene with `time` as its `t0`, to be continued, with the state at this time.

        Parameters
        ----------
        time : float, optional
            The time (s) of a row or an event, or with dense output any of its times; by default
            that of a terminal event, else of the last row.

        Returns
        -------
        Scene
            A copy of `scene`. An event at its `t0` is not found again.

        Raises
        ------
        InputError
            If the state at this time is unknown, or `solve` did not make the trajectory.

        Examples
        --------
        >>> from pyharness import case_scene, solve
        >>> first = solve(case_scene(1), 1.0)
        >>> solve(first.scene_at(), 2.0).omega
        array([[6., 6., 6.]])
        """
        return scene_at(self, time)

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
        """A sentence on how the integration ended."""
        if self.stop is not None:
            return (
                f"The Lipschitz test ended the run at step {self.stop.step}, because the Lipschitz "
                f"quotient of {self.stop.variable} was {short(self.stop.quotient)} 1/s."
            )
        if self.ended == "event":
            return "A terminal event ended the integration; the rows end before it or at it."
        if not self.has_all_rows:
            last = f"the last row is at t = {self.time[-1]:g} s" if len(self.time) else "no row"
            reason = self.reason or _REASONS.get(self.ended, _REASONS["overflow"])
            return f"{reason[0].upper()}{reason[1:]}; {last}."
        if self.ended == "unchecked":
            return (
                "The integration reached all requested times, but may have passed a short change "
                "of the torque, whose series ends before."
            )
        if self.ended != "sensitive":
            told = singular_steps(self.ier)
            return f"The integration reached all requested times{told and f', but with {told}'}."
        why = "" if self.reason is None else f" {self.reason[0].upper()}{self.reason[1:]}."
        if self.digits is None:
            return f"The integration reached all requested times, but may miss the tolerance.{why}"
        by = "" if self.growth is None else f", amplified by {short(self.growth)},"
        left = counted(math.floor(self.digits), "correct digit")
        return (
            f"The integration reached all requested times, but rounding errors{by} exceed the "
            f"tolerance; omega has {left}.{why}"
        )

    @property
    def nfev(self) -> int:
        """The attribute `evaluations`."""
        return self.evaluations

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
        return "\n".join([*lines, "</tbody></table>", *self.html_rows()])

    def html_rows(self) -> list[str]:
        """Return the lines of an HTML table of the results."""
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
        if count > 2 * _SHOWN_ROWS + 1:
            kept = [*range(_SHOWN_ROWS), -1, *range(count - _SHOWN_ROWS, count)]
        for row in kept:
            values = np.concatenate([np.atleast_1d(part[row]) for part in parts]).tolist()
            texts = ["..."] * len(heads) if row < 0 else [f"{value:.6g}" for value in values]
            lines.append(f"<tr>{''.join(f'<td>{text}</td>' for text in texts)}</tr>")
        return [*lines, "</tbody></table>"]


def digits_left(error: float | None) -> float | None:
    """Return how many digits are correct, 0 to 15.95 (binary64), for a relative error, or None."""
    return None if error is None else max(0.0, -math.log10(max(error, ROUNDING)))


@dataclass(frozen=True, eq=False, repr=False)
class BatchResult:
    """The angular velocities of n bodies, and how the computation of each ended."""

    omega: Array  # shape (n, ..., 3), rad/s; NaN without a result
    status: NDArray[np.int8]  # shape (n, ...); codes of `pyharness.model.codes.Statuses`

    __repr__ = short_repr

    @property
    def ended(self) -> NDArray[np.str_]:
        """The statuses as text, such as "complete", in the shape of `status`."""
        return np.array(ENDS)[self.status]

    @property
    def has_result(self) -> NDArray[np.bool_]:
        """Whether each result is present, in the shape of `status`."""
        return np.isin(self.status, _RESULTS)
