"""Warning about impossible moments of inertia."""

import sys
import warnings
from collections.abc import Iterable
from typing import Any, Protocol

# Modules whose stack frames are between the user's call and the creation of the scene.
_BETWEEN = (
    *("copy", "dataclasses", "pyharness.engine.scene_reader"),
    *("pyharness.model.scene", "pyharness.model.scene_file", __name__),
)

# Ratio of the largest moment to an excess that rounding may cause.
_ROUNDED = 2**50


class ImpossibleBodyWarning(UserWarning):
    """A warning that the largest moment of a body exceeds the sum of the other two.

    The results are nevertheless computed.

    Examples
    --------
    >>> import warnings
    >>> from pyharness import ImpossibleBodyWarning, Scene
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", ImpossibleBodyWarning)
    ...     scene = Scene("impossible", (0.0, 1.0, 0.0), moments=(3.0, 1.0, 1.0))
    >>> scene.is_impossible
    True
    """


class _Body(Protocol):
    @property
    def is_impossible(self) -> bool: ...


def breaks_triangle(moments: Iterable[Any]) -> bool:
    """Return whether the largest moment exceeds the sum of the others by more than rounding."""
    low, middle, high = sorted(moments)
    return bool((high - middle - low) * _ROUNDED > high)


def warn_of_impossible(body: _Body) -> None:
    """Warn, at the line of user code, of impossible moments."""
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
