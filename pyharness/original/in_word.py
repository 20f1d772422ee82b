"""Runs of a program's Python twin in a word, which is a floating-point format of `word.py`.

The twin is the Python port of one of the three programs of the thesis.
"""

import copy
import importlib
from dataclasses import replace
from typing import Any, TypeVar

from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.model.trajectory import Trajectory
from pyharness.original.word import WORDS as WORDS
from pyharness.original.word import Word

Of = TypeVar("Of", Scene, TorqueLaw)


def run(
    scene: Scene, listing: Listing, word: Word, lipschitz: float = 500.0, may_stop: bool = True
) -> Trajectory:
    """Run the Python version of a listing's program in a word, which is a floating-point format.

    `listing` is the program with its active defects. `lipschitz` is the Lipschitz constant (1/s) of
    the Runge-Kutta program's stop test, and `may_stop` says whether this test may end the run. No
    argument is checked. The trajectory contains the results rounded to floats. Its attribute
    `exact` contains the results as numbers of the word.
    """
    twin = importlib.import_module(f"pyharness.original.{listing.program.replace('-', '_')}")
    found: Trajectory = twin.run(scene_in(scene, word), listing, lipschitz, may_stop)
    if found.stop is None:
        return found
    return replace(found, stop=replace(found.stop, quotient=float(found.stop.quotient)))


def scene_in(scene: Scene, word: Word) -> Scene:
    """Return a copy of `scene` with all its numbers, except counts, in the format `word`.

    A word is a floating-point format. The numbers of the copy are not checked. Therefore `scene`
    itself must have been checked.
    """
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
    """Return a copy of a frozen dataclass in which some fields have new values.

    The new values are the keyword arguments `fields`. The checks of the dataclass are skipped,
    because they would convert the values to floats.
    """
    changed = copy.copy(frozen)
    vars(changed).update(fields)
    return changed
