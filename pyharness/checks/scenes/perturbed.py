"""Copies of a scene with one perturbed number each."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw


def perturbed(scene: Scene, part: float) -> Iterator[Scene]:
    """Yield copies of the scene, each with one nonzero number multiplied by 1 + `part`."""
    for name in ("moments", "coefficients", "omega"):
        for triple in _triples(getattr(scene, name), part):
            yield _with(scene, name, triple)
    law = scene.law
    for name in ("constant", "rate"):
        for triple in _triples(getattr(law, name), part):
            yield replace(scene, torque=_with(law, name, triple))
    for name in ("sines", "cosines"):
        waves = getattr(law, name)
        for place, (amplitude, frequency) in enumerate(waves):
            faster = (amplitude, frequency * (1.0 + part))
            for wave in (*((triple, frequency) for triple in _triples(amplitude, part)), faster):
                changed = (*waves[:place], wave, *waves[place + 1 :])
                yield replace(scene, torque=_with(law, name, changed))


def _with(whole: Scene | TorqueLaw, name: str, part: object) -> Any:
    changes: dict[str, Any] = {name: part}
    return replace(whole, **changes)


def _triples(triple: Triple | None, part: float) -> Iterator[Triple]:
    for axis, x in enumerate(triple or ()):
        if x:
            first, second, third = np.array(triple) * (1.0 + part * (np.arange(3) == axis))
            yield float(first), float(second), float(third)
