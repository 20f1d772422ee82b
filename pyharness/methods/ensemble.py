"""The result of `solve_many`: final states of many bodies, in new or given arrays."""

from dataclasses import dataclass, field

import numpy as np

from pyharness.model.arrays import buffer_of
from pyharness.model.batch_result import BatchResult
from pyharness.model.errors import InputError
from pyharness.model.trajectory import Array


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(BatchResult):
    """The final states of many scenes, as `solve_many` returns them.

    Attributes
    ----------
    omega : ndarray, shape (n, 3)
        Angular velocities about the body axes at the end, rad/s; NaN for a body without a result.
    status : ndarray of int8, shape (n,)
        How the computation of each body ended: 0 `complete`, 2 `overflow`, 3 `refused` (the method
        does not apply to the body), 4 `gave up` (work limit exceeded, or no correct digit of the
        motion's phase left), 6 `sensitive`. A sensitive body has a result, but the rounding errors
        that its motion amplifies exceed the requested tolerance.
    attitude : ndarray, shape (n, 4), or None
        Unit quaternions from body to space at the end, scalar first; None if they were not
        requested.
    estimates : ndarray, shape (n, 2), or None
        The columns `error` and `growth`; None if they were not requested.
    t_events, y_events : list of list of ndarray, or None
        For each function of events a list of its events in the motion of each body: the times (s),
        shape (k,), and omega (rad/s), with the attitude if it is computed, shape (k, 3) or (k, 7).
        None in place of an array stands for a body without a result. Both are None if no events
        were requested.
    sensitivities : dict of ndarray, or None
        For each requested name the derivatives of omega, and of the attitude's quaternion if it is
        computed, at the end, shape (n, 3, m) or (n, 7, m), where m is the number of values of the
        parameter. They are NaN for a body without a result.
    refusals : dict of str, or None
        The reasons for missing events and sensitivities, by the number of the body (from 0), for
        bodies that have a final state.

    Examples
    --------
    >>> from pyharness import case_scene, solve_many
    >>> starts = [[0.0, 1.0, 10.0], [0.0, 2.0, 5.0]]
    >>> found = solve_many(case_scene(2), 1.0, omega0=starts)
    >>> found.omega.shape
    (2, 3)
    >>> found.has_result
    array([ True,  True])
    """

    attitude: Array | None = None
    estimates: Array | None = None
    t_events: list[list[Array | None]] | None = field(default=None, repr=False)
    y_events: list[list[Array | None]] | None = field(default=None, repr=False)
    sensitivities: dict[str, Array] | None = field(default=None, repr=False)
    refusals: dict[int, str] | None = field(default=None, repr=False)

    @property
    def error(self) -> Array | None:
        """The estimated error of each body's result, shape (n,); None if it was not requested.

        The error of omega is relative to the largest component of omega from 0 to the end. With
        attitudes it is the larger of this error and the error of the attitude's angle (rad). It is
        NaN for a body without result, and for a method that does not estimate its error.
        """
        return None if self.estimates is None else self.estimates[:, 0]

    @property
    def growth(self) -> Array | None:
        """The error amplification of each motion, shape (n,); None if it was not requested.

        It is the largest norm of the state-transition matrices from time 0 to any later time, or an
        upper bound of the largest norm to the end. It is NaN where it is unknown.
        """
        return None if self.estimates is None else self.estimates[:, 1]

    def estimates_of(self, piece: slice) -> Array:
        """Return the estimates of the bodies in `piece` as a kernel writes them, or an empty array.

        The shape is (2, m), where m is the number of bodies, or (2, 0).
        """
        return _NO_ESTIMATES if self.estimates is None else self.estimates[piece].T


_NO_ESTIMATES = np.empty((2, 0), order="F")


def place_for(
    out: "Ensemble | Array | None", n: int, with_attitude: bool, with_estimates: bool = False
) -> Ensemble:
    """Return an Ensemble into whose arrays the results of n bodies can be written.

    If `out` is None, the arrays are new. If `out` is the Ensemble of an earlier call, it is
    returned. If `out` is an array of shape (n, 3), it becomes the array of omega, and the other
    arrays are new. `with_attitude` states whether the results include attitudes, `with_estimates`
    whether they include estimates of error and error amplification. Raise InputError if an array of
    `out` has the wrong shape or type.
    """
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
    if (out.attitude is None) == with_attitude:
        raise InputError(
            "out.attitude does not match attitude0; allowed: an array with attitude0, None "
            "without it"
        )
    if out.attitude is not None:
        buffer_of("out.attitude", out.attitude, (n, 4), "d")
    if (out.estimates is None) == with_estimates:
        raise InputError(
            "out.estimates does not match estimates; allowed: an array with estimates=True, None "
            "without it"
        )
    if out.estimates is not None:
        buffer_of("out.estimates", out.estimates, (n, 2), "d")
    return out
