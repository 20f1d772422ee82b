"""What the flow itself makes of small errors: the yardstick of every bound that is not a method's.

An error made at time s reaches time t multiplied by Phi(t, s), the propagator of the equations
linearised along the solution. `conditioning` follows it, so that bounds on rounding and on
tolerances can be written down before a method is tried.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from pyharness.errors import InputError
from pyharness.scene import Scene
from pyharness.trajectory import Array

ROUNDING = 2.0**-53
# Roundings in a right-hand side: two in each of A, B, C, two products, the sums.
_ROUNDINGS = 8.0
_NODES_PER_RADIAN = 12.0
_FEWEST_NODES = 50
_MOST_NODES = 400_000


@dataclass(frozen=True)
class Conditioning:
    """How errors of the data reach the end.

    Attributes
    ----------
    amplification : float
        Largest factor by which an error of omega made on the way reaches the end, at least 1.
    rounding : float
        Error at the end over the largest abs(omega) if every term of the right-hand side and
        the start are wrong by a few roundings throughout, in the worst direction.
    largest : float
        Largest abs(omega) of any component on the way (rad/s).
    """

    amplification: float
    rounding: float
    largest: float

    def limit(self, tolerance: float) -> float:
        """Return the error that a method with a tolerance may have, over `largest`.

        The tolerance amplified as an error made on the way would be, plus rounding; 2, which
        says nothing, where that is more.
        """
        return min(2.0, tolerance * self.amplification + self.rounding)


def conditioning(scene: Scene, time: float) -> Conditioning:
    """Follow the linearised flow along the solution from 0 to `time` (s).

    Raises
    ------
    InputError
        Where the solution leaves every bound before, or so long a time would need too many
        nodes.
    """
    from pyharness.methods import solve

    times = _nodes(scene, time)
    path = solve(scene, times[1:].tolist(), "taylor", 1e-13)
    if path.ended != "complete":
        raise InputError(f"conditioning: the solution leaves every bound before t = {time:g} s")
    omega = np.vstack([scene.omega, path.omega])
    with np.errstate(all="ignore"):
        found = _along(scene, times, omega)
    if not (math.isfinite(found.amplification) and math.isfinite(found.rounding)):
        raise InputError("conditioning: the flow amplifies beyond binary64")
    return found


def _nodes(scene: Scene, time: float) -> Array:
    """Return times between which the solution turns by a small angle."""
    from pyharness.methods import solve

    if time == 0.0:
        return np.zeros(2)
    count = _FEWEST_NODES
    while True:
        times = np.linspace(0.0, time, count + 1)
        path = solve(scene, times[1:].tolist(), "taylor", 1e-13)
        omega = np.vstack([scene.omega, path.omega])
        with np.errstate(all="ignore"):
            largest = float(np.abs(jacobians(scene, omega)).sum(axis=2).max())
        wanted = largest * abs(time) * _NODES_PER_RADIAN
        # NaN where numbers so large meet that their product has no meaning.
        if not wanted <= _MOST_NODES:
            raise InputError("conditioning: too long a time for so fast a motion")
        if count >= wanted:
            return times
        count = math.ceil(wanted)


def _along(scene: Scene, times: Array, omega: Array) -> Conditioning:
    steps = np.diff(times)
    middle = 0.5 * (omega[1:] + omega[:-1])
    largest = float(np.abs(omega).max()) or 1.0
    # Between nodes the Jacobian hardly changes: its exponential is the propagator.
    pieces = exponentials(steps[:, None, None] * jacobians(scene, middle))
    propagator = np.eye(3)
    norms = np.empty(len(times))
    norms[-1] = 1.0
    for k in range(len(steps) - 1, -1, -1):
        propagator = propagator @ pieces[k]
        norms[k] = np.abs(propagator).sum(axis=1).max()
    norms = np.minimum(norms, 1e300)
    amplification = float(max(1.0, norms.max()))
    source = _magnitude(scene, times, omega)
    weights = norms * source
    integral = float(np.sum(0.5 * (weights[1:] + weights[:-1]) * np.abs(steps)))
    # The start and the result are rounded once, however short the time.
    data = (integral + float(norms[0]) * max(map(abs, scene.omega))) / largest + 1.0
    return Conditioning(amplification, _ROUNDINGS * ROUNDING * data, largest)


def exponentials(small: Array) -> Array:
    """Return the exponentials of matrices below 1 in norm, to seven digits."""
    total = np.broadcast_to(np.eye(3), small.shape)
    for k in range(8, 0, -1):
        total = np.eye(3) + small @ total / k
    return total


def jacobians(scene: Scene, omega: Array) -> Array:
    """Return the derivatives of equations 13-15 at each omega, shape (n, 3, 3)."""
    a, b, c = scene.euler_coefficients
    x, y, z = omega.T
    zero = np.zeros(len(omega))
    rows = [[zero, a * z, a * y], [b * z, zero, b * x], [c * y, c * x, zero]]
    return np.array(rows).transpose(2, 0, 1)


def _magnitude(scene: Scene, times: Array, omega: Array) -> Array:
    """Return the sum of the sizes of all terms of the right-hand side, the largest of the axes.

    A wave counts with its angle: a rounding of frequency times t is a rounding of that many
    radians.
    """
    products = np.abs(np.array(scene.euler_coefficients)) * np.abs(
        np.column_stack([omega[:, (i + 1) % 3] * omega[:, (i + 2) % 3] for i in range(3)])
    )
    law = scene.torque
    moments = np.array(scene.moments or (1.0, 1.0, 1.0))
    torque = np.abs(law.constant) + np.abs(law.rate) * np.abs(times)[:, None]
    for amplitude, frequency in law.sines + law.cosines:
        torque = torque + np.abs(amplitude) * (1.0 + np.abs(frequency * times))[:, None]
    return np.asarray((products + torque / moments).max(axis=1))


def scaled(scene: Scene, factor: float) -> Scene:
    """Return the scene with the solution factor omega(factor t): the same motion, faster.

    A power of 2 as factor changes no digit of any quantity.
    """
    law = scene.torque
    square = factor * factor

    def times(values: tuple[float, float, float], by: float) -> tuple[float, float, float]:
        first, second, third = values
        return first * by, second * by, third * by

    return replace(
        scene,
        omega=times(scene.omega, factor),
        torque=replace(
            law,
            constant=times(law.constant, square),
            rate=times(law.rate, square * factor),
            sines=tuple((times(a, square), f * factor) for a, f in law.sines),
            cosines=tuple((times(a, square), f * factor) for a, f in law.cosines),
        ),
        step_size=scene.step_size / factor,
    )
