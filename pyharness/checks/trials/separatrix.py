"""Trial of spin about the middle axis over several flips, with perturbations from .1 to 0 rad/s."""

from collections.abc import Iterator

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.hold import ALL, check_all, run_method
from pyharness.checks.scenes.extreme import MIDDLE_AXIS, in_steps
from pyharness.checks.stress import Trial, named
from pyharness.checks.tolerances import MIDDLING
from pyharness.engine.registry import FIXED_STEP
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene

_STAYS = 50.0  # s
_UNDISTURBED = Basis(
    "derived",
    "change of a rotation about the middle axis without a perturbation",
    "products with a component 0 are 0, and `quick` rounds once (`checks/trials/separatrix.py`)",
)


def _undisturbed() -> Iterator[Attempt]:
    """Yield checks that the unperturbed rotation is constant; `quick` may round once."""
    scene = in_steps(
        Scene("middle axis, undisturbed", (0.0, 1.0, 0.0), moments=MIDDLE_AXIS), _STAYS
    )

    def stay(name: Name) -> Check:
        method = name.subject
        run = run_method(method, scene, _STAYS, None if method in FIXED_STEP else MIDDLING)
        wrong = float(np.abs(run.omega - scene.omega).max())
        # A zero component must stay 0. `quick` changes units, and may round the spin.
        limit = 2.0**-52 if method == "quick" else 0.0
        stays = run.omega[0] == run.omega[2] == 0.0 and run.has_result
        note = "" if stays else "it left the axis"
        return name.judged(bool(stays and wrong <= limit), note, wrong, limit, _UNDISTURBED)

    for method in ALL:
        yield Attempt(named("separatrix", method, "none", scene=scene), stay)


def _attempts() -> Iterator[Attempt]:
    yield from check_all("separatrix", has_programs=lambda each: not each.name.startswith("early"))
    yield from _undisturbed()


TRIAL = Trial(
    "separatrix",
    "spin about the middle axis, with perturbations of 1e-1 to 1e-15 and 0, over up to five flips",
    "Closed form: 1e-14 plus the effect of rounding A, B, C. Other methods: the tolerance, or "
    "the local error times the number of steps, plus rounding errors, all amplified by the "
    "motion. If fewer than two digits are left, energy and momentum, whose errors the motion "
    "does not amplify. Without a perturbation: no error.",
    lambda only: _attempts(),
)
