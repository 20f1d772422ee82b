"""Polynomials of time with real coefficients: their values and derivatives."""

from collections.abc import Sequence
from typing import Any

Polynomial = tuple[float, ...]


def powers(time: Any, count: int) -> list[Any]:
    """Return the powers 0 to `count` - 1 of a time, which may be a symbol."""
    found: list[Any] = [1.0]
    while len(found) < count:
        found.append(found[-1] * time)
    return found


def value(polynomial: Polynomial, time_powers: Sequence[Any]) -> Any:
    """Return the value of a polynomial from the powers of the time."""
    total: Any = 0.0
    for coefficient, power in zip(polynomial, time_powers, strict=False):
        if coefficient:
            total = total + coefficient * power
    return total


def derivative(polynomial: Polynomial) -> Polynomial:
    """Return the derivative of a polynomial with respect to time."""
    return tuple(n * c for n, c in enumerate(polynomial))[1:]
