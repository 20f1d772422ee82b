"""Trials of the motions near a separatrix, of nearly equal moments, and of extreme shapes."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.hold import ALL, FORMS, check_all, check_methods, run_method, truth_of
from pyharness.checks.judge import unknown_flow
from pyharness.checks.scenes.extreme import LONG, MIDDLE_AXIS, SYMMETRIC_START, in_steps
from pyharness.checks.stress import Trial, named
from pyharness.checks.tolerances import MIDDLING
from pyharness.engine.plan.registry import FIXED_STEP
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene

_STAYS = 50.0  # time (s) for which the rotation must be constant
# For the time LONG of closed forms, whose limits need no error amplification.
_UNKNOWN = unknown_flow(max(map(abs, SYMMETRIC_START)))
_UNDISTURBED = Basis(
    "derived",
    "change of a rotation about the middle axis without a perturbation",
    "products with a component 0 are 0, and `quick` rounds once (`checks/trials/separatrix.py`)",
)


def _undisturbed() -> Iterator[Attempt]:
    scene = Scene("middle axis, undisturbed", (0.0, 1.0, 0.0), moments=MIDDLE_AXIS)
    scene = in_steps(scene, _STAYS)

    def stay(name: Name) -> Check:
        method = name.subject
        run = run_method(method, scene, _STAYS, None if method in FIXED_STEP else MIDDLING)
        wrong = float(np.abs(run.omega - scene.omega).max())
        # Only `quick` may round the spin, because it changes units.
        limit = 2.0**-52 if method == "quick" else 0.0
        stays = run.omega[0] == run.omega[2] == 0.0 and run.has_result
        note = "" if stays else "it left the axis"
        return name.judged(bool(stays and wrong <= limit), note, wrong, limit, _UNDISTURBED)

    for method in ALL:
        yield Attempt(named("separatrix", method, "none", scene=scene), stay)


def _attempts() -> Iterator[Attempt]:
    yield from check_all("separatrix", has_programs=lambda each: not each.name.startswith("early"))
    yield from _undisturbed()


SEPARATRIX = Trial(
    "separatrix",
    "spin about the middle axis, with perturbations of 1e-1 to 1e-15 and 0, over up to five flips",
    "Closed form: 1e-14 plus the effect of rounding A, B, C. Other methods: the tolerance, or "
    "the local error times the number of steps, plus rounding errors, all amplified by the "
    "motion. If fewer than two digits are left, energy and momentum, whose errors the motion "
    "does not amplify. Without a perturbation: no error.",
    lambda only: _attempts(),
)


def _checks_at(name: Name, time: float) -> Iterator[Attempt]:
    if time == LONG:
        return check_methods(name, time, FORMS, partial(truth_of, flow=_UNKNOWN))
    return check_methods(name, time)


NEAR_SYMMETRY = Trial(
    "near-symmetry",
    "moments that differ by 1e-1 to 1e-16 of their size, two equal moments, and the sphere",
    "As in the trial separatrix. The difference of two nearly equal moments is exact, so that no "
    "digits are lost.",
    lambda only: check_all("near-symmetry", _checks_at, lambda each: each.time != LONG),
)


SHAPES = Trial(
    "shapes",
    "needles with ratios of moments up to 1e12, flat plates, and moments that no body can have",
    "As in the trial separatrix. A change of energy or momentum counts as the smallest error of "
    "omega that causes it.",
    lambda only: check_all("shapes"),
)
