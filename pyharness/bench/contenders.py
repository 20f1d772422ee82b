"""Contenders of `bench`: interface, our methods, and the programs of the thesis."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.util import find_spec

from pyharness.checks.compare.candidates import (
    Candidate,
    Ready,
    prepared_candidate,
    program_candidate,
)
from pyharness.checks.stress import LISTINGS
from pyharness.engine.plan.registry import FIXED_STEP, GAUSS, METHODS
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.thesis.programs import PROGRAM_REGISTRY

# Three per decade, to compare methods at nearly equal errors, which may be far from the tolerance.
TOLERANCES = tuple(float(f"{part}e-{digits}") for digits in range(1, 16) for part in (5, 2, 1))
Maker = Callable[[float, float], Ready]


@dataclass(frozen=True)
class Contender:
    name: str
    setting: str  # "tolerance", "steps" or "none"
    package: str = field(default="", kw_only=True)  # third-party package, or empty

    @property
    def is_installed(self) -> bool:
        return not self.package or find_spec(self.package) is not None


@dataclass(frozen=True)
class SceneContender(Contender):
    """A contender that integrates omega and, if it can, the attitude of one scene."""

    # Prepares all that does not depend on the end time and the setting.
    prepare: Callable[[Scene], Maker]
    settings: tuple[float, ...] = ()  # empty for fixed steps, whose number `ladder` chooses
    order: int = 0  # order of convergence of a method with a fixed step
    attitude: bool = False


def list_own_contenders() -> list[SceneContender]:
    both = partial(SceneContender, attitude=True)
    found = [
        both("auto", "tolerance", partial(prepared_maker, "auto"), TOLERANCES),
        both("taylor", "tolerance", partial(prepared_maker, "taylor"), TOLERANCES),
        both("closed-form", "none", partial(prepared_maker, "closed-form"), (0.0,)),
    ]
    names = (*FIXED_STEP, *GAUSS)
    in_steps = [(prepared_candidate(name, 1.0), METHODS[name].order) for name in names]
    for listing in LISTINGS:
        candidate = program_candidate(listing, velocity=False)
        in_steps.append((candidate, PROGRAM_REGISTRY[listing.program].order))
    for each, order in in_steps:
        found.append(SceneContender(each.name, "steps", partial(_in_steps, each), order=order))
    return found


def refuse_rounding(solver: str, setting: float) -> None:
    """Raise InputError for a tolerance below 100 eps, which SciPy changes and LSODA refuses."""
    limit = 100 * 2.0**-52
    if setting < limit:
        raise InputError(f"{solver} takes no tolerance below 100 eps = {limit:.2g}")


def prepared_maker(name: str, scene: Scene, compiled: bool = False) -> Maker:
    def make(horizon: float, setting: float) -> Ready:
        attitude = scene.attitude is not None
        # A closed form has no setting.
        candidate = prepared_candidate(name, setting or None, False, attitude, compiled)
        return candidate.ready(scene, horizon)

    return make


def _in_steps(candidate: Candidate, scene: Scene) -> Maker:
    def make(horizon: float, setting: float) -> Ready:
        steps = int(setting)
        return candidate.ready(replace(scene, step_size=horizon / steps, steps=steps), horizon)

    return make
