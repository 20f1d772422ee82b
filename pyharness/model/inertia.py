"""Full inertia matrices: their principal moments and axes."""

import math

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.trajectory import Array
from pyharness.model.values import Triple, several, three

Matrix = tuple[Triple, Triple, Triple]

_ALIKE = 1e-12  # of the largest entry: so much may two entries differ that ought to be the same


def checked_inertia(where: str, values: object) -> Matrix:
    """Return a symmetric matrix with moments above 0; InputError for anything else."""
    allowed = "allowed: three rows of three finite numbers, kg m2"
    given = [three(where, row) for row in several(where, values, allowed)]
    if len(given) != 3:
        raise InputError(f"{where}: {len(given)} rows; {allowed}")
    largest = max(abs(x) for row in given for x in row)
    for i in range(3):
        for j in range(i):
            if abs(given[i][j] - given[j][i]) > _ALIKE * largest:
                raise InputError(
                    f"{where}: not symmetric, row {i + 1} column {j + 1} is {given[i][j]:g} and "
                    f"row {j + 1} column {i + 1} is {given[j][i]:g}; allowed: both the same"
                )
    half = [[0.5 * given[i][j] + 0.5 * given[j][i] for j in range(3)] for i in range(3)]
    (a, b, c), (d, e, f), (g, h, k) = half
    matrix = ((a, b, c), (d, e, f), (g, h, k))
    least = min(principal_axes(matrix)[0])
    if not least > 0.0:
        raise InputError(
            f"{where}: its least principal moment is {least:g}; allowed: a positive definite matrix"
        )
    return matrix


def principal_axes(inertia: Matrix | tuple[()]) -> tuple[Triple, Array]:
    """Return the principal moments (kg m2) and the axes they are about, columns of a (3, 3) array.

    A right-handed frame, the one nearest to the body's own.
    """
    matrix = np.array(inertia)
    # A power of two, so that no digit changes and nothing leaves the range of numbers.
    unit = math.ldexp(1.0, math.frexp(np.abs(matrix).max())[1] - 1)
    moments, axes = np.linalg.eigh(matrix / unit)
    order: list[int] = []
    for row in np.abs(axes):
        order.append(max((k for k in range(3) if k not in order), key=lambda k: row[k]))
    axes = axes[:, order]
    axes *= np.where(np.diag(axes) < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, np.argmin(np.abs(np.diag(axes)))] *= -1.0
    first, second, third = (float(x) * unit for x in moments[order])
    return (first, second, third), axes
