"""Needles, coins, flat plates, and moments that no body has."""

import math
from collections.abc import Iterator

from pyharness.checks.hold import hold_all, in_steps
from pyharness.checks.stress import Trial
from pyharness.model.scene import Scene, Triple
from pyharness.model.scene_file import case_scene

_OMEGA = (0.3, 1.0, -0.6)
_RADIANS = 20.0
# Every moment about every axis, and both senses of the order.
_ORDERS = ((0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2))
_BODIES: dict[str, Triple] = {
    # In the ratio 1 : 1 : 1e-12 and 1 : 1e12 : 1e12, and as far from symmetry as a body may be.
    "needle": (1.0, 1.0, 1e-12),
    "uneven-needle": (1.0, 1.0 - 2.0**-41, 1e-12),
    "coin": (1.0, 1e12, 1e12),
    "uneven-coin": (1.0, 1e12, 1e12 - 0.5),
    # I1 = I2 + I3, exactly.
    "plate": (5.0, 3.0, 2.0),
    "round-plate": (2.0, 1.0, 1.0),
    "strip": (1.0 + 2.0**-40, 1.0, 2.0**-40),
    "broad-strip": (1e12 + 1.0, 1e12, 1.0),
    # One moment exceeds the sum of the others.
    "impossible": (200.0, 10.0, 20.0),
    "impossible-equal": (1.0, 1.0, 1e3),
    "impossible-three": (1e3, 1.0, 1e-3),
}


def circumstances() -> Iterator[tuple[str, Scene, float]]:
    """Return name, scene and time of each input."""
    for name, moments in _BODIES.items():
        for axes in _ORDERS:
            first, second, third = (moments[axis] for axis in axes)
            order = "".join(str(axis + 1) for axis in axes)
            scene = Scene(f"{name} {order}", _OMEGA, moments=(first, second, third))
            time = _RADIANS / _rate(scene)
            yield f"{name}-{order}", in_steps(scene, time), time
    # With its torques, which no closed form takes.
    yield "case-6", case_scene(6), 1.0


def _rate(scene: Scene) -> float:
    """Return the fastest of the small motions about the three axes (rad/s)."""
    a, b, c = map(math.sqrt, map(abs, scene.euler_coefficients))
    return max(w * abs(own) for w, own in zip((b * c, c * a, a * b), scene.omega, strict=True))


TRIAL = Trial(
    "shapes",
    "moments in the ratio 1 : 1 : 1e-12 and 1 : 1e12 : 1e12, flat plates, impossible bodies",
    "as of the separatrix; energy and momentum weigh omega by moments, and are read as the "
    "error of omega that would change them so.",
    lambda only: hold_all("shapes", circumstances()),
)
