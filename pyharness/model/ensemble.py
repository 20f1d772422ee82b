"""The result of `solve_many`: final states of many bodies."""

from dataclasses import dataclass, field

import numpy as np

from pyharness.model.arrays import buffer_of
from pyharness.model.errors import InputError
from pyharness.model.trajectory import Array, BatchResult


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(BatchResult):
    """The final states of many scenes, from `solve_many`.

    Attributes
    ----------
    omega : ndarray, shape (n, 3)
        Angular velocities about the body axes, rad/s; NaN for a body without a result.
    status : ndarray of int8, shape (n,)
        How each computation ended: 0 `complete`, 2 `overflow`, 3 `refused` (the method does not
        apply), 4 `gave up` (work limit exceeded, or no correct digit of the phase left), 6
        `sensitive` (amplified rounding errors exceed the tolerance).
    attitude : ndarray, shape (n, 4), or None
        Unit quaternions from body to space, scalar first. This and the following fields are None if
        not requested.
    estimates : ndarray, shape (n, 2), or None
        The columns `error` and `growth`.
    t_events, y_events : list of list of ndarray, or None
        Times (s) and states of events, indexed by function, then by body: for k events shape (k,),
        and (k, 3) or (k, 7); None for a body without a result.
    sensitivities : dict of ndarray, or None
        By name, the derivatives of the final states with respect to a parameter with m values,
        shape (n, 3, m) or (n, 7, m); NaN for a body without a result.
    refusals : dict of str, or None
        The reasons for missing events and sensitivities, by index of the body.

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
        """The estimated errors, shape (n,), as in `Trajectory`; NaN where unknown."""
        return None if self.estimates is None else self.estimates[:, 0]

    @property
    def growth(self) -> Array | None:
        """The error amplifications, or upper bounds, shape (n,); NaN where unknown."""
        return None if self.estimates is None else self.estimates[:, 1]

    def estimates_of(self, piece: slice) -> Array:
        """Return the estimates of m bodies, shape (2, m), or (2, 0) if not requested."""
        return _NO_ESTIMATES if self.estimates is None else self.estimates[piece].T


_NO_ESTIMATES = np.empty((2, 0), order="F")


def place_for(
    out: "Ensemble | Array | None", n: int, with_attitude: bool, with_estimates: bool = False
) -> Ensemble:
    """Return `out`, or a new Ensemble, for n bodies; raise InputError for a wrong array."""
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
