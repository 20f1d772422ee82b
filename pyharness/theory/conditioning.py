"""What the flow itself makes of small errors: the yardstick of every bound that is not a method's.

An error made at time s reaches time t multiplied by Phi(t, s), the propagator of the equations
linearised along the solution. `conditioning` follows it, so that bounds on rounding and on
tolerances can be written down before a method is tried.
"""

import math
from dataclasses import dataclass

import numpy as np

from pyharness.methods.linearised import growth, jacobians, propagators
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

ROUNDING = 2.0**-53
# Roundings in a right-hand side: two in each of A, B, C, two products, the sums.
_ROUNDINGS = 8.0
# Of a value of an attitude: some twenty roundings of each component; an angle has twice as many.
ATTITUDE = 40.0 * ROUNDING
LIVELY = 1e3  # growth of small differences up to which a tolerance is kept as it stands
_NODES_PER_RADIAN = 12.0
_FEWEST_NODES = 50
_MOST_NODES = 400_000


@dataclass(frozen=True)
class Conditioning:
    """How errors made on the way reach the end."""

    # largest factor by which an error of any omega made on the way reaches the end, at least 1
    amplification: float
    # error at the end over `largest` if every term of the right-hand side, the start and the result
    # are wrong by a few roundings, each of its own size, in the worst direction
    rounding: float
    storing: float  # the same if omega is rounded once a step, for each step
    # sum over the way of what `rounding` counts, as it was made: what the invariants see
    unamplified: float
    largest: float  # largest abs(omega) of any component on the way (rad/s)

    def limit(self, made: float, steps: float = 0.0) -> float:
        """Return the error that a method may have, over `largest`; 2 says nothing.

        `made` is the sum of the errors that it makes on the way, over `largest`, as its tolerance
        or its order tells, `steps` after how many it rounds omega: 0 where it carries on what
        rounding took off.
        """
        allowed = made * self.amplification + self.rounding + steps * self.storing
        # What is no number allows nothing.
        return 0.0 if math.isnan(allowed) else min(2.0, allowed)

    def angle_limit(self, made: float, time: float) -> float:
        """Return the error that an attitude at `time` (s) may have (rad).

        `made` is what a method makes of its tolerance; omega may have an error of its rounding all
        the way.
        """
        turned = self.rounding * (1.0 + math.sqrt(3.0) * self.largest * abs(time))
        return made + turned + ATTITUDE


def conditioning(scene: Scene, time: float) -> Conditioning:
    """Follow the linearised flow along the solution from 0 to `time` (s).

    InputError where it leaves every bound before, or so long a time would need too many nodes.
    """
    times = _nodes(scene, time)
    omega, complete = _path(scene, times)
    if not complete:
        raise InputError(f"conditioning: the solution leaves every bound before t = {time:g} s")
    return along(scene, times, omega)


def along(scene: Scene, times: Array, omega: Array) -> Conditioning:
    """Follow the linearised flow along a solution that is known.

    It has omega, shape (n, 3), at `times` from 0 (s), and turns by a small angle from each to the
    next; InputError where the flow amplifies beyond binary64.
    """
    with np.errstate(all="ignore"):
        found = _along(scene, times, omega)
    if not (math.isfinite(found.amplification) and math.isfinite(found.rounding)):
        raise InputError("conditioning: the flow amplifies beyond binary64")
    return found


def _path(scene: Scene, times: Array) -> tuple[Array, bool]:
    """Return omega at each time, and whether it is there to the end."""
    from pyharness.methods.problem import closed_form
    from pyharness.methods.solve import solve

    # Beside the separatrix an integrated path would be another one after a few turns.
    method = "closed-form" if closed_form(scene) else "taylor"
    path = solve(scene, times[1:].tolist(), method, 1e-13)
    return np.vstack([scene.omega, path.omega]), path.has_all_rows


def _nodes(scene: Scene, time: float) -> Array:
    """Return times between which the solution turns by a small angle."""
    if time == 0.0:
        return np.zeros(2)
    count = _FEWEST_NODES
    while True:
        times = np.linspace(0.0, time, count + 1)
        omega, _ = _path(scene, times)
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
    largest = float(np.abs(omega).max()) or 1.0
    flow = propagators(scene, times, omega)
    sizes = np.abs(flow)
    source = magnitudes(scene, times, omega)

    def gathered(made: Array) -> Array:
        arriving = (sizes @ made[:, :, None])[:, :, 0]
        return np.asarray((0.5 * (arriving[1:] + arriving[:-1]) * np.abs(steps)[:, None]).sum(0))

    # The start and the result are rounded once, however short the time.
    ends = sizes[0] @ np.abs(omega[0]) + np.abs(omega[-1])
    span = abs(float(times[-1])) or 1.0
    unamplified = float((0.5 * (source[1:] + source[:-1]) * np.abs(steps)[:, None]).sum(0).max())
    return Conditioning(
        amplification=growth(flow),
        rounding=_ROUNDINGS * ROUNDING * float((gathered(source) + ends).max()) / largest,
        # Not over their product, which may be too small a number.
        storing=ROUNDING * float(gathered(np.abs(omega)).max()) / span / largest,
        unamplified=_ROUNDINGS * ROUNDING * (unamplified / largest + 2.0),
        largest=largest,
    )


def magnitudes(scene: Scene, times: Array, omega: Array) -> Array:
    """Return the sum of the sizes of all terms of each right-hand side, shape (n, 3).

    A wave counts with its angle: a rounding of frequency times t is a rounding of that many
    radians.
    """
    products = np.abs(scene.euler_coefficients) * np.abs(
        np.roll(omega, -1, 1) * np.roll(omega, -2, 1)
    )
    law = scene.body_torque
    moments = np.array(scene.moments or (1.0, 1.0, 1.0))
    torque = np.abs(law.constant) + np.abs(law.rate) * np.abs(times)[:, None]
    for amplitude, frequency in law.sines + law.cosines:
        torque = torque + np.abs(amplitude) * (1.0 + np.abs(frequency * times))[:, None]
    return np.asarray(products + torque / moments)
