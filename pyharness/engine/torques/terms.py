"""Torque terms for damping and control, with components about the body axes."""

from collections.abc import Iterable
from itertools import islice
from typing import Any

import numpy as np

from pyharness.engine.torques.ready import (
    MATRIX,
    Argument,
    flag,
    matrix,
    quaternion,
    ready_torque,
    vector,
)
from pyharness.engine.torques.term_input import matrix_of, ready_term
from pyharness.model.attitude import IDENTITY, product, unit_quaternion
from pyharness.model.errors import InputError
from pyharness.model.state_torque import StateTorque
from pyharness.model.values import Number, Numbers, boolean, number_list, three

__all__ = ["attitude_control", "damping", "drag", "rate_control"]
# A number stands for a multiple of the identity matrix, three numbers for a diagonal matrix.
MatrixLike = Number | Numbers | Iterable[Numbers]
_MOST_COEFFICIENTS = 50
_BRAKES = "positive coefficients brake the rotation"


@ready_torque(
    "Torque -D omega",
    r"$-D\omega$",
    lambda sizes: {"matrix": sizes.several},
    convention=_BRAKES,
    matrix=matrix("D", "N m s", (0.05, 0.1, 0.15), "$D$"),
)
def damping(matrix: MatrixLike) -> StateTorque:
    """Return the torque -D omega of linear damping.

    The body loses the power omega . D omega (W), which is never negative if the symmetric part of D
    is positive semidefinite.

    Parameters
    ----------
    matrix : number, three numbers, or three rows of three numbers
        The matrix D (N m s): a multiple of the identity, a diagonal, or all elements.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If `matrix` has another form, or a number is not finite.

    References
    ----------
    H. Goldstein, C. Poole and J. Safko, Classical Mechanics, 3rd edition, 2002, section 1.5
    (Rayleigh's dissipation function).

    Examples
    --------
    >>> from pyharness.torques import damping
    >>> damping([0.5, 0.25, 0.125]).at(0.0, (1.0, 2.0, 4.0), (1.0, 0.0, 0.0, 0.0))
    (-0.5, -0.5, -0.5)
    """
    found = matrix_of("[torque] damping matrix", matrix)
    return ready_term("damping", lambda time, omega, attitude: -(found @ omega), matrix=found)


@ready_torque(
    "Sum of -C_n |omega|^(2n) omega",
    r"$-\sum_n C_n \lvert\omega\rvert^{2n} \omega$",
    lambda sizes: {"coefficients": [0.1 * sizes.part, 0.2 * sizes.part / sizes.speed**2]},
    convention=_BRAKES,
    leaves=tuple({"coefficients": each} for each in ([0.1], [0.0, 0.1], [0.1, 0.2])),
    coefficients=Argument(
        {"type": "array", "items": MATRIX}, "C_n from n = 0",
        "N m (s/rad)^(2n+1)", [0.0, 0.1], "$C_n$ from n = 0",
    ),
    per_axis=flag(
        "Powers of each component of omega instead", "", False,
        "true for powers of components instead of the magnitude",
    ),
)  # fmt: skip
def drag(coefficients: Iterable[MatrixLike], per_axis: bool = False) -> StateTorque:
    """Return a drag torque that is an odd polynomial of omega.

    It is the sum over n = 0, 1, 2, ... of -C_n |omega|^(2n) omega. With `per_axis` it is the sum of
    -C_n v_n, where v_n has the components omega_i^(2n+1). For quadratic drag, -k |omega| omega, use
    a Python function with ``numpy.sqrt``; omega must stay away from 0.

    Parameters
    ----------
    coefficients : iterable of numbers, three numbers, or three rows of three numbers
        1 to 50 coefficients C_0, C_1, ..., in N m (s/rad)^(2n+1), each as in `damping`.
    per_axis : bool
        Whether to take powers of the components, not of |omega|.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If `coefficients` has another form.

    References
    ----------
    S. H. Strogatz, Nonlinear Dynamics and Chaos, 2nd edition, 2015, section 7.2 (cubic damping).

    Examples
    --------
    >>> from pyharness.torques import drag
    >>> drag([0.0, 0.5]).at(0.0, (1.0, 2.0, 2.0), (1.0, 0.0, 0.0, 0.0))
    (-4.5, -9.0, -9.0)
    """
    where = "[torque] drag coefficients"
    allowed = f"allowed: a list of 1 to {_MOST_COEFFICIENTS} coefficients"
    given = list(islice(number_list(where, coefficients, allowed), _MOST_COEFFICIENTS + 1))
    if not 1 <= len(given) <= _MOST_COEFFICIENTS:
        count = f"more than {_MOST_COEFFICIENTS}" if given else "no"
        raise InputError(f"{where}: {count} coefficients; {allowed}")
    matrices = [matrix_of(f"{where}, number {n}", each) for n, each in enumerate(given)]
    per_axis = boolean("[torque] drag per_axis", per_axis)

    def torque(time: Any, omega: Any, attitude: Any) -> Any:
        square = omega * omega if per_axis else omega @ omega
        power, total = omega, -(matrices[0] @ omega)
        for each in matrices[1:]:
            power = square * power
            total = total - each @ power
        return total

    return ready_term("drag", torque, coefficients=matrices, per_axis=per_axis)


