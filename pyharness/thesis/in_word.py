"""Runs of a twin in an arithmetic of `word.py`, such as the 48 bits of the CDC."""

import copy
import importlib
from dataclasses import replace
from typing import Any, TypeVar

from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.word import WORDS as WORDS
from pyharness.thesis.word import Word

Of = TypeVar("Of", Scene, TorqueLaw)


def run(
    scene: Scene, listing: Listing, word: Word, lipschitz: float = 500.0, may_stop: bool = True
) -> Trajectory:
    """Run the twin of a listing in the arithmetic `word`; no argument is checked.

    The results are rounded to floats; the attribute `exact` has them as numbers of the word.
    """
    twin = importlib.import_module(f"pyharness.thesis.{listing.program.replace('-', '_')}")
    found: Trajectory = twin.run(scene_in(scene, word), listing, lipschitz, may_stop)
    if found.stop is None:
        return found
    return replace(found, stop=replace(found.stop, quotient=float(found.stop.quotient)))


def scene_in(scene: Scene, word: Word) -> Scene:
    """Return a copy of a checked scene, with all numbers except counts converted to `word`."""
    law = scene.law

    def those(values: Any) -> Any:
        return None if values is None else tuple(word(each) for each in values)

    def waves(values: tuple[Wave, ...]) -> Any:
        return tuple((those(amplitude), word(frequency)) for amplitude, frequency in values)

    torque = _with(
        law,
        constant=those(law.constant),
        rate=those(law.rate),
        sines=waves(law.sines),
        cosines=waves(law.cosines),
    )
    names = ("omega", "moments", "coefficients", "masses", "forces")
    triples = {name: those(getattr(scene, name)) for name in names}
    return _with(scene, torque=torque, step_size=word(scene.step_size), **triples)


def _with(frozen: Of, **fields: Any) -> Of:
    """Return a changed copy without checks, which would convert the values to floats."""
    changed = copy.copy(frozen)
    vars(changed).update(fields)
    return changed
