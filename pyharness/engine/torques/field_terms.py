"""Torque terms of gravity and magnetic fields, and torques fixed in space."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from pyharness.engine.torques.ready import Argument, law, number, ready_torque, vector
from pyharness.engine.torques.term_input import inertia_of, is_diagonal, law_of_vector, ready_term
from pyharness.model.changing import Changing
from pyharness.model.state_torque import StateTorque, turned_law
from pyharness.model.torque_law import TorqueLaw, law_derivative, law_value, to_body
from pyharness.model.values import Number, Numbers, finite, three

__all__ = ["gravity_gradient", "in_space", "magnetic_damping", "magnetic_dipole"]
_THREE = (0.1, 0.2, 0.3)
_FIELD = (0.6, 0.3, 0.2)
# A constant field and one that rotates have different leaves.
_FIELDS = tuple(
    {"field": each} for each in (_THREE, TorqueLaw(_THREE, sines=[(_THREE, 0.4)], frame="space"))
)
_AXES = "field about the axes of space (T), magnetic moment about the axes of the body"


@ready_torque(
    "Gravity gradient in a circular orbit",
    r"$3n^2\, r \times I r$",
    lambda sizes: {"inertia": sizes.moments, "rate": sizes.rate},
    note=r"$r = R^T (\cos nt, \sin nt, 0)$",
    convention=r"the direction from the Earth to the body is $(\cos nt, \sin nt, 0)$ in space, "
    "where n is `rate`",
    inertia=Argument(
        {}, "Inertia", "kg m2", (1.0, 2.0, 2.5),
        "moments or matrix, also [changing](changing-inertia.md)", "by default that of the body",
        is_of_body=True,
    ),
    rate=number("Rate of the orbit", "rad/s", 0.3, "$n$ of the circular orbit"),
)  # fmt: skip
def gravity_gradient(inertia: Numbers | Iterable[Numbers] | Changing, rate: Number) -> StateTorque:
    """Return the gravity-gradient torque, 3 n^2 r x I r, in a circular orbit.

    I is the inertia matrix, and n the rate of the orbit. The unit vector r from the centre of
    attraction is (cos n t, sin n t, 0) along the axes of space. The torque is 0 if a principal axis
    is along r.

    Parameters
    ----------
    inertia : three numbers, three rows of three numbers, or an inertia that changes
        The moments or inertia matrix (kg m2), about the scene's axes.
    rate : float
        The rate n of the orbit (rad/s).

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If a scene would not accept `inertia`, or `rate` is not finite.

    References
    ----------
    P. C. Hughes, Spacecraft Attitude Dynamics, 1986, section 8.1.

    Examples
    --------
    >>> from pyharness.torques import gravity_gradient
    >>> torque = gravity_gradient((1.0, 2.0, 3.0), rate=2.0)
    >>> [round(x, 6) for x in torque.at(0.0, (0.0, 0.0, 0.0), (0.1, 0.5, 0.5, 0.7))]
    [3.456, 9.216, -2.0736]
    """
    changing = inertia if isinstance(inertia, Changing) else None
    given: Any = inertia
    if changing is None:
        constant = inertia_of("[torque] gravity gradient inertia", inertia)
        given = np.diag(constant).tolist() if is_diagonal(constant) else constant
    n = finite("[torque] gravity gradient rate", rate)

    def torque(time: Any, omega: Any, attitude: Any) -> Any:
        matrix = constant if changing is None else changing.matrix(time)
        (a, f, e), (_, b, d), (_, _, c) = matrix
        angle = n * time
        x, y, z = to_body((np.cos(angle), np.sin(angle), 0.0), attitude)
        # Only differences of moments occur, so that nearly equal moments cancel exactly.
        return [
            3.0 * n * n * each
            for each in (
                (c - b) * (y * z) + e * (x * y) - f * (x * z) + d * (y * y - z * z),
                (a - c) * (z * x) + f * (y * z) - d * (x * y) + e * (z * z - x * x),
                (b - a) * (x * y) + d * (x * z) - e * (y * z) + f * (x * x - y * y),
            )
        ]

    return ready_term("gravity_gradient", torque, inertia=given, rate=n)


@ready_torque(
    "Dipole in a field",
    r"$m \times b$",
    lambda sizes: {"moment": [sizes.speed * x for x in sizes.vector], "field": sizes.field},
    note="$b = R^T B$",
    convention=_AXES,
    leaves=_FIELDS,
    moment=vector(
        "Dipole moment about the axes of the body", "A m2", _THREE, "$m$ about the body axes"
    ),
    field=law(
        "Field about the axes of space", "T",
        TorqueLaw(_FIELD, sines=[((0.2, 0.0, 0.1), 0.7)], frame="space"), "$B$", frame="space",
    ),
)  # fmt: skip
def magnetic_dipole(moment: Numbers, field: TorqueLaw | Numbers) -> StateTorque:
    """Return the torque m x b on a magnetic dipole that is fixed in the body.

    The field B in space is b = R^T B about the body axes, where R rotates from body to space.

    Parameters
    ----------
    moment : three numbers
        The moment m of the dipole about the body axes (A m2).
    field : three numbers, or TorqueLaw
        The field B (T) along the axes of space; if it depends on time, a TorqueLaw with
        ``frame="space"``.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If an argument has another form, a number is not finite, or the law has another frame.

    References
    ----------
    J. R. Wertz (editor), Spacecraft Attitude Determination and Control, 1978, section 17.2.

    Examples
    --------
    >>> from pyharness.torques import magnetic_dipole
    >>> compass = magnetic_dipole((0.0, 0.0, 2.0), field=(0.5, 0.0, 0.0))
    >>> compass.at(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    (0.0, 1.0, 0.0)
    """
    dipole = np.array(three("[torque] magnetic dipole moment", moment))
    law = law_of_vector("[torque] magnetic dipole field", field, "space")
    return ready_term(
        "magnetic_dipole",
        lambda time, omega, attitude: np.cross(dipole, to_body(law_value(law, time), attitude)),
        moment=dipole,
        field=law,
    )


@ready_torque(
    "Coils that oppose the rate of the field",
    r"$-k\, b' \times b$",
    lambda sizes: {"gain": 0.3 * sizes.part, "field": sizes.vector},
    note="$b = R^T B$ has the rate $b'$ about the body axes",
    convention=_AXES,
    leaves=_FIELDS,
    gain=number("Gain", "A m2 s/T", 0.1, "$k$"),
    field=law("Field about the axes of space", "T", _FIELD, "$B$", frame="space"),
)
def magnetic_damping(gain: Number, field: TorqueLaw | Numbers) -> StateTorque:
    """Return the torque m x b of coils that damp the rotation in a magnetic field.

    The field B in space is b = R^T B about the body axes, where R rotates from body to space. The
    coils have the moment m = -k b', with b' = R^T B' - omega x b. In a constant field the torque is
    -k (|b|^2 omega - (omega . b) b), and damps the part of omega perpendicular to the field.

    Parameters
    ----------
    gain : float
        The gain k (A m2 s/T).
    field : three numbers, or TorqueLaw
        The field B (T), as in `magnetic_dipole`.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If an argument has another form, a number is not finite, or the law has another frame.

    References
    ----------
    A. C. Stickler and K. T. Alfriend, Elementary magnetic attitude control system, Journal of
    Spacecraft and Rockets 13(5), 1976, 282-287.

    Examples
    --------
    >>> from pyharness.torques import magnetic_damping
    >>> coils = magnetic_damping(2.0, field=(0.0, 0.0, 0.5))
    >>> coils.at(0.0, (1.0, 0.0, 3.0), (1.0, 0.0, 0.0, 0.0))
    (-0.5, 0.0, 0.0)
    """
    factor = finite("[torque] magnetic damping gain", gain)
    law = law_of_vector("[torque] magnetic damping field", field, "space")
    change = law_derivative(law)

    def torque(time: Any, omega: Any, attitude: Any) -> Any:
        b = to_body(law_value(law, time), attitude)
        rate = to_body(law_value(change, time), attitude) - np.cross(omega, b)
        return np.cross(-factor * rate, b)

    return ready_term("magnetic_damping", torque, gain=factor, field=law)


@ready_torque(
    "A torque about the axes of space",
    "$R^T N$",
    lambda sizes: {"torque": [sizes.part * sizes.speed * x for x in sizes.vector]},
    torque=law("Torque", "N m", (0.05, 0.02, 0.1), "$N$", frame="space"),
)
def in_space(torque: TorqueLaw | Numbers) -> StateTorque:
    """Return the torque R^T N, where N has components about the axes of space.

    R rotates from body to space. As the only torque of a scene, the TorqueLaw suffices.

    Parameters
    ----------
    torque : three numbers, or TorqueLaw
        The torque N (N m), or a TorqueLaw with ``frame="space"``.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If `torque` has another form, a number is not finite, or the law has another frame.

    References
    ----------
    H. Goldstein, C. Poole and J. Safko, Classical Mechanics, 3rd edition, 2002, section 4.9.

    Examples
    --------
    >>> from pyharness.torques import in_space
    >>> torque = in_space((1.0, 0.0, 0.0))
    >>> torque.at(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    (-1.0, 0.0, 0.0)
    """
    law = law_of_vector("[torque] in space", torque, "space")
    return ready_term(
        "in_space", lambda time, omega, attitude: turned_law(law, time, attitude), torque=law
    )
