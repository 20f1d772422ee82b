"""Attitudes as unit quaternions from body to space, scalar first, with Hamilton's product.

A vector v about the body axes is q v q* in space, with the conjugate q*; q' = q (0, omega)/2.
"""

import math
from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.values import finite, number_list, three

Quaternion = tuple[float, float, float, float]


class Rotation(Protocol):
    """A rotation from body to space, such as SciPy's `Rotation`."""

    def as_quat(self) -> Any:
        """Return the quaternion, scalar last."""


IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
SEQUENCES = ("3-1-3", "3-2-1")
FORMS = ("quaternion", *SEQUENCES, "matrix")
NEAR_ONE = 1e-12  # largest deviation of a norm from 1 that counts as rounding
_ROUNDED = 2.0**-51  # deviation of a norm from 1 that normalisation cannot reduce
_PARALLEL = 2.0**-51  # largest sine of half an angle that counts as rounding


def scalar_first(values: object) -> Any:
    """Return the quaternions of a `Rotation`, scalar first; any other value unchanged."""
    as_quat = getattr(values, "as_quat", None)
    return values if as_quat is None else np.asarray(as_quat())[..., [3, 0, 1, 2]]


def unit_quaternion(where: str, values: object) -> tuple[Quaternion, float]:
    """Return the unit quaternion of four numbers or a `Rotation`, and the numbers' norm."""
    allowed = "allowed: four finite numbers, scalar first, not all 0"
    given = [finite(where, each) for each in number_list(where, scalar_first(values), allowed)]
    if len(given) != 4:
        raise InputError(f"{where}: {len(given)} numbers; {allowed}")
    largest = max(map(abs, given))
    if largest == 0.0:
        raise InputError(f"{where}: all four numbers are 0; {allowed}")
    # The numbers are scaled first, so that no square overflows or underflows.
    length = math.hypot(*(x / largest for x in given))
    whole = length * largest
    if abs(whole - 1.0) > _ROUNDED:
        given = [value / largest / length for value in given]
    w, x, y, z = given
    return (w, x, y, z), whole


def of_angles(where: str, angles_deg: object, sequence: object) -> Quaternion:
    """Return the attitude after three rotations (degrees) about the body axes in `sequence`."""
    if not isinstance(sequence, str) or sequence not in SEQUENCES:
        name = sequence if isinstance(sequence, str) else kind_of(sequence)
        raise unknown("sequence", name, SEQUENCES, where)
    q: Quaternion = IDENTITY
    for axis, angle in zip(sequence.split("-"), three(where, angles_deg), strict=True):
        half = math.radians(math.remainder(angle, 720.0)) / 2.0
        turn = [math.cos(half), 0.0, 0.0, 0.0]
        turn[int(axis)] = math.sin(half)
        q = product(q, (turn[0], turn[1], turn[2], turn[3]))
    return q


def product(p: Iterable[Any], q: Iterable[Any]) -> tuple[Any, Any, Any, Any]:
    """Return Hamilton's product of two quaternions of numbers or arrays."""
    (a, b, c, d), (e, f, g, h) = p, q
    return (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


def quaternion_rates(omega: Iterable[Any], q: Iterable[Any]) -> list[Any]:
    """Return q' = q (0, omega)/2, for numbers, arrays or symbols."""
    (x, y, z), (a, b, c, d) = omega, q
    return [
        -0.5 * (b * x + c * y + d * z),
        0.5 * (a * x + c * z - d * y),
        0.5 * (a * y + d * x - b * z),
        0.5 * (a * z + b * y - c * x),
    ]


def angles(attitude: Array, sequence: str) -> Array:
    """Return n attitudes, (n, 4), as angles (degrees) of three successive rotations, (n, 3)."""
    q0, q1, q2, q3 = attitude.T
    if sequence == "3-1-3":
        tilt = 2.0 * np.arctan2(np.hypot(q1, q2), np.hypot(q0, q3))
        pairs = (q0, q3), (q1, q2)
    else:
        pairs = (q0 - q2, q1 + q3), (q2 + q0, q3 - q1)
        tilt = 2.0 * np.arctan2(np.hypot(*pairs[1]), np.hypot(*pairs[0])) - np.pi / 2.0
    (a, b), (c, d) = pairs
    total, rest = np.arctan2(b, a), np.arctan2(d, c)
    first, last = total + rest, total - rest
    # If the first and last axes are parallel, only the sum or difference of their angles is
    # determined.
    no_total, no_rest = np.hypot(a, b) <= _PARALLEL, np.hypot(c, d) <= _PARALLEL
    first = np.where(no_rest, 2.0 * total, np.where(no_total, 2.0 * rest, first))
    last = np.where(no_rest | no_total, 0.0, last)
    found: Array = np.degrees(np.column_stack([first, tilt, last]))
    found[:, [0, 2]] -= 360.0 * np.round(found[:, [0, 2]] / 360.0)
    return found


def matrices(attitude: Array) -> Array:
    """Return n attitudes, (n, 4), as rotation matrices from body to space, (n, 3, 3)."""
    return np.moveaxis(np.array([*zip(*rows_to_body(attitude.T), strict=True)]), 2, 0)


def rows_to_body(attitude: Iterable[Any]) -> tuple[tuple[Any, ...], ...]:
    """Return the rows of the matrix from space to body, for numbers, arrays or symbols."""
    w, x, y, z = attitude
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def angle_between(attitude: Array, other: Array) -> Array:
    """Return the angle (rad) between each pair of attitudes, (n,); 0 between q and -q."""
    a, b, c, d = attitude.T
    e, f, g, h = other.T
    vector = np.array([
        b * e - a * f + d * g - c * h,
        c * e - a * g + b * h - d * f,
        d * e - a * h + c * f - b * g,
    ])  # fmt: skip
    sine: Array = np.sqrt((vector * vector).sum(axis=0))
    return 2.0 * np.arcsin(np.minimum(1.0, sine))


def quaternion_of_axes(axes: Array) -> Quaternion:
    """Return the attitude of a right-handed frame, the columns of `axes`, (3, 3)."""
    from scipy.spatial.transform import Rotation

    # Older versions of SciPy refuse read-only arrays.
    x, y, z, w = Rotation.from_matrix(np.array(axes)).as_quat().tolist()
    return w, x, y, z


def rotated(vectors: Array, matrix: Array) -> Array:
    """Return one or n matrices, (3, 3), times one or n vectors, (3,)."""
    # In this order, the sums have the same bits for any n, and the same as in C.
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack(
        [(x * matrix[..., i, 0] + y * matrix[..., i, 1]) + z * matrix[..., i, 2] for i in range(3)],
        axis=-1,
    )


def turned_back(attitudes: Array, turn: Any) -> Array:
    """Return body attitudes from attitudes of a frame and the quaternion from frame to body."""
    w, x, y, z = np.moveaxis(np.asarray(turn), -1, 0)
    first, *rest = np.moveaxis(attitudes, -1, 0)
    parts: Any = product((first, rest[0], rest[1], rest[2]), (w, -x, -y, -z))
    return np.stack(parts, axis=-1)


def turned_to_space(attitude: Array, vectors: Array) -> Array:
    """Return vectors, (n, 3), rotated from body to space."""
    scalar, vector = attitude[:, :1], attitude[:, 1:]
    twice = 2.0 * np.cross(vector, vectors)
    return vectors + scalar * twice + np.cross(vector, twice)
