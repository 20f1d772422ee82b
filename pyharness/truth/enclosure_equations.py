"""Equations of motion of a scene, for all number types of `balls`."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

from flint import arb

from pyharness.model.attitude import IDENTITY, quaternion_rates
from pyharness.model.dual import Dual
from pyharness.model.errors import InputError
from pyharness.model.inertia_rates import rates_of_inertia
from pyharness.model.scene import Scene
from pyharness.model.state_torque import of_law
from pyharness.model.tape import Tape, evaluate
from pyharness.model.torque_law import TorqueLaw
from pyharness.truth.balls import ball, functions_at
from pyharness.truth.enclosed import scales_of
from pyharness.truth.integer_series import exact_body

# The right-hand side f(t, y): derivatives of all unknowns at a time (s) and a state.
Rates = Callable[[Any, Sequence[Any]], list[Any]]


class Equations:
    """The equations of motion of a scene, with exact coefficients.

    The unknowns are omega (rad/s), the scene's quaternion, the velocity (m/s) and, with
    `transition`, the derivatives of omega and attitude by omega at time 0, row by row. `blocks` are
    the slices of the groups that are present, `scales` the units of errors.
    """

    def __init__(self, scene: Scene, velocity: bool, transition: bool) -> None:
        tapes = _tapes(scene)
        if any(each.needs_attitude for each in tapes) and scene.attitude is None:
            raise InputError(
                "a torque that depends on the attitude needs it; give the scene an attitude"
            )
        self._tapes, self._scene = tapes, scene
        self._velocity, self._transition = velocity, transition
        self._turning = 3 if scene.attitude is None else 7
        self.start = [Fraction(x) for x in (*scene.omega, *(scene.attitude or ()))]
        sizes = [3, *([4] if self._turning == 7 else [])]
        if velocity:
            self.start += [Fraction(0)] * 3
            sizes.append(3)
        if transition:
            self.start += [Fraction(i == j) for i in range(self._turning) for j in range(3)]
            sizes.append(3 * self._turning)
        ends = [sum(sizes[:k]) for k in range(len(sizes) + 1)]
        self.blocks = [slice(*each) for each in pairwise(ends)]
        self.breaks = [t for each in tapes for t in each.breaks]
        self._principal: list[Any] | None = None
        self._moments = [arb(1)] * 3
        self.scales = [1.0] * len(self.start)
        if scene.changing is None and scene.inertia is None:
            moments, coefficients = exact_body(scene)
            self._moments = list(map(ball, moments))
            self._principal = list(map(ball, coefficients))
            self.scales[:3] = scales_of(coefficients)
        elif scene.inertia is not None:
            self._inertia = [[arb(x) for x in row] for row in scene.inertia]
        self._push = [arb(force) / arb(scene.masses[0]) for force in scene.forces]

    def at(self, begin: Fraction, forward: bool) -> Rates:
        """Return the right-hand side for a step after `begin` (s), or before unless `forward`."""
        functions = functions_at(begin, forward)

        def rates(time: Any, state: Sequence[Any]) -> list[Any]:
            omega, rest = list(state[:3]), list(state[3:])
            q, rest = (rest[:4], rest[4:]) if self._turning == 7 else ([], rest)
            v, rest = (rest[:3], rest[3:]) if self._velocity else ([], rest)
            slopes: list[Any] = []
            if self._transition:
                inner = [Dual(x, rest[3 * k : 3 * k + 3]) for k, x in enumerate((*omega, *q))]
                moved = self._evaluate(time, inner[:3], inner[3:], functions)
                found = [each.value for each in moved]
                slopes = [slope for each in moved for slope in each.slopes]
            else:
                found = self._evaluate(time, omega, q, functions)
            if v:
                (x, y, z), (a, b, c) = omega, v
                cross = (b * z - c * y, c * x - a * z, a * y - b * x)
                found += [p + push for p, push in zip(cross, self._push, strict=True)]
            return found + slopes

        return rates

    def _evaluate(self, time: Any, omega: list[Any], q: list[Any], functions: Any) -> list[Any]:
        inputs = [time, *omega, *(q or IDENTITY)]
        parts = [evaluate(each, inputs, functions) for each in self._tapes]
        torque = [sum(each[1:], each[0]) for each in zip(*parts, strict=True)]
        x, y, z = omega
        if self._principal is not None:
            products = (y * z, z * x, x * y)
            terms = zip(self._principal, products, torque, self._moments, strict=True)
            found = [a * product + n / moment for a, product, n, moment in terms]
        elif self._scene.inertia is not None:
            found = rates_of_inertia(self._inertia, omega, torque)
        else:
            found = self._changing_rates(time, omega, torque)
        return found + (list(quaternion_rates((x, y, z), q)) if q else [])

    def _changing_rates(self, time: Any, omega: list[Any], torque: list[Any]) -> list[Any]:
        changing = self._scene.changing
        assert changing is not None
        matrix = changing.matrix(Dual(time, [arb(1)]))
        # An element that is constant is a float, whose quotients Python would round.
        values = [[x.value if isinstance(x, Dual) else arb(x) for x in row] for row in matrix]
        pushed = [
            n
            - sum(
                (x.slopes[0] * w for x, w in zip(row, omega, strict=True) if isinstance(x, Dual)),
                arb(0),
            )
            for n, row in zip(torque, matrix, strict=True)
        ]
        return rates_of_inertia(values, omega, pushed)


def _tapes(scene: Scene) -> list[Tape]:
    """Return tapes whose sum is the torque; a law has one per wave, to avoid rounded sums."""
    law = scene.torque
    if isinstance(law, TorqueLaw):
        laws = [TorqueLaw(law.constant, law.rate, frame=law.frame)]
        laws += [TorqueLaw(sines=[wave], frame=law.frame) for wave in law.sines]
        laws += [TorqueLaw(cosines=[wave], frame=law.frame) for wave in law.cosines]
        tapes = [of_law(each).tape for each in laws]
    else:
        tapes = [law.tape]
    found = [each for each in tapes if each is not None]
    if not found:
        raise InputError(
            "an opaque torque can't be enclosed; allowed: a torque that can be recorded"
        )
    return found
