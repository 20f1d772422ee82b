"""Bodies that are all but symmetric, symmetric, all but spheres, and spheres."""

import math
from collections.abc import Iterator
from functools import partial

from pyharness.checks.check import Attempt
from pyharness.checks.hold import hold, hold_all, in_steps, truth_of
from pyharness.checks.stress import Trial, named
from pyharness.model.scene import Scene, Triple
from pyharness.theory.conditioning import Conditioning

# 1 - 1e-16 is the number next to 1; below 1 they lie twice as close as above.
_DIFFERENCES = (*(10.0**-k for k in range(1, 17)), 0.0)
_OMEGA = (0.3, 0.9, -0.7)
_SHORT = 20.0  # s
_LONG = 1e6
_CLOSED = ("closed-form", "auto")


def _bodies(difference: float) -> Iterator[tuple[str, Triple, float]]:
    near = 1.0 - difference
    yield "small-pair", (1.5, 1.0, near), _SHORT
    yield "large-pair", (1.0, near, 0.6), _SHORT
    yield "large-pair-long", (1.0, near, 0.6), _LONG
    # It turns the slower, the nearer it is to a sphere: the same angle in all.
    yield "sphere", (1.0, near, 1.0 - 2.0 * difference), _SHORT / (difference or 1.0)


def circumstances() -> Iterator[tuple[str, Scene, float]]:
    """Return name, scene and time of each input."""
    for difference in _DIFFERENCES:
        size = f"{difference:.0e}" if difference else "equal"
        for name, moments, time in _bodies(difference):
            scene = Scene(f"near symmetry, {name}, {size}", _OMEGA, moments=moments)
            yield f"{name}-{size}", in_steps(scene, time), time


def _attempts() -> Iterator[Attempt]:
    # The closed form alone asks for no bound on what the flow makes of errors on the way.
    unknown = Conditioning(math.inf, 2.0, 2.0, 2.0, max(map(abs, _OMEGA)))
    for name, scene, time in circumstances():
        if time == _LONG:
            own = named("near-symmetry", "", name, scene=scene)
            yield from hold(own, time, _CLOSED, partial(truth_of, flow=unknown))
        else:
            yield from hold_all("near-symmetry", [(name, scene, time)])


TRIAL = Trial(
    "near-symmetry",
    "two moments, or all, that differ by 1e-1 to 1e-16 of their size, and equal ones",
    "as of the separatrix. The difference of two moments is exact, and so is no loss of digits.",
    lambda only: _attempts(),
)
