"""Amplification of perturbations by the programs, and step sizes at which runs diverge.

The amplification by a step, measured in runs, may differ from the matrix of `theory.amplification`
by rounding errors only. The step size of divergence is compared with linear stability theory.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from pyharness.checks.theory.amplification import (
    NEAREST,
    Amplification,
    amplification,
    boundary,
    weight_of_squares,
)
from pyharness.checks.theory.collocation_matrices import Exact, points, solver_roundings
from pyharness.checks.theory.conditioning import ROUNDING
from pyharness.checks.theory.schemes import Numbers, runge_kutta_punched, spacing
from pyharness.engine.methods.linearised import jacobians
from pyharness.engine.solve import solve
from pyharness.model.basis import Basis
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array, Trajectory
from pyharness.thesis import collocation
from pyharness.thesis.equations import omega_rate
from pyharness.thesis.programs import PROGRAM_REGISTRY

# Degree of a step's result as a polynomial of omega; each stage that depends on a previous one
# doubles the degree.
_DEGREE = {"two-term": 4, "four-term": 4, "runge-kutta": 16}
# Number of roundings along the longest chain of operations in a step, without linear systems: seven
# in each of four stages (a rate and a sum), twelve in the result.
_LONGEST = 40.0
# Largest distance, relative to omega, of the points from which a derivative is computed.
_REACH = 2.0**-2
_GROWTH_STEPS = 64
# Bounds on the sum of the rates' absolute weights. The sum is largest for collocation points far
# beyond the step, with the weights 2, -1 or 4, -6, 4, -1.
_WEIGHTS = {"two-term": 3.0, "four-term": 15.0}

ROUNDED = Basis(
    "derived",
    "difference of a measured amplification from the exact one",
    "rounding errors of a step, to first order, with all signs positive (`checks/disturbances.py`)",
)
"""Basis of the limit of a `Probe`."""


@dataclass(frozen=True)
class Probe:
    """A vector or matrix, as measured by running a program and as derived from theory."""

    found: Array  # measured
    derived: Array  # derived, of the same shape
    limit: float  # bound on the absolute difference of two elements

    @property
    def difference(self) -> float:
        return float(np.abs(self.found - self.derived).max())


def steady_scene(coefficients: Triple, omega: Triple, step: float) -> Scene:
    """Return a scene of one `step` (s) where a constant torque keeps `omega` (rad/s) constant."""
    a, b, c = coefficients
    x, y, z = omega
    # The balance is exact if all numbers have few binary digits.
    law = TorqueLaw((-a * y * z, -b * x * z, -c * x * y))
    return Scene("steady rotation", omega, None, coefficients, law, step_size=step, steps=1)


def jacobian(scene: Scene, omega: Sequence[float]) -> Exact:
    """Return the step size times the exact 3 x 3 Jacobian of Euler's equations at `omega`."""
    a, b, c = (Fraction(each) * Fraction(scene.step_size) for each in scene.euler_coefficients)
    x, y, z = map(Fraction, omega)
    return [[Fraction(0), a * z, a * y], [b * z, Fraction(0), b * x], [c * y, c * x, Fraction(0)]]


def eigenvalues(scene: Scene) -> Array:
    return np.asarray(np.linalg.eigvals(np.array(jacobian(scene, scene.omega), dtype=float)))


