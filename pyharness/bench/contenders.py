"""Who takes part in `bench`: the interface of a contender, our methods and the programs."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pyharness.methods.registry import FIXED_STEP, GAUSS, METHODS
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing, corrected, original
from pyharness.model.scene import Scene
from pyharness.model.trajectory import STOP_VARIABLES
from pyharness.original.programs import PROGRAM_REGISTRY

# Finer than decades: a method whose error stays well below its tolerance must not be judged by it.
TOLERANCES = tuple(float(f"{part}e-{digits}") for digits in range(1, 16) for part in (5, 2, 1))


class RefusedError(Exception):
    """A contender does not take a scene or a setting; the text says why."""


@dataclass(frozen=True)
class Outcome:
    """What a call came to: omega at the end, right-hand sides if counted, why it failed."""

    omega: Sequence[float] | None
    evaluations: int | None = None
    note: str = ""


@dataclass(frozen=True)
class Ready:
    """A call that goes from omega(0) to omega(T) and does nothing else; and how to read it."""

    run: Callable[[], Any]
    read: Callable[[Any], Outcome]


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
    """Return our methods and the three programs, as punched and as mended."""
    methods = [
        Contender(name, "method", "tolerance", partial(_method, name), TOLERANCES)
        for name in ("auto", "taylor")
    ]
    methods.append(Contender("closed-form", "method", "none", _closed_form, (0.0,)))
    methods += [
        Contender(name, "method", "steps", partial(_fixed_step, name), order=METHODS[name].order)
        for name in (*FIXED_STEP, *GAUSS)
    ]
    programs = [
        Contender(
            f"{name}-{listing.label}",
            "program",
            "steps",
            partial(_program, listing),
            order=PROGRAM_REGISTRY[name].order,
        )
        for name in PROGRAMS
        for listing in (original(name), corrected(name))
    ]
    return methods + programs


def plain(values: Iterable[float]) -> tuple[float, ...]:
    """Return plain floats: a buffer is used again by the next call."""
    return tuple(map(float, values))


def not_finite(note: str = "overflow") -> Outcome:
    """Return the outcome of a call that got nowhere."""
    return Outcome(None, None, note)


def refuse_rounding(solver: str, setting: float) -> None:
    """Refuse what SciPy would replace by 100 eps with a warning, and LSODA calls illegal."""
    limit = 100 * 2.0**-52
    if setting < limit:
        raise RefusedError(f"{solver} takes no tolerance below 100 eps = {limit:.2g}")


def _method(name: str, scene: Scene) -> Maker:
    def make(horizon: float, setting: float) -> Ready:
        return _solver(name, scene, horizon, setting)

    return make


def _closed_form(scene: Scene) -> Maker:
    def make(horizon: float, setting: float) -> Ready:
        return _solver("closed-form", scene, horizon, 1e-12)

    return make


def _fixed_step(name: str, scene: Scene) -> Maker:
    def make(horizon: float, setting: float) -> Ready:
        return _solver(name, replace(scene, step_size=horizon / setting), horizon, 1.0)

    return make


def _solver(name: str, scene: Scene, horizon: float, tolerance: float) -> Ready:
    from pyharness.methods.prepared import prepare

    try:
        solver = prepare(scene, name, tolerance)
    except InputError as error:
        raise RefusedError(str(error)) from None

    def read(omega: Any) -> Outcome:
        if solver.status != "complete":
            return not_finite(solver.status)
        return Outcome(plain(omega), _evaluations(solver.plan.method, solver.steps))

    return Ready(partial(solver, np.array(scene.omega), horizon), read)


def _evaluations(method: str, steps: int) -> int | None:
    """Return right-hand sides; a Taylor series evaluates none, it expands one."""
    if method == "taylor":
        return None
    if method.startswith("gauss-"):
        return steps
    return steps * METHODS[method].evaluations if method in FIXED_STEP else 0


def _program(listing: Listing, scene: Scene) -> Maker:
    from pyharness.model.extension import extension
    from pyharness.original.compiled import program_arguments

    def make(horizon: float, setting: float) -> Ready:
        steps = int(setting)
        try:
            stepped = replace(scene, step_size=horizon / steps, steps=steps)
        except InputError as error:
            raise RefusedError(str(error)) from None
        arguments = program_arguments(stepped, listing, velocity=False)
        return Ready(partial(extension().run_program, *arguments), read)

    def read(result: Any) -> Outcome:
        rows, _, n_rows, status, evaluations, variable, _ = result
        if status == 1:
            return not_finite(f"stopped at step {n_rows} by {STOP_VARIABLES[variable - 1]}")
        if status != 0:
            return not_finite()
        return Outcome(plain(rows[2:5, n_rows - 1]), evaluations)

    return make