@ready_torque(
    "Torque -K (omega - target)",
    r"$-K(\omega - \omega_0)$",
    lambda sizes: {"gain": sizes.several, "target": [sizes.speed * x for x in sizes.vector]},
    convention=_BRAKES,
    gain=matrix("K", "N m s", 0.2, "$K$"),
    target=vector("Target of omega", "rad/s", (0.1, 0.2, 0.5), r"$\omega_0$ about the body axes"),
)
def rate_control(gain: MatrixLike, target: Numbers = (0.0, 0.0, 0.0)) -> StateTorque:
    """Return the torque -K (omega - target), which controls the angular velocity.

    Alone, with a positive definite K and the target 0, it drives any omega to 0. A target along a
    principal axis attracts nearby omegas if K is large enough: for a number K and the middle axis,
    K > |target| sqrt((I3 - I2) (I2 - I1)), with the moments I1 < I2 < I3.

    Parameters
    ----------
    gain : number, three numbers, or three rows of three numbers
        The matrix K (N m s), written as in `damping`.
    target : three numbers
        The desired angular velocity about the body axes (rad/s).

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If an argument has another form, or a number is not finite.

    References
    ----------
    B. Wie, Space Vehicle Dynamics and Control, 2nd edition, 2008, chapter 7.

    Examples
    --------
    >>> from pyharness.torques import rate_control
    >>> rate_control(2.0, (0.0, 0.0, 1.0)).at(0.0, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0))
    (-2.0, -4.0, -4.0)
    """
    matrix = matrix_of("[torque] rate control gain", gain)
    wanted = np.array(three("[torque] rate control target", target))
    return ready_term(
        "rate_control",
        lambda time, omega, attitude: -(matrix @ (omega - wanted)),
        gain=matrix,
        target=wanted,
    )


@ready_torque(
    "Torque towards a target attitude, with damping",
    r"$-2k\,e_0 e - K\omega$",
    lambda sizes: {
        "stiffness": sizes.part * sizes.speed, "gain": sizes.several,
        "target": [1.0, *sizes.vector],
    },
    note="error $(e_0, e)$: the target's conjugate times $q$",
    convention="the target is a quaternion from body to space, scalar first",
    stiffness=matrix("Stiffness", "N m", 0.5, "$k$"),
    gain=matrix("Gain of the rate", "N m s", 0.2, "$K$"),
    target=quaternion("Target attitude", "", IDENTITY),
)  # fmt: skip
def attitude_control(
    stiffness: MatrixLike, gain: MatrixLike, target: Numbers = IDENTITY
) -> StateTorque:
    """Return the torque -2 k e0 e - K omega, which rotates the body to a target attitude.

    For the attitude q, the error quaternion (e0, e) is target* q, with the conjugate target*. A
    quaternion and its negative have the same torque, so that the body does not rotate the long way
    round (unwinding). Let a be the angle of the error. If k is a number, the first term is -k
    sin(a) about the axis of the error, and the equilibrium at a = 180 degrees is unstable.

    Parameters
    ----------
    stiffness : number, three numbers, or three rows of three numbers
        The matrix k (N m), written as in `damping`.
    gain : number, three numbers, or three rows of three numbers
        The matrix K (N m s) of the damping.
    target : four numbers
        The desired quaternion from body to space, scalar first; it is normalised.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If an argument has another form, a number is not finite, or `target` is 0.

    References
    ----------
    N. A. Chaturvedi, A. K. Sanyal and N. H. McClamroch, Rigid-body attitude control, IEEE Control
    Systems Magazine 31(3), 2011, 30-51.

    Examples
    --------
    >>> from pyharness.torques import attitude_control
    >>> control = attitude_control(5.0, 1.0)
    >>> control.at(0.0, (0.0, 2.0, 3.0), (0.8, 0.6, 0.0, 0.0))
    (-4.8, -2.0, -3.0)
    """
    where = "[torque] attitude control"
    spring = matrix_of(f"{where} stiffness", stiffness)
    brake = matrix_of(f"{where} gain", gain)
    unit, _ = unit_quaternion(f"{where} target", target)
    a, b, c, d = unit

    def torque(time: Any, omega: Any, attitude: Any) -> Any:
        scalar, *vector = product((a, -b, -c, -d), tuple(attitude))
        half_sine = np.array([scalar * each for each in vector], dtype=object)
        return -2.0 * (spring @ half_sine) - brake @ omega

    return ready_term("attitude_control", torque, stiffness=spring, gain=brake, target=unit)
