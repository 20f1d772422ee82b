"""Who takes part in `bench`: the interface of a contender, our methods and the programs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from pyharness.compare.candidates import Candidate, Ready, called, listed
from pyharness.methods.registry import FIXED_STEP, GAUSS, METHODS
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing, corrected, original
from pyharness.model.scene import Scene
from pyharness.original.programs import PROGRAM_REGISTRY

# Finer than decades: a method whose error stays well below its tolerance must not be judged by it.
TOLERANCES = tuple(float(f"{part}e-{digits}") for digits in range(1, 16) for part in (5, 2, 1))


class RefusedError(Exception):
    """A contender does not take a scene or a setting; the text says why."""


# From the horizon (s) and the setting to a call.
Maker = Callable[[float, float], Ready]


@dataclass(frozen=True)
class Contender:
    """A way to omega(T), with a setting that trades time for accuracy.

    Attributes
    ----------
    name : str
        What tables call it.
    family : {"method", "program", "peer"}
        Ours, a program of the appendix, or somebody else's.
    setting : {"tolerance", "steps", "none"}
        What is varied.
    prepare : callable
        From the scene to a `Maker`; all that can be done beforehand, compiling included.
    settings : tuple of float
        The tolerances; of a fixed step none, the numbers of steps follow from the scene.
    order : int
        Of a method of a fixed step; 0 for others.
    package : str
        The package that it needs; empty for our own.
    """

    name: str
    family: str
    setting: str
    prepare: Callable[[Scene], Maker]
    settings: tuple[float, ...] = ()
    order: int = 0
    package: str = ""


def own() -> list[Contender]:
    """Return our methods and the three programs, original and corrected."""
    methods = [
        Contender(name, "method", "tolerance", _made(partial(called, name)), TOLERANCES)
        for name in ("auto", "taylor")
    ]
    closed = _made(lambda _: called("closed-form", 1e-12))
    methods.append(Contender("closed-form", "method", "none", closed, (0.0,)))
    methods += [
        Contender(
            name,
            "method",
            "steps",
            _made(_in_steps(name), in_steps=True),
            order=METHODS[name].order,
        )
        for name in (*FIXED_STEP, *GAUSS)
    ]
    programs = [
        Contender(
            f"{name}-{listing.label}",
            "program",
            "steps",
            _made(_listed(listing), in_steps=True),
            order=PROGRAM_REGISTRY[name].order,
        )
        for name in PROGRAMS
        for listing in (original(name), corrected(name))
    ]
    return methods + programs


def refuse_rounding(solver: str, setting: float) -> None:
    """Refuse what SciPy would replace by 100 eps with a warning, and LSODA calls illegal."""
    limit = 100 * 2.0**-52
    if setting < limit:
        raise RefusedError(f"{solver} takes no tolerance below 100 eps = {limit:.2g}")


def _made(
    candidate: Callable[[float], Candidate], in_steps: bool = False
) -> Callable[[Scene], Maker]:
    """Return what makes calls of a candidate, given its setting: a tolerance, or steps."""

    def prepare(scene: Scene) -> Maker:
        def make(horizon: float, setting: float) -> Ready:
            try:
                given = scene
                if in_steps:
                    steps = int(setting)
                    given = replace(scene, step_size=horizon / steps, steps=steps)
                return candidate(setting).ready(given, horizon)
            except InputError as error:
                raise RefusedError(str(error)) from None

        return make

    return prepare


def _in_steps(name: str) -> Callable[[float], Candidate]:
    return lambda _: called(name, 1.0)


def _listed(listing: Listing) -> Callable[[float], Candidate]:
    return lambda _: listed(listing, velocity=False)
