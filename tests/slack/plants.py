"""Plants of a chosen size in what `verify` and `stress` measure; `tests.slack.table` has them."""

import itertools
import math
import pkgutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from pyharness.methods.solve import solve
from pyharness.model.errors import InputError
from pyharness.model.extension import extension
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.original.linear_solver import SINGULAR
from pyharness.stress.trials import length
from pyharness.theory import brouwer
from pyharness.truth.reference import reference

# Half a unit in the last place of 1, and a whole one.
U = 2.0**-53
ULP = 2.0 * U

Plant = Callable[[float], AbstractContextManager[Any]]


@dataclass(frozen=True)
class Slack:
    """A limit between two plants.

    Attributes
    ----------
    check : str
        The check that is asked for.
    planted : callable
        From a size to the context in which what is measured is wrong by so much.
    beyond, within : float
        Sizes with which the check fails, and passes.
    failing : str
        The check that fails, where it is another.
    """

    check: str
    planted: Plant
    beyond: float
    within: float
    failing: str = ""


def near(check: str, planted: Plant, due: float) -> Slack:
    """Return a limit that is `due`, of an error that adds to what there is."""
    return Slack(check, planted, 1.5 * due, 0.75 * due)


def exact(check: str, planted: Plant, least: float = 1.0, failing: str = "") -> Slack:
    """Return a limit of nothing at all: the least there can be fails."""
    return Slack(check, planted, least, 0.0, failing)


# What is planted: `change(found, size)`.


def off(found: Any, size: float) -> Any:
    """Let every omega be larger by a part of the largest."""
    if not isinstance(found, np.ndarray):
        return replace(found, omega=off(found.omega, size))
    return found + size * np.abs(found).max(initial=0.0) * np.sign(found)


def last_off(found: Trajectory, size: float) -> Trajectory:
    """As `off`, in the last row alone."""
    return replace(found, omega=np.vstack([found.omega[:-1], off(found.omega[-1:], size)]))


def bit_off(found: Any, size: float, name: str = "omega") -> Any:
    """Let the largest element of an array be larger by a part of itself, and nothing else."""
    if not isinstance(found, np.ndarray):
        return replace(found, **{name: bit_off(getattr(found, name), size)})
    changed = found.copy()
    changed[np.unravel_index(np.abs(found).argmax(), found.shape)] *= 1.0 + size
    return changed


def counted_off(name: str) -> Callable[[Any, float], Any]:
    return lambda found, size: replace(found, **{name: getattr(found, name) + int(size)})


def value_off(found: Any, size: float) -> Any:
    """Let a number, or each of an array, be larger by a part of itself."""
    return found * (1.0 + size)


def quotient_off(found: Trajectory, size: float) -> Trajectory:
    if found.stop is None:
        return found
    quotient = found.stop.quotient * (1.0 + size)
    return replace(found, stop=replace(found.stop, quotient=quotient))


def cut(found: Trajectory, size: float) -> Trajectory:
    """Leave out so many of the last rows."""
    return replace(found, omega=found.omega[: len(found.omega) - int(size)])


def singular(found: Trajectory, size: float) -> Trajectory:
    """Let the matrices of so many of the last steps be singular that were not."""
    if found.ier is None or not size:
        return found
    ier = found.ier.copy()
    ier[-int(size) :] = SINGULAR
    return replace(found, ier=ier)


def ended(found: Any, size: float) -> Any:
    return replace(found, ended="overflow") if size else found


def gives_up(found: Any, size: float) -> Any:
    return replace(found, ended="gave up") if size else found


def probe_off(found: Any, size: float) -> Any:
    return replace(found, found=found.found + size)


# Where it is planted.


def on(target: str, change: Callable[..., Any], call: int | None = None) -> Plant:
    """Return the change of what `target`, a dotted name, returns: of every call, or of one."""

    def planted(size: float) -> AbstractContextManager[Any]:
        right = pkgutil.resolve_name(target)
        calls = itertools.count(1)

        def faulty(*rest: Any, **named: Any) -> Any:
            found = right(*rest, **named)
            return found if call and next(calls) != call else change(found, size)

        return patch(target, faulty)

    return planted


def refuses(target: str) -> Plant:
    """Return a refusal of everything, where the size is not 0."""

    def planted(size: float) -> AbstractContextManager[Any]:
        right = pkgutil.resolve_name(target)

        def faulty(*rest: Any, **named: Any) -> Any:
            if size:
                raise InputError("no")
            return right(*rest, **named)

        return patch(target, faulty)

    return planted


def instead(target: str, stand_in: Callable[..., Any]) -> Plant:
    """Return a function in the place of another; the size comes before its arguments."""
    return lambda size: patch(target, partial(stand_in, size))


@cache
def _truth(case: int, quantity: str) -> Array:
    scene = case_scene(case)
    found = getattr(reference(scene, scene.times(), velocity=True), quantity)
    return np.asarray(found)


