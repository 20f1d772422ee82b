"""Attributes of a trajectory under the names of SciPy's `solve_ivp`."""

import math
from typing import TYPE_CHECKING

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.report import counted, short

if TYPE_CHECKING:
    from pyharness.model.trajectory import Stop


class SciPyNames:
    """A base class of trajectories with the names of SciPy's results."""

    time: Array
    omega: Array
    attitude: Array | None
    evaluations: int
    ended: str
    stop: "Stop | None"
    growth: float | None
    reason: str | None

    if TYPE_CHECKING:

        @property
        def digits(self) -> float | None:
            """The number of correct decimal digits of omega."""

        @property
        def has_all_rows(self) -> bool:
            """Whether all requested rows are present."""

    @property
    def t(self) -> Array:
        """The attribute `time` (s), shape (n,)."""
        return self.time

    @property
    def y(self) -> Array:
        """The state at each time in columns: omega (rad/s), (3, n), or with quaternion, (7, n)."""
        if self.attitude is None:
            return self.omega.T
        return np.concatenate([self.omega.T, self.attitude.T])

    @property
    def success(self) -> bool:
        """Whether the integration reached all requested times, or a terminal event."""
        return self.status >= 0

    @property
    def status(self) -> int:
        """The ending as in SciPy: 0 if all times were reached, 1 for a terminal event, else -1."""
        if self.ended == "event":
            return 1
        return 0 if self.has_all_rows else -1

    @property
    def message(self) -> str:
        """A sentence that says how the integration ended."""
        if self.stop is not None:
            return (
                f"The Lipschitz test ended the run at step {self.stop.step}, because the Lipschitz "
                f"quotient of {self.stop.variable} was {short(self.stop.quotient)} 1/s."
            )
        if self.ended == "event":
            return "A terminal event ended the integration; the rows end before it or at it."
        if self.ended in ("overflow", "singular"):
            last = f"the last row is at t = {self.time[-1]:g} s" if len(self.time) else "no row"
            reason = self.reason or "omega or the torque became infinite or NaN"
            return f"{reason[0].upper()}{reason[1:]}; {last}."
        if self.ended == "unchecked":
            return (
                "The integration reached all requested times, but may have passed a short change "
                "of the torque, whose series ends before."
            )
        if self.ended != "sensitive":
            return "The integration reached all requested times."
        by = "" if self.growth is None else f", amplified by {short(self.growth)},"
        left = counted(math.floor(self.digits or 0.0), "correct digit")
        return (
            f"The integration reached all requested times, but rounding errors{by} exceed the "
            f"tolerance; omega has {left}."
        )

    @property
    def nfev(self) -> int:
        """The attribute `evaluations`."""
        return self.evaluations
