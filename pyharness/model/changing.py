"""Inertias that are polynomials of time, and Euler's equations for changing inertias."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, repeat
from operator import mul
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pyharness.model.errors import InputError, TimedError
from pyharness.model.values import Matrix, Numbers, Triple, finite, number_list, triple

Polynomial = tuple[float, ...]  # coefficients in ascending powers of time
# Largest number of coefficients; higher powers of time lose digits.
_MOST = 10
_POLYNOMIALS = f"allowed: three lists of 1 to {_MOST} numbers"
_MATRICES = f"allowed: a list of 1 to {_MOST} matrices, each of three rows of three numbers"


class Changing:
    """The base class of changing inertias; the methods here are for polynomials."""

    if TYPE_CHECKING:

        @property
        def place(self) -> str:
            """The key in a scene file: "moments" or "inertia"."""

    @property
    def elements(self) -> Sequence[Sequence[Polynomial]]:
        """The polynomials of the inertia matrix, in three rows."""
        raise NotImplementedError

    @property
    def is_diagonal(self) -> bool:
        """Whether the body axes are principal axes."""
        return self.place == "moments"

    @property
    def is_constant(self) -> bool:
        """Whether the inertia does not change with time."""
        return not any(any(each[1:]) for row in self.elements for each in row)

    def _check_derivative(self) -> None:
        coefficients = (c for row in self.elements for each in row for c in _derivative(each))
        if not all(map(math.isfinite, coefficients)):
            raise InputError(
                f"[body] {self.place}: a coefficient of the derivative overflows; allowed: finite "
                "numbers, also when multiplied by their power of time"
            )

    def matrix(self, time: Any) -> list[list[Any]]:
        """Return the inertia matrix (kg m2) at a time (s), a float, symbol or array."""
        return self._values(self.elements, time)

    def matrix_rate(self, time: Any) -> list[list[Any]]:
        """Return the time derivative of the inertia matrix (kg m2/s)."""
        return self._values([[_derivative(each) for each in row] for row in self.elements], time)

    def _values(self, elements: Sequence[Sequence[Polynomial]], time: Any) -> list[list[Any]]:
        degree = max(len(each) for row in elements for each in row) - 1
        known = list(accumulate(repeat(time, degree), mul, initial=1.0))
        return [[_value(each, known) for each in row] for row in elements]

    def at(self, time: float) -> Triple | Matrix:
        """Return the moments, or the matrix (kg m2), at `time` (s)."""
        matrix = self.matrix(float(time))
        if self.is_diagonal:
            return triple(float(matrix[k][k]) for k in range(3))
        return triple(triple(map(float, row)) for row in matrix)

    def momentum(
        self, times: NDArray[np.float64], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the angular momentum (kg m2/s) about the body axes at n times (s), (n, 3)."""
        matrix = self.matrix(times)
        rows = [sum(each * omega[:, k] for k, each in enumerate(row)) for row in matrix]
        return np.stack([np.asarray(row) for row in rows], axis=-1)

    @cached_property
    def span(self) -> tuple[float, float]:
        """The interval (s) around time 0 where the inertia is positive definite; maybe infinite."""
        from pyharness.model.exact_zeros import determinant, first_zeros

        if isinstance(self, ChangingMoments):
            zeros = [first_zeros(each) for each in self.polynomials]
        else:
            # The least principal moment first reaches 0 where the determinant does.
            zeros = [first_zeros(determinant(self.elements))]
        return max(first for first, _ in zeros), min(last for _, last in zeros)

    def check(self, times: Iterable[float]) -> None:
        """Raise InputError if a moment reaches 0 between time 0 and one of `times` (s)."""
        first, last = self.span
        for time in times:
            if not first < time < last:
                zero = first if time < 0.0 else last
                raise TimedError(
                    f"[body] {self.place}: a principal moment reaches 0 at t = {{time}} s; "
                    "allowed: times before it",
                    zero,
                )


