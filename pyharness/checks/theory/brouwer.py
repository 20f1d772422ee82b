"""Bounds on rounding errors over many steps of torque-free motion, by Brouwer's law.

Brouwer 1937, Astronomical Journal 46: with random rounding, errors of energy and momentum grow with
the power 1/2 of the number of steps, the phase error with 3/2; with biased rounding, with 1 and 2.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from pyharness.engine.methods.linearised import jacobians
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.elliptic import torque_free

ROUNDING = 2.0**-53
# Hoeffding 1963: a sum of n independent terms of mean 0 and magnitude at most c exceeds 4 c sqrt(n)
# with a probability of at most 2 exp(-8).
DEVIATIONS = 4.0
LAWS = {"energy": 0.5, "momentum": 0.5, "phase": 1.5}  # powers of the number of steps
_SAMPLES = 256
WALK = Basis(
    "derived",
    "errors of energy, momentum and phase after n steps",
    "Hoeffding 1963, if rounding errors are independent with mean 0; running error analysis of a "
    "step at samples of the motion (`theory/brouwer.py`)",
)
"""Basis of the limits of `Orbit`."""
POWER = Basis(
    "derived",
    "fitted power of the number of steps with which errors grow",
    "Brouwer 1937: nearer to the expected power than to the other one (`theory/brouwer.py`)",
)
"""Basis of the limits for the result of `exponent`."""


@dataclass(frozen=True)
class Noise:
    """Bounds on the errors of a step, relative to the largest abs(omega)."""

    step: float  # step size, s
    rounding: float  # bound on the rounding error, of random sign
    truncation: float  # bound on the truncation error, possibly biased
    # whether the truncation error conserves energy and momentum, and affects only the phase
    conserves: bool


@dataclass(frozen=True, eq=False)
class Orbit:
    """Samples of a torque-free motion, and factors for error bounds."""

    # Samples along the motion, shapes (n, 3), (n, 3), (n, 3, 3): omega (rad/s), its time derivative
    # (rad/s2), and the derivative's Jacobian (1/s).
    states: Array
    slopes: Array
    jacobians: Array
    largest: float  # largest abs(omega), rad/s
    frequency: float  # 2 pi divided by the period of omega (rad/s)
    # Largest factors from an error of omega, relative to `largest`, to the errors of energy and
    # momentum (both relative) and of the frequency (rad/s).
    gains: dict[str, float]
    turn: float  # largest factor from an error of omega, relative to `largest`, to the phase (rad)

    def limits(self, noise: Noise, steps: float) -> dict[str, float]:
        """Return bounds after `steps` steps: "energy", "momentum" (relative), "phase" (rad)."""
        walk = DEVIATIONS * noise.rounding * math.sqrt(steps)
        drift = steps * noise.truncation
        # The result is rounded once more. Two roundings in each of A, B and C change the conserved
        # quantities by at most four units of rounding.
        lost = walk + (0.0 if noise.conserves else drift) + ROUNDING
        conserved = ("energy", "momentum")
        found = {name: lost * self.gains[name] + 4.0 * ROUNDING for name in conserved}
        # An error in step k of n shifts the frequency for n - k steps; the sum of (n - k)**2 is
        # near n**3 / 3.
        shear = self.gains["frequency"] * noise.step
        late = walk * steps / math.sqrt(3.0)
        if not noise.conserves:
            late += 0.5 * drift * steps
        found["phase"] = (walk + drift + ROUNDING) * self.turn + shear * late
        return found


def orbit(scene: Scene) -> Orbit:
    """Return samples of omega over two periods, and factors for error bounds.

    The scene must have moments and no torque.
    """
    a = np.array(scene.euler_coefficients)
    frequency = _frequency(a, np.array(scene.omega))
    times = np.linspace(0.0, 4.0 * math.pi / frequency, _SAMPLES).tolist()
    states = floats([torque_free(scene, t, rounded=True) for t in times])
    largest = float(np.abs(states).max())
    slopes = a * np.roll(states, -1, 1) * np.roll(states, -2, 1)
    moments = np.array(scene.moments)
    turns = frequency * largest * np.abs(slopes).sum(axis=1) / (slopes**2).sum(axis=1)
    gains = {}
    for name, power in (("energy", 1), ("momentum", 2)):
        weight = moments**power
        total = (weight * states**2).sum(axis=1)
        part = (weight * np.abs(states)).sum(axis=1) * largest / total
        # The energy is a quadratic form of omega, the momentum the square root of one.
        gains[name] = float(part.max()) * (2.0 if name == "energy" else 1.0)
    gains["frequency"] = largest * max(_steepness(a, state) for state in states)
    along = jacobians(scene, states)
    return Orbit(states, slopes, along, largest, frequency, gains, float(turns.max()))


def floats(rows: Sequence[Sequence[Decimal]]) -> Array:
    return np.array([[float(x) for x in row] for row in rows])


def taylor_noise(body: Orbit, scene: Scene, step: float, order: int, left_out: float) -> Noise:
    """Return bounds on the errors of a Taylor step of size `step` (s), by running error analysis.

    `left_out` is the relative truncation error.
    """
    a = np.abs(np.array(scene.euler_coefficients))
    terms, errors = _terms(body, scene, step, order), [np.abs(body.states)]
    # Term k is a sum of k products of lower terms, with the errors of their factors and at most
    # k + 3 roundings. The sum of the terms rounds each term three times.
    for k in range(1, order + 1):
        size, carried = np.zeros((2, *body.states.shape))
        for j in range(k):
            x, y = np.roll(terms[j], -1, 1), np.roll(terms[k - 1 - j], -2, 1)
            size += np.abs(x * y)
            carried += np.roll(errors[j], -1, 1) * np.abs(y)
            carried += np.abs(x) * np.roll(errors[k - 1 - j], -2, 1)
        errors.append(a * (step / k) * (carried + (k + 3.0) * size))
    total = sum(e + 3.0 * np.abs(t) for e, t in zip(errors[1:], terms[1:], strict=True))
    return Noise(step, ROUNDING * float(np.max(total)) / body.largest, left_out, conserves=False)


def gauss_noise(body: Orbit, scene: Scene, step: float, stages: int) -> Noise:
    """Return bounds on the errors of a Gauss collocation step of size `step` (s)."""
    from pyharness.checks.theory.tableau import tableau

    matrix = tableau("collocation", stages, "gauss").matrix
    rate = float(np.abs(body.slopes).max())
    stiffness = float(np.abs(body.jacobians).sum(axis=2).max())
    spread = float(np.abs(matrix).sum(axis=1).max())
    eye = np.eye(3 * stages)
    # With s stages and step size h, the sum that gives omega at a node has s + 3 roundings of the
    # right-hand sides and one of omega. Its error is multiplied by the inverse of 1 - h A J, with
    # the tableau's matrix A and the Jacobian J.
    inverses = [np.linalg.inv(eye - step * np.kron(matrix, each)) for each in body.jacobians[::8]]
    resolvent = max(float(np.abs(each).sum(axis=1).max()) for each in inverses)
    state = body.largest
    at_node = step * spread * ((stages + 3.0) * rate + stiffness * state) * resolvent
    total = step * ((stages + 4.0) * rate + stiffness * (state + at_node))
    # The truncation error is the integral of the state-transition matrix times the residual, which
    # is zero at the nodes, the zeros of an orthogonal polynomial. Divide the integrand by this
    # polynomial. In the Taylor series of the quotient, powers of time below s contribute nothing;
    # only the power s is retained. By Leibniz's rule, its coefficient is a sum over j of multiples
    # of (h J)**j / j! times the Taylor term 2s + 1 - j of omega.
    factor = math.factorial(stages) ** 4 / math.factorial(2 * stages) ** 2 / (2 * stages + 1)
    terms = [float(np.abs(each).max()) for each in _terms(body, scene, step, 2 * stages + 1)]
    left_out = factor * sum(
        (step * stiffness) ** j / math.factorial(j) * (2 * stages + 1 - j) * terms[-1 - j]
        for j in range(stages + 1)
    )
    return Noise(step, ROUNDING * total / state, left_out / state, conserves=True)


def _terms(body: Orbit, scene: Scene, step: float, order: int) -> list[Array]:
    """Return the Taylor terms (rad/s), each of shape (n, 3), of a step (s) from n states."""
    a = np.array(scene.euler_coefficients)
    terms = [body.states]
    for k in range(1, order + 1):
        value = np.zeros_like(body.states)
        for j in range(k):
            value += np.roll(terms[j], -1, 1) * np.roll(terms[k - 1 - j], -2, 1)
        terms.append(a * value * (step / k))
    return terms


def errors(
    scene: Scene, body: Orbit, time: float, omega: Array, rounded: bool = True
) -> dict[str, float]:
    """Return the signed errors of energy, momentum (both relative) and phase (rad).

    If `rounded`, the exact solution has rounded coefficients A, B, C.
    """
    start = [Decimal(w) for w in scene.omega]
    found = [Decimal(float(w)) for w in omega]
    moments = [Decimal(i) for i in scene.moments or ()]

    def change(power: int) -> float:
        before, after = (
            sum((i**power * w * w for i, w in zip(moments, each, strict=True)), Decimal(0))
            for each in (start, found)
        )
        return float((after - before) / before)

    truth = torque_free(scene, time, rounded=rounded)
    error = np.array([float(x - y) for x, y in zip(found, truth, strict=True)])
    x, y, z = (float(w) for w in truth)
    slope = np.array(scene.euler_coefficients) * np.array([y * z, z * x, x * y])
    late = float(error @ slope / (slope @ slope))  # lead of `omega` over `truth`, s
    return {"energy": change(1), "momentum": 0.5 * change(2), "phase": body.frequency * late}


def root_mean_square(found: Array) -> Array:
    return np.asarray(np.sqrt(np.nanmean(np.asarray(found) ** 2, axis=0)))


def exponent(steps: Sequence[float] | Array, found: Array) -> float:
    """Return the fitted p in error ~ steps**p; column j of `found` has the errors at steps[j]."""
    size = np.log(np.maximum(root_mean_square(found), 1e-300))
    return float(np.polyfit(np.log(np.asarray(steps)), size, 1)[0])


def _frequency(a: Array, omega: Array) -> float:
    """Return 2 pi divided by the period of torque-free omega (rad/s)."""
    (odd,) = (i for i in range(3) if a[i] * a[i - 1] < 0.0 and a[i] * a[i - 2] < 0.0)
    squares = [abs(a[i - 1] * a[i - 2]) * omega[i] * omega[i] for i in range(3)]
    small, large = sorted((squares[odd - 1], squares[odd - 2]))
    x, y = math.sqrt(large + squares[odd]), math.sqrt(large - small)
    while abs(x - y) > 1e-15 * x:
        x, y = 0.5 * (x + y), math.sqrt(x * y)
    return x


def _steepness(a: Array, omega: Array) -> float:
    """Return the sum of the magnitudes of the derivatives of `_frequency` with respect to omega."""
    size = 1e-6 * float(np.abs(omega).max())
    return sum(
        abs(_frequency(a, omega + shift) - _frequency(a, omega - shift)) / (2.0 * size)
        for shift in size * np.eye(3)
    )
