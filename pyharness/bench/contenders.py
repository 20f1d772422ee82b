"""Who takes part in `bench`: the interface of a contender, our methods and the programs."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.util import find_spec

from pyharness.compare.candidates import (
    Candidate,
    Ready,
    attitude_candidate,
    prepared_candidate,
    program_candidate,
)
from pyharness.methods.registry import FIXED_STEP, GAUSS, METHODS
from pyharness.model.errors import InputError
from pyharness.model.listing import corrected, original
from pyharness.model.scene import Scene
from pyharness.original.programs import PROGRAM_REGISTRY

# Finer than decades: a method whose error stays well below its tolerance must not be judged by it.
TOLERANCES = tuple(float(f"{part}e-{digits}") for digits in range(1, 16) for part in (5, 2, 1))
# From the horizon (s) and the setting to a call.
Maker = Callable[[float, float], Ready]


@dataclass(frozen=True)
class Contender:
    """A solver in a benchmark, ours or a peer, with a setting that trades time for accuracy."""

    name: str
    setting: str  # what is varied: tolerance, steps, none
    package: str = field(default="", kw_only=True)  # that it needs; empty for our own

    @property
    def is_installed(self) -> bool:
        """Whether its package is there."""
        return not self.package or find_spec(self.package) is not None


@dataclass(frozen=True)
class SceneContender(Contender):
    """A contender that finds omega(T) of one scene, and its attitude."""

    # From the scene to a `Maker`; all that can be done beforehand, compiling included.
    prepare: Callable[[Scene], Maker]
    settings: tuple[float, ...] = ()  # of a fixed step none: the numbers follow from the scene
    order: int = 0  # of a method of a fixed step
    attitude: bool = False  # whether it carries that of a scene that has one
    velocity: bool = True  # whether it takes a scene that has none


def own() -> list[SceneContender]:
    """Return our methods and the three programs, original and corrected."""
    both = partial(SceneContender, attitude=True)
    found = [
        both("auto", "tolerance", partial(_prepared, "auto"), TOLERANCES),
        both("taylor", "tolerance", partial(_prepared, "taylor"), TOLERANCES),
        both("closed-form", "none", partial(_prepared, "closed-form"), (0.0,)),
    ]
    in_steps = {
        name: (prepared_candidate(name, 1.0), METHODS[name].order) for name in (*FIXED_STEP, *GAUSS)
    }
    for name, program in PROGRAM_REGISTRY.items():
        for listing in (original(name), corrected(name)):
            candidate = program_candidate(listing, velocity=False)
            in_steps[candidate.name] = candidate, program.order
    return found + [
        SceneContender(name, "steps", partial(_in_steps, candidate), order=order)
        for name, (candidate, order) in in_steps.items()
    ]


def refuse_rounding(solver: str, setting: float) -> None:
    """Refuse what SciPy would replace by 100 eps with a warning, and LSODA calls illegal."""
    limit = 100 * 2.0**-52
    if setting < limit:
        raise InputError(f"{solver} takes no tolerance below 100 eps = {limit:.2g}")


def _prepared(name: str, scene: Scene) -> Maker:
    candidate = prepared_candidate if scene.attitude is None else attitude_candidate
    # A closed form has no setting.
    return lambda horizon, setting: candidate(name, setting or None).ready(scene, horizon)


def _in_steps(candidate: Candidate, scene: Scene) -> Maker:
    def make(horizon: float, setting: float) -> Ready:
        steps = int(setting)
        return candidate.ready(replace(scene, step_size=horizon / steps, steps=steps), horizon)

    return make