@dataclass(frozen=True)
class ChangingMoments(Changing):
    """Principal moments of inertia that are polynomials of time.

    Mass moves relative to the body, as with booms or propellant, but the principal axes are fixed
    in the body. With the moments I and the torque N, I omega' = N - I' omega - omega x (I omega).
    We assume that moving mass has no angular momentum relative to the body axes, and that leaving
    mass has none about the centre of mass.

    Parameters
    ----------
    polynomials : three lists of numbers
        For each moment, one to ten coefficients of ascending powers of time (s), in kg m2, kg m2/s,
        and so on.

    Raises
    ------
    InputError
        If `polynomials` are not three lists of finite numbers, a moment is not above 0 at time 0,
        or the lists are the rows of a symmetric matrix, which `Scene` takes as `inertia`.

    Examples
    --------
    >>> from pyharness import ChangingMoments, Scene, solve
    >>> moments = ChangingMoments([[40.0, 1.0], [40.0, 1.0], [20.0]])
    >>> moments.at(2.0)
    (42.0, 42.0, 20.0)
    >>> scene = Scene("booms", (1.0, 0.0, 0.0), moments=moments)
    >>> solve(scene, [0.0, 40.0]).omega
    array([[1. , 0. , 0. ],
           [0.5, 0. , 0. ]])
    """

    polynomials: tuple[Polynomial, Polynomial, Polynomial]
    place: ClassVar[str] = "moments"

    if TYPE_CHECKING:

        def __init__(self, polynomials: Iterable[Numbers]) -> None: ...

        def at(self, time: float) -> Triple:
            """Return the three moments (kg m2) at `time` (s)."""

    def __post_init__(self) -> None:
        where = "[body] moments"
        given = _items(where, self.polynomials, 4, _POLYNOMIALS)
        if len(given) != 3:
            raise InputError(f"{where}: {_count(given, 3)} lists; {_POLYNOMIALS}")
        first, second, third = (_polynomial(f"{where}, I{n}", x) for n, x in enumerate(given, 1))
        object.__setattr__(self, "polynomials", (first, second, third))
        for axis, polynomial in enumerate(self.polynomials, 1):
            if not polynomial[0] > 0.0:
                raise InputError(
                    f"{where}: I{axis} is {polynomial[0]:g} at time 0; "
                    "allowed: a finite number above 0"
                )
        is_square = len(first) == len(second) == len(third) == 3
        if is_square and (first[1], first[2], second[2]) == (second[0], third[0], third[1]):
            raise InputError(
                f"{where}: the lists are the rows of a symmetric matrix; give it as inertia, or "
                "append a coefficient 0 to a polynomial"
            )
        self._check_derivative()

    @property
    def elements(self) -> Sequence[Sequence[Polynomial]]:
        """The polynomials of the inertia matrix, empty for zero elements."""
        first, second, third = self.polynomials
        return (first, (), ()), ((), second, ()), ((), (), third)


@dataclass(frozen=True)
class ChangingInertia(Changing):
    """An inertia matrix about the body axes that is a polynomial of time.

    The principal axes may rotate in the body. Assumptions and equations are as in
    `ChangingMoments`.

    Parameters
    ----------
    matrices : one to ten matrices, each of three rows of three numbers
        The symmetric matrices, coefficients of ascending powers of time (s), in kg m2, kg m2/s, and
        so on.

    Raises
    ------
    InputError
        If a matrix is not symmetric or not finite, or the inertia at time 0 not positive definite.

    Examples
    --------
    >>> from pyharness import ChangingInertia, Scene, solve
    >>> first = [[4.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 2.0]]
    >>> rate = [[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 1.0]]
    >>> inertia = ChangingInertia([first, rate])
    >>> inertia.at(2.0)
    ((4.0, 2.0, 0.0), (2.0, 3.0, 0.0), (0.0, 0.0, 4.0))
    >>> scene = Scene("boom", (0.0, 0.0, 1.0), inertia=inertia)
    >>> solve(scene, 2.0).omega
    array([[0. , 0. , 0.5]])
    """

    matrices: tuple[Matrix, ...]
    place: ClassVar[str] = "inertia"

    if TYPE_CHECKING:

        def __init__(self, matrices: Iterable[Iterable[Numbers]]) -> None: ...

        def at(self, time: float) -> Matrix:
            """Return the inertia matrix (kg m2) at `time` (s)."""

    def __post_init__(self) -> None:
        from pyharness.model.inertia import checked_inertia, symmetric_matrix

        where = "[body] inertia"
        given = _items(where, self.matrices, _MOST + 1, _MATRICES)
        if not 1 <= len(given) <= _MOST:
            raise InputError(f"{where}: {_count(given, _MOST)} matrices; {_MATRICES}")
        first = checked_inertia(f"{where} at time 0", given[0])
        rest = (symmetric_matrix(f"{where}, power {n}", x) for n, x in enumerate(given[1:], 1))
        object.__setattr__(self, "matrices", (first, *rest))
        self._check_derivative()

    @property
    def elements(self) -> Sequence[Sequence[Polynomial]]:
        """The polynomials of the inertia matrix."""
        return [
            [tuple(matrix[i][j] for matrix in self.matrices) for j in range(3)] for i in range(3)
        ]