def first_step(scene: Scene, listing: Listing) -> Probe:
    """Return the 3 x 3 derivative of omega after one step with respect to the initial omega.

    The rotation must be steady.
    """

    def stepped(omega: Array) -> Array:
        run = _run(replace(scene, omega=omega.tolist(), steps=1), listing)
        return run[0] if len(run) else np.full(3, np.nan)

    found, limit = _differentiated(stepped, scene, listing.program)
    exact = amplification(listing).exact_matrix(jacobian(scene, scene.omega))
    matrix = np.array(exact, dtype=float)
    derived = sum(np.split(matrix[-3:], len(matrix) // 3, axis=1))
    return Probe(found, np.asarray(derived), limit)


def later_steps(scene: Scene, listing: Listing) -> Probe:
    """Return the perturbation (omega1, omega2) of a spin about axis 3 after all steps.

    Euler's coefficient C and the torque must be zero.
    """
    rows = _run(scene, listing)
    found = rows[-1, :2] if len(rows) == scene.steps else np.full(2, np.nan)
    small = [row[:2] for row in jacobian(scene, (0.0, 0.0, scene.omega[2]))[:2]]
    one = np.array(amplification(listing).exact_matrix(small), dtype=float)
    state = np.tile(np.array(scene.omega[:2]), len(one) // 2)
    power = np.eye(len(one))
    norms, sizes = [], []
    for _ in range(scene.steps):
        norms.append(float(np.abs(power).sum(axis=1).max()))
        sizes.append(float(np.abs(state).max()))
        state, power = one @ state, one @ power
    top = np.array([1.0, 1.0, abs(scene.omega[2])])
    moved = _moved(listing, scene.steps)
    unit = float(_units(scene, listing.program, top, moved)[:2].max())
    total = sum(n * s for n, s in zip(reversed(norms), sizes, strict=True))
    return Probe(found, state[-2:], ROUNDING * unit * total)


def complex_step(listing: Listing, step: int, z: complex) -> Probe:
    """Return the factor on x in collocation step number `step`, of 1 s, for x' = z x."""
    program = listing.program
    moved = _moved(listing, step)

    def rates(k: int, x: Sequence[float]) -> list[float]:
        return [z * each for each in x]  # type: ignore[misc]

    (found,), _ = collocation.interval([1.0], points(program, moved), 1.0, rates)
    derived = amplification(listing, step).evaluate(np.array(z))[-1, -1]
    _, varying = solver_roundings(program)
    weights = _WEIGHTS[program]
    rate = abs(z) * (1.0 + moved * abs(z))
    carried = varying * (rate + weights * moved * abs(z) ** 2)
    units = _LONGEST * (1.0 + weights * rate) + carried
    return Probe(np.array([found]), np.array([derived]), ROUNDING * units)


def observed_boundary(listing: Listing, direction: complex) -> Probe:
    """Return abs(z) where perturbations begin to grow, along `direction` (-1 or 1j).

    z is the step size times an eigenvalue of the Jacobian.
    """
    matrix = amplification(listing)
    expected, slope = boundary(matrix, direction)

    def grows(distance: float) -> bool:
        # Along -1 the perturbation is exactly the eigenvector that decays.
        second = distance if direction.real else -distance
        start = (1.0, -1.0 if direction.real else 0.0, 1.0)
        top = Scene("top", start, None, (distance, second, 0.0), step_size=1.0)
        scene = replace(top, steps=_GROWTH_STEPS)
        rows = np.vstack([scene.omega, _run(scene, listing)])[:, :2]
        if len(rows) <= _GROWTH_STEPS:
            return True
        if matrix.size > 1:
            # With the defect `base-not-restored`, a constant part might hide the growth.
            rows = np.diff(rows, axis=0)
        return bool(np.square(rows[-1]).sum() > np.square(rows[0]).sum())

    low, high = NEAREST, 8.0
    if grows(low):
        low = high = 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    top = Scene("top", (1.0, 1.0, 1.0), coefficients=(expected, expected, 0.0), step_size=1.0)
    unit = float(_units(top, listing.program, np.ones(3))[:2].max())
    return Probe(np.array([high]), np.array([expected]), 2.0 * ROUNDING * unit / slope)


def _moved(listing: Listing, step: int) -> float:
    """Return the factor by which the defect `dt-accumulates` moves the collocation points."""
    return float(step) if listing.has("dt-accumulates") else 1.0


def moving_step(scene: Scene, listing: Listing, step: int) -> Probe:
    """Return the 3 x 3 derivative of a collocation step's result with respect to omega."""
    program, h = listing.program, scene.step_size
    moved = _moved(listing, step)
    coefficients, torque = scene.euler_coefficients, scene.normalized_torque(0.0)

    def rates(k: int, x: Sequence[float]) -> list[float]:
        return omega_rate(coefficients, torque, x)

    def stepped(omega: Array) -> Array:
        end, _ = collocation.interval(omega.tolist(), points(program, moved * h), h, rates)
        return np.array(end)

    found, limit = _differentiated(stepped, scene, program, moved)
    # A step takes omega to omega + h F + h**2/2 J F + w h**3 Q(F), with the right-hand side F at
    # omega, its Jacobian J, and its quadratic part Q. Only the weight w depends on the collocation
    # points. Here are J at omega, and J with F in place of omega:
    slope = scene.right_hand_side()(0.0, scene.omega)
    j, along_rate = jacobians(scene, np.array([scene.omega, slope]))
    third = float(weight_of_squares(listing, step)) * h**3 * (along_rate @ j)
    derived = np.eye(3) + h * j + 0.5 * h * h * (j @ j + along_rate) + third
    return Probe(found, derived, limit)


def _differentiated(
    stepped: Callable[[Array], Array], scene: Scene, program: str, moved: float = 1.0
) -> tuple[Array, float]:
    """Return the derivative of a step at the initial omega, and a bound on its rounding error."""
    base, count = np.array(scene.omega), _DEGREE[program] // 2
    reach = _REACH * float(np.abs(base).max())
    spread = reach / count
    weights = [float(each) for each in spacing(count)]
    columns = []
    # A step is a polynomial of omega, so that these differences are exact except for rounding.
    for axis in np.eye(3):
        total = np.zeros(3)
        for i, weight in enumerate(weights, 1):
            away = i * spread * axis
            total += weight * (stepped(base + away) - stepped(base - away))
        columns.append(total / spread)
    amplified = 2.0 * sum(map(abs, weights)) / spread
    units = _units(scene, program, np.abs(base) + reach, moved)
    return np.array(columns).T, amplified * ROUNDING * float(units.max())


def _units(scene: Scene, program: str, sizes: Array, moved: float = 1.0) -> Array:
    """Return a bound on omega's rounding error in a step (2**-53 rad/s); `sizes` bound omega."""
    on = Numbers(scene, scene.step_size, sizes=True)
    if program == "runge-kutta":
        # The original program, where each stage starts from the previous one, has larger terms.
        return _LONGEST * runge_kutta_punched(on, sizes)
    first = on.times_step(on.rate(sizes))
    estimate = sizes + moved * first
    rate = on.times_step(on.rate(estimate))
    _, varying = solver_roundings(program)
    # The first linear system's solution has a similar error, which the rates propagate.
    wrong = varying * moved * first
    carried = 0.5 * on.times_step(on.rate(estimate + wrong) - on.rate(estimate - wrong))
    weights = _WEIGHTS[program]
    return np.asarray(_LONGEST * (sizes + weights * rate) + varying * rate + weights * carried)


def _run(scene: Scene, listing: Listing) -> Array:
    program = PROGRAM_REGISTRY[listing.program]
    return program.run(scene, listing, may_stop=False, velocity=False).omega


Runner = Callable[[Scene], Trajectory]

_SAMPLES = 20_000
DOUBLING = Basis(
    "derived",
    "smallest step size with which a run diverges",
    "linear stability, with the change of the spin until the wobble doubles "
    "(`checks/disturbances.py`)",
)
"""Basis of the limit from `divergence`."""


def divergence(
    scene: Scene, time: float, matrix: Amplification, runner: Runner, smallest: float
) -> tuple[float, float, float]:
    """Return the measured and predicted smallest step size (s) of divergence.

    A third number bounds their relative difference. Rotation about axis 3 must be stable.
    """
    found = smallest_divergent(scene, time, runner, smallest)
    a, b, c = scene.euler_coefficients
    spin = abs(scene.omega[2])
    rate = math.sqrt(-a * b) * spin
    predicted = _doubling(matrix, rate, time, smallest)
    bounds = _bounds(scene, time)
    # As omega3**2 - (C/A) omega1**2 and omega3**2 - (C/B) omega2**2 are constant, this is the
    # largest relative change of spin and rate until the wobble has doubled.
    change = 0.0
    if c:
        wobble = 2.0 * max(bounds[:2])
        change = abs(c) / min(abs(a), abs(b)) * wobble**2 / (2.0 * spin * spin)
    low = _doubling(matrix, rate * (1.0 + change), time, smallest)
    # The wobble may peak between two steps, at most half the phase of a step from either.
    missed = -math.log(math.cos(min(1.5, 0.5 * rate * predicted)))
    high = _doubling(matrix, rate * (1.0 - change), time, smallest, missed)
    limit = max(predicted - low, high - predicted) / predicted + 2.0 * predicted / time
    return found, predicted, limit


def smallest_divergent(scene: Scene, time: float, runner: Runner, smallest: float) -> float:
    """Return the smallest step size (s) with which a run diverges.

    Return 0 if steps of `smallest` (s) diverge, infinity if none does.
    """
    bounds = 2.0 * np.array(_bounds(scene, time))

    def leaves(steps: int) -> bool:
        run = runner(replace(scene, step_size=time / steps, steps=steps))
        return run.ended != "complete" or bool((np.abs(run.omega) > bounds).any())

    low, high = 1, math.floor(time / smallest)
    if leaves(high):
        return 0.0
    if not leaves(low):
        return math.inf
    while high > low + 1:
        middle = (low + high) // 2 if high < 2 * low else round(math.sqrt(low * high))
        low, high = (middle, high) if leaves(middle) else (low, middle)
    return time / low


def _doubling(
    matrix: Amplification, rate: float, time: float, smallest: float, missed: float = 0.0
) -> float:
    """Return the smallest step size (s) at which a wobble should grow 2 exp(`missed`) times."""
    # `rate` is the wobble's angular frequency (1/s); `missed` allows for a peak between two steps.
    wanted, low, high = math.log(2.0) + missed, smallest, time
    for _ in range(200):
        step = math.sqrt(low * high)
        grown = time / step * math.log(float(matrix.radius(np.array(1j * rate * step))))
        low, high = (low, step) if grown >= wanted else (step, high)
    return high


def _bounds(scene: Scene, time: float) -> Sequence[float]:
    times = np.linspace(0.0, time, _SAMPLES + 1)[1:].tolist()
    omega = np.vstack([scene.omega, solve(scene, times, "taylor", 1e-12).omega])
    return [float(x) for x in np.abs(omega).max(axis=0)]
