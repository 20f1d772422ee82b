"""Many bodies in one call: side by side in the kernel, and on several cores where asked.

The blocks and the threads change no bit of a result: each body is solved by itself, as if alone.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.methods.many_starts import (
    buffer_of,
    for_each_piece,
    numbers_of,
    rows_of,
    threads_of,
    times_of,
)
from pyharness.methods.plan import FINEST
from pyharness.methods.prepared import CODES, PREPARED
from pyharness.methods.registry import REGISTRY, check_attitude, requested_tolerance
from pyharness.model.codes import Methods
from pyharness.model.effort import checked_effort
from pyharness.model.errors import InputError, unknown
from pyharness.model.extension import ENDS, extension
from pyharness.model.scene import SPACE_TORQUE, Scene, checked_scene
from pyharness.model.shown import short_repr
from pyharness.model.trajectory import WITH_ALL_ROWS, Array
from pyharness.model.values import Number, finite
from pyharness.model.waves import with_merged_rows

_RESULTS = [ENDS.index(ending) for ending in WITH_ALL_ROWS]


@dataclass(frozen=True, eq=False)
class Ensemble:
    """The ends of many scenes.

    Attributes
    ----------
    omega : ndarray, shape (n, 3)
        Angular velocity about the body axes, rad/s; NaN where there is no result.
    status : ndarray of int8, shape (n,)
        How each ended: 0 complete, 2 overflow, 3 refused, 4 gave up, 6 sensitive, which is a result
        too. A closed form does not look whether a motion is sensitive.
    attitude : ndarray, shape (n, 4), or None
        Quaternions from body to space, scalar first; None where they were not asked for.
    """

    omega: Array
    status: NDArray[np.int8]
    attitude: Array | None = None

    @property
    def ended(self) -> NDArray[np.str_]:
        """How each ended, in words: complete, sensitive, overflow, refused, gave up."""
        return np.array(ENDS)[self.status]

    __repr__ = short_repr

    @property
    def has_result(self) -> NDArray[np.bool_]:
        """Where there is one."""
        return np.isin(self.status, _RESULTS)


def solve_many(
    scene: Scene | Sequence[Scene],
    t_end: Any,
    *,
    omega0: Any = None,
    moments: Any = None,
    coefficients: Any = None,
    torque_constant: Any = None,
    torque_rate: Any = None,
    sines: Any = None,
    cosines: Any = None,
    attitude0: Any = None,
    method: str = "auto",
    tolerance: Number | None = None,
    step: Number | None = None,
    effort: float = 1.0,
    threads: int = 1,
    out: "Ensemble | Array | None" = None,
) -> Ensemble:
    """Solve many scenes, each to its end.

    Parameters
    ----------
    scene : Scene, or sequence of Scene
        What is not given as an array is taken from it; or all scenes, and no arrays.
    t_end : float, or array of shape (n,)
        Time of the results, s, on either side of 0.
    omega0, moments, coefficients, torque_constant, torque_rate : array, shape (n, 3) or (3,)
        Starts (rad/s), moments (kg m2) or A, B, C, torque (N m; 1/s2 for bodies of coefficients)
        and its rate, of each body or of all.
    sines, cosines : array, shape (n, k, 4) or (k, 4)
        Waves of torque: an amplitude of three, and the frequency (rad/s).
    attitude0 : array, shape (n, 4) or (4,)
        Quaternions at time 0, body to space, scalar first; with them the attitudes are found.
    method : str
        A name in `PREPARED`; `auto` is the closed form where no body has torque, else the series.
    tolerance : float
        As in `prepare`: largest error at the end, relative to the largest omega on the way; by
        default the method's own.
    step : float, optional
        Of the methods with a fixed step, s; by default the scene's.
    effort : float
        Factor on the work for a body, beyond which its status is `gave up`.
    threads : int
        Cores at work: the kernel holds no lock.
    out : Ensemble, or array of shape (n, 3), optional
        What to write into: the result of a call before with as many bodies, or an array for omega.

    Returns
    -------
    Ensemble
        A body that can't be solved has NaN and its status, and spoils no other: so has one with a
        number that is not finite, or a moment that is not above 0.

    Raises
    ------
    InputError
        For arrays that do not fit together, an unknown method, one that can't take what is asked.
    NotBuiltError
        Where the extension is not built.

    Examples
    --------
    >>> import numpy as np
    >>> from pyharness import case_scene, solve_many
    >>> starts = np.array([[0.0, 1.0, 10.0], [0.0, 2.0, 5.0]])
    >>> np.round(solve_many(case_scene(2), 1.0, omega0=starts).omega, 6) + 0.0
    array([[-0.958924,  0.283662, 10.      ],
           [-1.979985,  0.282253,  5.      ]])
    """
    if isinstance(scene, Scene):
        given = _from_scene(scene)
    else:
        given = _from_scenes(scene)
        for name, value in (("omega0", omega0), ("moments", moments), ("attitude0", attitude0)):
            if value is not None:
                raise InputError(f"{name} is given beside many scenes; allowed: one scene, or none")
    if moments is not None and coefficients is not None:
        raise InputError("moments and coefficients are both given; allowed: one of them")
    if moments is not None or coefficients is not None:
        given["by_moments"] = moments is not None
        given["body"] = moments if coefficients is None else coefficients
    arrays = {
        "omega0": omega0, "constant": torque_constant, "rate": torque_rate,
        "sines": sines, "cosines": cosines, "attitude": attitude0,
    }  # fmt: skip
    given.update({name: value for name, value in arrays.items() if value is not None})
    given["step"] = finite("step", given["step"] if step is None else step)
    code, tolerance = _chosen(method, tolerance)
    bodies = _Bodies(given, t_end, code, tolerance, checked_effort(effort))
    if bodies.attitude.size:
        check_attitude(method)
    return bodies.solve(threads_of(threads), out)


class _Bodies:
    """What the kernel is given, checked: arrays of one row are shared by all bodies."""

    def __init__(
        self, given: dict[str, Any], t_end: Any, code: int, tolerance: float, effort: float
    ) -> None:
        self.by_moments = bool(given["by_moments"])
        body = "moments" if self.by_moments else "coefficients"
        self.body = rows_of(body, given["body"], 3)
        self.constant = rows_of("torque_constant", given["constant"], 3)
        self.rate = rows_of("torque_rate", given["rate"], 3)
        self.sines = _waves("sines", given["sines"])
        self.cosines = _waves("cosines", given["cosines"])
        self.omega0 = rows_of("omega0", given["omega0"], 3)
        attitude = given["attitude"]
        self.attitude = np.empty((0, 4)) if attitude is None else _units(attitude)
        self.times = times_of(t_end)
        named = {
            "omega0": self.omega0, body: self.body, "torque_constant": self.constant,
            "torque_rate": self.rate, "sines": self.sines, "cosines": self.cosines,
            "attitude0": self.attitude, "t_end": self.times,
        }  # fmt: skip
        counts = {name: len(array) for name, array in named.items() if array.size}
        self.n = 0 if not self.omega0.size else max(counts.values(), default=0)
        if not self.times.size:
            self.n = 0
        for name, count in counts.items():
            if count not in (1, self.n):
                raise InputError(
                    f"{name}: {count} rows; allowed: 1, or as many as there are bodies, {self.n}"
                )
        self.constant, self.sines, self.cosines = with_merged_rows(
            self.constant, self.sines, self.cosines
        )
        if len(self.omega0) != self.n:
            self.omega0 = np.ascontiguousarray(np.broadcast_to(self.omega0, (self.n, 3)))
        self.step = given["step"]
        if not self.step > 0.0:
            raise InputError(f"step is {self.step:g}; allowed: above 0")
        self.code, self.tolerance, self.effort = code, tolerance, effort
        torque = self.constant.any() or self.rate.any() or self.sines.size or self.cosines.size
        if code == Methods.CLOSED_FORM and torque:
            raise InputError("closed-form can't take a torque here; allowed: auto, taylor")

    def solve(self, threads: int, out: "Ensemble | Array | None") -> Ensemble:
        """Return the ends."""
        found = self._place(out)
        for_each_piece(partial(self._enter, found), self.n, threads)
        return found

    def _enter(self, found: Ensemble, piece: slice, given_up: NDArray[np.int32]) -> None:
        def part(array: Array) -> Array:
            cut = array if len(array) in (0, 1) else array[piece]
            return cut.T

        nothing = np.empty((4, 0), order="F")
        extension().solve_ensemble(
            self.code, self.tolerance, self.step, self.effort, self.by_moments,
            part(self.body), part(self.constant), part(self.rate), part(self.sines),
            part(self.cosines), self.omega0[piece].T, part(self.times), part(self.attitude),
            given_up, found.omega[piece].T,
            nothing if found.attitude is None else found.attitude[piece].T, found.status[piece],
        )  # fmt: skip

    def _place(self, out: "Ensemble | Array | None") -> Ensemble:
        """Return arrays for the results."""
        shape = (self.n, 3)
        if out is None or isinstance(out, np.ndarray):
            omega = np.empty(shape) if out is None else buffer_of("out", out, shape, "d")
            attitude = np.empty((self.n, 4)) if self.attitude.size else None
            return Ensemble(omega, np.empty(self.n, np.int8), attitude)
        if not isinstance(out, Ensemble):
            raise InputError("out: allowed: an Ensemble, or an array of float64")
        buffer_of("out.omega", out.omega, shape, "d")
        buffer_of("out.status", out.status, (self.n,), "b")
        if (out.attitude is None) != (not self.attitude.size):
            raise InputError("out.attitude: allowed: an array where attitude0 is given, else None")
        if out.attitude is not None:
            buffer_of("out.attitude", out.attitude, (self.n, 4), "d")
        return out


def _from_scene(scene: Scene) -> dict[str, Any]:
    """Return a scene as arrays of one row."""
    law = checked_scene(scene, any_torque=True).torque
    if law.in_space:
        raise InputError(
            SPACE_TORQUE.replace("methods auto and taylor, with the attitude", "solve")
        )
    law = scene.body_torque
    return {
        "by_moments": scene.moments is not None,
        "body": scene.moments or scene.coefficients,
        "omega0": scene.omega,
        "constant": law.constant,
        "rate": law.rate,
        "sines": [[*amplitude, frequency] for amplitude, frequency in law.sines],
        "cosines": [[*amplitude, frequency] for amplitude, frequency in law.cosines],
        "attitude": scene.attitude,
        "step": scene.step_size,
    }


def _from_scenes(scenes: Iterable[Scene]) -> dict[str, Any]:
    """Return scenes as arrays of a row each; InputError where they can't be side by side."""
    rows = [_from_scene(checked_scene(each, any_torque=True)) for each in scenes]
    if not rows:
        raise InputError("there is no scene; allowed: a scene, or some")
    for name, what in (("by_moments", "kind of body"), ("step", "step size")):
        if len({row[name] for row in rows}) > 1:
            raise InputError(f"the scenes have more than one {what}; allowed: one for all")
    if len({row["attitude"] is None for row in rows}) > 1:
        raise InputError("some scenes have an attitude and some have none; allowed: all or none")
    found = {**rows[0]}
    for name in ("body", "omega0", "constant", "rate"):
        found[name] = np.array([row[name] for row in rows])
    if found["attitude"] is not None:
        found["attitude"] = np.array([row["attitude"] for row in rows])
    for name in ("sines", "cosines"):
        # Waves without amplitude fill up the shorter laws.
        most = max(len(row[name]) for row in rows)
        found[name] = [row[name] + [[0.0] * 4] * (most - len(row[name])) for row in rows]
    return found