def _items(where: str, values: object, most: int, allowed: str) -> list[Any]:
    # Only `most` elements are read, so that an endless generator is refused.
    return [x for x, _ in zip(number_list(where, values, allowed), range(most), strict=False)]


def _count(given: Sequence[object], most: int) -> str:
    return f"more than {most}" if len(given) > most else str(len(given))


def _polynomial(where: str, values: object) -> Polynomial:
    given = _items(where, values, _MOST + 1, _POLYNOMIALS)
    if not 1 <= len(given) <= _MOST:
        raise InputError(f"{where}: {_count(given, _MOST)} numbers; {_POLYNOMIALS}")
    return tuple(finite(where, each) for each in given)


def _value(polynomial: Polynomial, time_powers: Sequence[Any]) -> Any:
    total: Any = 0.0
    for coefficient, power in zip(polynomial, time_powers, strict=False):
        if coefficient:
            total = total + coefficient * power
    return total


def _derivative(polynomial: Polynomial) -> Polynomial:
    return tuple(n * c for n, c in enumerate(polynomial))[1:]


def rates_of_changing(changing: Changing, time: Any, omega: Any, torque: Any) -> list[Any]:
    """Return the derivative of omega (rad/s2) for a changing inertia."""
    matrix, rate, (x, y, z) = changing.matrix(time), changing.matrix_rate(time), omega
    if changing.is_diagonal:
        a, b, c = (matrix[k][k] for k in range(3))
        # Differences of nearly equal moments have no rounding errors; differences of products
        # would.
        products = (b - c) * (y * z), (c - a) * (z * x), (a - b) * (x * y)
        return [
            (torque[k] - rate[k][k] * omega[k] + products[k]) / moment
            for k, moment in enumerate((a, b, c))
        ]
    return rates_of_inertia(matrix, omega, [torque[k] - _dot(rate[k], omega) for k in range(3)])


def rates_of_inertia(matrix: Any, omega: Any, torque: Any) -> list[Any]:
    """Return the derivative of omega (rad/s2) for a full inertia matrix."""
    (x, y, z), (u, v, w) = omega, (_dot(row, omega) for row in matrix)
    products = z * v - y * w, x * w - z * u, y * u - x * v
    return _solved(matrix, [torque[k] + products[k] for k in range(3)])


def _dot(first: Any, second: Any) -> Any:
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def _solved(matrix: list[list[Any]], right: list[Any]) -> list[Any]:
    """Solve matrix x = right by L D L^T (Golub and Van Loan 2013, Matrix Computations, 4.1)."""
    (a, f, e), (_, b, d), (_, _, c) = matrix
    l21, l31 = f / a, e / a
    second, below = b - l21 * f, d - l31 * f
    l32 = below / second
    third = c - l31 * e - l32 * below
    u = right[0]
    v = right[1] - l21 * u
    w = right[2] - l31 * u - l32 * v
    z = w / third
    y = v / second - l32 * z
    return [u / a - l21 * y - l31 * z, y, z]
