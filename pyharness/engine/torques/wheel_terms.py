"""The torque of wheels on their body, with components about the body axes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.engine.torques.ready import law, ready_torque, vector
from pyharness.engine.torques.term_input import law_of_vector, ready_term
from pyharness.model.arguments import count_inputs
from pyharness.model.array_type import Array
from pyharness.model.numpy_protocol import symbol_array
from pyharness.model.own_states import OwnState
from pyharness.model.state_torque import StateTorque, recorded
from pyharness.model.torque_law import TorqueLaw, law_integral, law_value
from pyharness.model.values import Numbers, three

__all__ = ["wheels"]
_THREE = (0.1, 0.2, 0.3)


@ready_torque(
    "Momentum wheels, and motors that change their momentum",
    r"$-\omega \times h - u$",
    lambda sizes: {
        "momentum": [sizes.part * x for x in sizes.vector],
        "motor": [0.1 * sizes.part * sizes.speed, 0, 0],
    },
    note="$h' = u$; `motor` may be a function of (t, omega[, attitude], h)",
    convention="`motor` is the torque on the wheels; the body receives its opposite",
    leaves=tuple({"motor": each} for each in (None, _THREE, (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))),
    momentum=vector("Momentum of the wheels at time 0", "N m s", (0.1, 0.3, 0.2), "$h$ at time 0"),
    motor=law("Torque of the motors on the wheels", "N m", (0.0, 0.002, 0.0), "$u$", frame="body"),
)
def wheels(
    momentum: Numbers, motor: TorqueLaw | Numbers | Callable[..., Any] | None = None
) -> StateTorque:
    """Return the torque -omega x h - u that wheels with the angular momentum h exert on their body.

    u is h', the rate of h. Without motors, h is constant.

    If h is the absolute angular momentum of the wheels about their axes, u is the motors' torque,
    and the inertia of the body must exclude the moments of the wheels about these axes. If h is
    relative to the body, the inertia must include these moments, and the motors' torque is u plus
    the moments times omega'.

    Parameters
    ----------
    momentum : three numbers
        The angular momentum h at time 0, about the body axes (N m s).
    motor : TorqueLaw, three numbers, or function of (t, omega[, attitude], h), optional
        The torque u (N m), about the body axes. If it is a function, h is an unknown: a scene with
        this torque gets the states ``wheel1`` to ``wheel3`` (N m s), unless it defines them.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If an argument has another form, a number is not finite, or `motor` is about the axes of
        space.

    References
    ----------
    P. C. Hughes, Spacecraft Attitude Dynamics, 1986, chapters 3 and 6.

    Examples
    --------
    >>> from pyharness.torques import wheels
    >>> wheels((1.0, 0.0, 2.0)).at(0.0, (1.0, 3.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    (-6.0, 2.0, 3.0)
    """
    start = np.array(three("[torque] wheels momentum", momentum))
    if callable(motor):
        return _wheels_under_a_law(start, motor)
    law = TorqueLaw() if motor is None else law_of_vector("[torque] wheels motor", motor, "body")

    def torque(time: Any, omega: Any, attitude: Any) -> Any:
        stored = start + law_integral(law, time)
        return np.cross(stored, omega) - law_value(law, time)

    motors = {} if motor is None else {"motor": law}
    return ready_term("wheels", torque, momentum=start, **motors)


def _wheels_under_a_law(start: Array, motor: Callable[..., Any]) -> StateTorque:
    names = [f"wheel{axis}" for axis in (1, 2, 3)]
    allowed = "allowed: a function of (t, omega, h) or (t, omega, attitude, h)"
    takes_attitude = count_inputs(motor, "[torque] wheels motor", allowed, 3, 4) == 4

    def law(t: Any, omega: Any, attitude: Any, states: Any) -> Any:
        h = symbol_array([states[name] for name in names])
        push = np.asarray(motor(t, omega, *([attitude] if takes_attitude else []), h), dtype=object)
        return -np.cross(omega, h) - push, dict(zip(names, np.broadcast_to(push, 3), strict=True))

    torque = recorded(law, names)
    return replace(torque, starts=tuple(map(OwnState, names, start.tolist())))