def _chosen(method: str, tolerance: Number | None) -> tuple[int, float]:
    """Return the number by which the kernel knows a method, and the tolerance."""
    if not isinstance(method, str) or method not in PREPARED:
        raise unknown("method", method, PREPARED)
    finest = max(FINEST, REGISTRY[method].finest if method == "quick" else 0.0)
    asked = requested_tolerance(method, tolerance)
    if not finest <= asked <= 1.0:
        raise InputError(f"tolerance is {asked:g}; allowed: {finest:g} to 1")
    return (Methods.CLOSED_FORM_OR_TAYLOR if method == "auto" else CODES[method]), asked


def _units(values: Any) -> Array:
    """Return quaternions of length 1; NaN, which has no attitude, where there is none."""
    found = rows_of("attitude0", values, 4)
    with np.errstate(all="ignore"):
        found = found / np.abs(found).max(axis=1, keepdims=True)
        units: Array = found / np.sqrt((found * found).sum(axis=1, keepdims=True))
    return units


def _waves(where: str, values: Any) -> Array:
    found = numbers_of(where, values)
    if not found.size:
        return np.empty((1, 0, 4))
    if found.ndim not in (2, 3) or found.shape[-1] != 4:
        raise InputError(f"{where}: shape {found.shape}; allowed: (k, 4) or (n, k, 4)")
    return np.ascontiguousarray(found.reshape(-1, *found.shape[-2:]))
