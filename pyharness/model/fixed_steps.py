"""The methods with a fixed step, each declared once.

Their codes, the registry, the checks and the formulas in Fortran (`fortran/make_fixed_steps.py`)
come from these declarations. A new method is appended, so that no code changes.
"""

from dataclasses import dataclass
from fractions import Fraction

_HALF, _THIRD, _SIXTH = (Fraction(1, n) for n in (2, 3, 6))
Row = tuple[Fraction | int, ...]


@dataclass(frozen=True)
class FixedStep:
    name: str
    title: str
    source: str
    order: int  # of the global error in the step size
    evaluations: int  # right-hand sides per step
    # The Runge-Kutta matrix below its diagonal, and the weights. Methods without them have their
    # formulas in fortran/modern/fixed_step.fypp and pyharness/checks/theory/schemes.py.
    matrix: tuple[Row, ...] = ()
    weights: Row = ()

    @property
    def nodes(self) -> Row:
        """The times of the stages, in steps."""
        return tuple(sum(row, Fraction(0)) for row in self.matrix)


FIXED_STEPS = (
    FixedStep(
        "improved-euler", "improved Euler", "Jacobs 1982, eq. 29", 2, 2,
        matrix=((), (1,)), weights=(_HALF, _HALF),
    ),
    FixedStep("taylor-3", "three terms of the Taylor series", "Jacobs 1982, eq. 30", 2, 2),
    FixedStep(
        "rk4", "classical Runge-Kutta", "Jacobs 1982, eq. 31", 4, 4,
        matrix=((), (_HALF,), (0, _HALF), (0, 0, 1)), weights=(_SIXTH, _THIRD, _THIRD, _SIXTH),
    ),
)  # fmt: skip
