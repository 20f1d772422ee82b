"""Random scenes, listings and parameters, reproducible from a seed and a number."""

import datetime
from dataclasses import dataclass, replace
from random import Random

import numpy as np

from pyharness.checks.scenes.kinds import KINDS, NASTY
from pyharness.model.listing import PROGRAMS, Listing, names_of, switches
from pyharness.model.scene import Scene

COARSEST = 1e-3
# Defects added later are drawn last, so that the draws of a seed do not change.
_LATER = ("three-masses",)
_LIPSCHITZ = (500.0, 60.0, 1.0, 1e-3)


@dataclass(frozen=True)
class Draw:
    """The random inputs of one check: a scene, a program, and parameters of the runs."""

    scene: Scene  # in odd draws a difficult scene, named by its kind in `NASTY`
    listing: Listing  # of any program, with random defects and readings
    lipschitz: float  # constant of the stop test (1/s)
    may_stop: bool
    digits: float  # 0 for the coarsest tolerance, 1 for the finest tolerance of a method
    backward: bool  # whether a method integrates to negative times
    stages: int  # of Gauss collocation

    @property
    def time(self) -> float:
        """Return the end time (s) of a method's run; negative if backward."""
        return self.scene.step_size * self.scene.steps * (-1.0 if self.backward else 1.0)

    def tolerance(self, finest: float) -> float:
        """Return the relative tolerance, by `digits` between 1e-3 and a method's `finest`."""
        return float(max(finest, COARSEST * (finest / COARSEST) ** self.digits))


def weekly_seed(day: datetime.date | None = None) -> str:
    """Return the week of `day`, by default today, as a seed such as 2026-W47."""
    year, week, _ = (day or datetime.date.today()).isocalendar()
    return f"{year}-W{week:02d}"


def draw(seed: str, number: int) -> Draw:
    """Return the random inputs of check `number`, the same in all versions of Python."""
    # A generator for each draw, so that it can be repeated alone.
    source = Random(f"{seed}/{number}")
    scene = KINDS["plain"](source)
    if number % 2 == 1:
        name = source.choice(list(NASTY))
        scene = replace(NASTY[name](source), name=name)
    program = source.choice(PROGRAMS)
    early = [name for name in switches(program) if name not in _LATER]
    defects, readings = (
        frozenset(name for name in names if source.random() < share)
        for names, share in ((early, 0.5), (names_of("reading", program), 0.3))
    )
    found = Draw(
        scene=scene,
        listing=Listing(program, defects, readings),
        lipschitz=source.choice(_LIPSCHITZ),
        may_stop=source.random() < 0.5,
        digits=source.random(),
        backward=source.random() < 0.5,
        stages=source.randint(1, 8),
    )
    later = [name for name in _LATER if name in switches(program) and source.random() < 0.5]
    return replace(found, listing=Listing(program, defects.union(later), readings))


def text_generator(seed: str) -> np.random.Generator:
    """Return NumPy's random generator with a text as seed."""
    return np.random.default_rng([ord(letter) for letter in seed])


def random_scene(kind: str, seed: str | int, name: str = "") -> Scene:
    """Return the scene of a kind, a key of `scenes.kinds.KINDS`, for a seed."""
    return replace(KINDS[kind](Random(seed)), name=name)