def graded(target: str, error: Callable[[Scene, float], float]) -> Plant:
    """Return results that are the truth of Case 5 and an error of so much of the largest."""

    def planted(size: float) -> AbstractContextManager[Any]:
        right = pkgutil.resolve_name(target)

        def faulty(*rest: Any, **named: Any) -> Trajectory:
            scene = next(each for each in rest if isinstance(each, Scene))

            def rows(quantity: str) -> Array:
                truth = _truth(5, quantity)
                parts = scene.steps // len(truth)
                found = np.zeros((scene.steps, 3))
                found[parts - 1 :: parts] = truth + error(scene, size) * np.abs(truth).max()
                return found

            found: Trajectory = right(
                *(case_scene(5) if each is scene else each for each in rest), **named
            )
            velocity = None if found.velocity is None else rows("velocity")
            omega = rows("omega")
            return replace(found, ier=None, steps=scene.steps, omega=omega, velocity=velocity)

        return patch(target, faulty)

    return planted


def solved(size: float, scene: Scene, times: Sequence[float], *_: Any) -> Trajectory:
    """Return what is off by the size and no more, in the place of any method."""
    found: Trajectory = off(solve(scene, times, "taylor", 1e-15), size)
    return found


def of_order(due: int) -> Callable[[Scene, float], float]:
    """Return an error whose order misses by the size."""
    return lambda scene, size: 1e-3 * (scene.step_size / case_scene(5).step_size) ** (due - size)


def roundings(more: float) -> Callable[[Scene, float], float]:
    """Return the size times 8 roundings of every step, and `more`."""
    return lambda scene, size: size * (8.0 * U * scene.steps + more)


def stop_test(size: float) -> AbstractContextManager[Any]:
    """Let the program be given another constant."""
    target = "pyharness.original.programs.Program.run"
    right = pkgutil.resolve_name(target)

    def faulty(*rest: Any, **named: Any) -> Any:
        if "lipschitz" in named:
            named["lipschitz"] *= 1.0 + size
        return right(*rest, **named)

    return patch(target, faulty)


def kept(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that computes a thing once."""
    known: dict[str, Any] = {}

    def found(*rest: Any, **named: Any) -> Any:
        key = repr((rest, named))
        if key not in known:
            known[key] = function(*rest, **named)
        return known[key]

    return found


@cache
def _contenders() -> dict[str, length.Marcher]:
    return {
        name: replace(each, run=kept(each.run), noise=kept(each.noise), revolutions=1e3, others=1e3)
        for name, each in length.MARCHERS.items()
    }


@contextmanager
def shorter() -> Iterator[None]:
    """Follow two starts through a thousand revolutions."""
    contenders = _contenders()
    with patch.object(length, "MARCHERS", contenders), patch.object(length, "STARTS", 2):
        yield


def watched(error: Callable[[float, float], float]) -> Plant:
    """Let the error of energy, momentum and phase be `error(size, time)`."""

    @contextmanager
    def planted(size: float) -> Iterator[None]:
        def faulty(scene: Scene, body: Any, time: float, omega: Array) -> dict[str, float]:
            return dict.fromkeys(brouwer.LAWS, error(size, time))

        with shorter(), patch.object(brouwer, "errors", faulty):
            yield

    return planted


def beside(around: Callable[[], AbstractContextManager[Any]], planted: Plant) -> Plant:
    """Return a plant in other circumstances."""

    @contextmanager
    def both(size: float) -> Iterator[None]:
        with around(), planted(size):
            yield

    return both


def form_for_all(
    size: float, scene: Scene, times: Sequence[float], name: str, *rest: float
) -> Trajectory:
    """Solve by a closed form, or what stands for it where there is none."""
    return solved(0.0, scene, times) if size else solve(scene, times, name, *rest)


def other_library() -> AbstractContextManager[Any]:
    return patch("pyharness.verify.golden.mathematics", lambda: "another")


def without(found: Iterator[Any] | dict[str, Any], size: float) -> Any:
    """Leave out the Taylor series' Case 5 of what is recorded, or should be."""
    if not size:
        return found
    if not isinstance(found, dict):
        return [each for each in found if (each.source, each.name) != ("taylor", "case-5")]
    rest = [each for each in found["taylor"]["trajectory"] if "--case 5 " not in each["command"]]
    return {**found, "taylor": {**found["taylor"], "trajectory": rest}}


def linear(change: Callable[[Any, float], Any]) -> Plant:
    """Change what the compiled solver of linear equations returns."""

    def planted(size: float) -> AbstractContextManager[Any]:
        right = extension().solve_linear

        def faulty(a: Array, b: Array) -> tuple[Array, Array, int]:
            factors, x, ier = right(a, b)
            return factors, change(x, size), ier

        return patch(
            "pyharness.model.extension.extension", lambda: SimpleNamespace(solve_linear=faulty)
        )

    return planted


def crossing_off(size: float) -> AbstractContextManager[Any]:
    """Let truncation rule down to a step of 10**-3.75 s times 10**-size, and nothing below."""
    from pyharness.stress.trials import step_size

    def error(scene: Scene, name: str, case: int, listing: Any) -> tuple[float, str]:
        rules = math.log10(scene.step_size) > -3.75 - size
        return (step_size._forecaster(case, name).at(scene.steps).truncation if rules else 1.0), ""

    return patch.object(step_size, "_error", error)


def some_bits(size: float) -> AbstractContextManager[Any]:
    """Let so many of the calls in threads give other bits."""
    calls = itertools.count()
    # Seven jobs are made alone before they are made at once.
    return patch(
        "pyharness.stress.trials.threads.bits", lambda job: bytes(7 <= next(calls) < 7 + size)
    )
