"""The warning about bodies that can not exist, where a user makes one."""

import sys
import warnings
from typing import Protocol

# Frames between a user's line and the scene that it makes.
_BETWEEN = ("copy", "dataclasses", "pyharness.model.scene", "pyharness.model.scene_file", __name__)


class ImpossibleBodyWarning(UserWarning):
    """The moments of a body break the triangle inequality; what is asked for is computed anyway."""


class _Body(Protocol):
    @property
    def is_impossible(self) -> bool: ...


def warn_of_impossible(body: _Body) -> None:
    """Warn, at the user's line, of a body that the user makes; scenes of our own are silent."""
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_globals.get("__name__") in _BETWEEN:
        frame, level = frame.f_back, level + 1
    name = str(frame.f_globals.get("__name__"))
    if name.partition(".")[0] != "pyharness" and body.is_impossible:
        warnings.warn(
            "no rigid body has these moments: the largest exceeds the sum of the others",
            ImpossibleBodyWarning,
            stacklevel=level,
        )
