"""Runge-Kutta: the third program of the appendix, Jacobs 1982, eq. 31 and IV.3.

The stop test (Lipschitz condition, eq. 19) ends a run if the change of the right-hand sides in a
step exceeds a constant times the change of the unknowns.
"""

import math
from collections.abc import Mapping

from pyharness.model.functions import square_root
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import STOP_VARIABLES, Stop, Trajectory
from pyharness.thesis.equations import (
    Record,
    Vector,
    accelerations,
    all_finite,
    initial_torque,
    velocity_rate,
)


def run(
    scene: Scene, listing: Listing, lipschitz: float = 500.0, may_stop: bool = True
) -> Trajectory:
    """Run the program on a scene; `lipschitz` is the constant of its stop test (1/s)."""
    a, b, c = scene.euler_coefficients
    acceleration = accelerations(scene, listing)
    dt = scene.step_size
    time = 0.0
    base = [*scene.omega, 0.0, 0.0, 0.0]
    # The indices are the program's.
    zero = [0.0] * 6
    point = {1: base, 2: zero, 3: zero, 4: zero}
    slope = {1: zero, 2: zero, 3: zero, 4: zero}
    third = 4 if listing.has("do-variable") else 3
    record = Record(scene, evaluations_per_step=4)
    first = initial_torque(scene) if listing.has("initial-torque") else None

    for step in range(scene.steps):
        begin = step * dt
        time = time + dt
        if step == 0 and first is not None:
            torque: dict[int, Vector] = dict.fromkeys((1, 2, 3, 4), first)
        elif listing.has("torque-held"):
            torque = dict.fromkeys((1, 2, 3, 4), scene.normalized_torque(time))
        else:
            middle = scene.normalized_torque(begin + 0.5 * dt)
            torque = {
                1: scene.normalized_torque(begin),
                2: middle,
                3: middle,
                4: scene.normalized_torque(begin + dt),
            }
        first_point = point[1]

        def evaluate(stage: int, at: int, torque: Mapping[int, Vector] = torque) -> None:
            u, v = point[at][:3], point[at][3:]
            r1, r2, r3 = torque[stage]
            omega_rates = [r1 + a * u[1] * u[2], r2 + b * u[2] * u[0], r3 + c * u[0] * u[1]]
            slope[stage] = omega_rates + velocity_rate(acceleration, u, v)

        def store(stage: int, before: int, length: float, base: list[float] = base) -> None:
            start = point[before] if listing.has("stage-base") else base
            point[stage] = [x + length * k for x, k in zip(start, slope[stage], strict=True)]

        evaluate(1, at=1)
        store(1, before=1, length=0.5 * dt)
        evaluate(2, at=1)
        store(2, before=1, length=0.5 * dt)
        evaluate(third, at=2)
        store(third, before=2, length=dt)
        evaluate(4, at=3)
        result = [
            x + (dt / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
            for x, k1, k2, k3, k4 in zip(base, slope[1], slope[2], slope[3], slope[4], strict=True)
        ]
        if not all_finite(result[:3]):
            return record.trajectory("overflow", prints_ier=False)
        record.add(time, result[:3], result[3:])

        if listing.has("lipschitz-mismatched-pairs"):
            change_u = _distances(result, base)
        else:
            change_u = _distances(point[3], first_point)
        change_k = _distances(slope[4], slope[1])
        if may_stop:
            found = lipschitz_test(listing, change_k, change_u, lipschitz)
            if found is not None:
                stop = Stop(step + 1, *found)
                return record.trajectory("stopped", stop, prints_ier=False)

        point[4] = result
        base = result
        if not listing.has("base-not-restored"):
            point[1] = result
    return record.trajectory(prints_ier=False)


def lipschitz_test(
    listing: Listing, change_k: Vector, change_u: Vector, lipschitz: float
) -> tuple[str, float] | None:
    """Return a variable that violates eq. 19, and its quotient (1/s), or None.

    `change_k` has changes of right-hand sides, `change_u` of unknowns.
    """
    velocity_counts = listing.has("lipschitz-tests-velocity")
    last = 6 if velocity_counts else 3
    if listing.has("lipschitz-per-component"):
        found = [*zip(STOP_VARIABLES[:last], change_k, change_u, strict=False)]
        tests = found[3:] + found[:3]  # the velocity first
    else:
        tests = [("UV" if velocity_counts else "U", _norm(change_k[:last]), _norm(change_u[:last]))]
    for variable, change, by in tests:
        if change > by * lipschitz:
            return variable, change / by if by else math.inf
    return None


def _distances(x: Vector, y: Vector) -> list[float]:
    return [abs(p - q) for p, q in zip(x, y, strict=True)]


def _norm(x: Vector) -> float:
    total = 0.0
    for each in x:
        total = total + each * each
    norm: float = square_root(total)
    return norm
