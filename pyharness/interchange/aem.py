"""Attitude ephemeris messages (AEM) of CCSDS, in its notation of keywords and values.

The standard is CCSDS 504.0-B-2, *Attitude Data Messages*. Its quaternion from a frame A to a frame
B, scalar last, rotates the axes of A to those of B (annex F2). If A is fixed in space and B in the
body, it is the quaternion from body to space of this library, with its scalar moved to the end.
Version 1 of the format is read too.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from pyharness.interchange.epochs import (
    Epoch,
    epoch_text,
    half_years,
    is_before,
    later,
    read_epoch,
    seconds_between,
)
from pyharness.interchange.knots import DEGREE, interpolation_times, solution_of
from pyharness.model.array_type import Array
from pyharness.model.attitude import matrices
from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.output_files import check_writable, write_files
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import parsed_float

_BODY = "SC_BODY"
_TYPES = {"QUATERNION": 4, "QUATERNION/DERIVATIVE": 8, "QUATERNION/ANGVEL": 7}
_REQUIRED = (
    *("OBJECT_NAME", "OBJECT_ID", "REF_FRAME_A", "REF_FRAME_B", "TIME_SYSTEM"),
    *("START_TIME", "STOP_TIME", "ATTITUDE_TYPE"),
)
_DEFAULTS = {
    "ORIGINATOR": "pyharness",
    "OBJECT_NAME": "UNKNOWN",
    "OBJECT_ID": "UNKNOWN",
    "REF_FRAME_A": "EME2000",
    "REF_FRAME_B": "SC_BODY_1",
    "TIME_SYSTEM": "TAI",
}
_OPTIONAL = ("CREATION_DATE", "CENTER_NAME")
_SMALLEST = 1e-6  # norm of a quaternion that is read; the largest is its inverse


@dataclass(frozen=True, eq=False)
class AttitudeEphemeris:
    """The attitude of a body at several times, as one segment of an AEM file has it.

    Attributes
    ----------
    metadata : dict
        The keywords of the segment with their values, as texts.
    epoch : str
        The date and time of time 0, in the time system of the file.
    time : ndarray, shape (n,)
        Times (s) after the epoch, in ascending order.
    attitude : ndarray, shape (n, 4)
        Unit quaternions from the body to the other frame, scalar first.
    omega : ndarray, shape (n, 3), or None
        The angular velocity about the body axes (rad/s), if the file has it.
    """

    metadata: dict[str, str]
    epoch: str
    time: Array
    attitude: Array
    omega: Array | None


def write_aem(
    found: Trajectory,
    path: str | os.PathLike[str],
    *,
    epoch: str,
    tolerance: float | None = None,
    metadata: dict[str, str] | None = None,
) -> None:
    """Write the attitude and omega of a trajectory as a CCSDS attitude ephemeris message.

    The file has the attitude type QUATERNION/ANGVEL. The numbers have 16 digits, as many as the
    standard allows, so that they may differ from those of the trajectory in the last place. The
    file is written completely or not at all.

    Parameters
    ----------
    found : Trajectory
        A trajectory with attitude, ``solve(..., attitude=True)``.
    path : str or path
        The path of the file, usually with the suffix ``.aem``. A file that exists is replaced.
    epoch : str
        The date and time of time 0 in the time system of the file, such as
        ``"2026-01-31T12:00:00"``.
    tolerance : float, optional
        By default, the file has the rows of the trajectory. With a tolerance, the trajectory needs
        a dense output, and the rows are those of `interpolation_times`: Hermite's interpolation of
        degree 7 through four rows has at most this error (rad).
    metadata : dict, optional
        Values of the keywords ORIGINATOR, CREATION_DATE (default: now), OBJECT_NAME, OBJECT_ID,
        CENTER_NAME, REF_FRAME_A (default EME2000; the axes of space), REF_FRAME_B (SC_BODY_1) and
        TIME_SYSTEM (TAI).

    Raises
    ------
    InputError
        If an argument is invalid, if the trajectory has no attitude, if it has no two rows, or if
        the time system is UTC and the trajectory goes over an end of June or December, where UTC
        may have a leap second.

    Examples
    --------
    >>> from pyharness import Scene, solve
    >>> scene = Scene("brick", moments=(40.0, 30.0, 20.0), omega=(0.0, 1.0, 1.0))
    >>> found = solve(scene, [0.0, 1.0, 2.0], attitude=True)
    >>> write_aem(found, "brick.aem", epoch="2026-01-31T12:00:00")  # doctest: +SKIP
    """
    name = _path(path)
    if not isinstance(found, Trajectory) or found.attitude is None:
        raise InputError("write_aem: there is no attitude; give a trajectory with attitude=True")
    keywords = _checked_metadata(metadata)
    times, omega, attitude = found.time, found.omega, found.attitude
    if tolerance is not None:
        solution = solution_of(found.sol, "write_aem with a tolerance")
        times = interpolation_times(solution, tolerance)
        states = solution(times).T
        omega, attitude = states[:, :3], states[:, 3:]
        keywords |= {"INTERPOLATION_METHOD": "HERMITE", "INTERPOLATION_DEGREE": str(DEGREE)}
    rows = np.column_stack([attitude[:, 1:], attitude[:, 0], np.degrees(omega)])
    order = np.argsort(times, kind="stable")
    times, rows = times[order], rows[order]
    if len(times) < 2 or not np.isfinite(rows).all() or not (np.diff(times) > 0.0).all():
        raise InputError(
            "write_aem: the rows can't be written; allowed: two or more finite rows at different "
            "times"
        )
    begin = read_epoch("epoch", epoch)
    epochs = [later(begin, time) for time in times.tolist()]
    if not all(map(is_before, epochs, epochs[1:])):
        raise InputError(
            "write_aem: two times are the same within 1e-15 s; allowed: times that are apart"
        )
    if keywords["TIME_SYSTEM"] == "UTC" and half_years(epochs[0], epochs[-1]):
        raise InputError(
            "write_aem: UTC may have a leap second at the end of June and December; allowed: "
            "times within a half year, or the time system TAI"
        )
    check_writable(name, "AEM file")
    write_files({name: _text(keywords, epochs, rows).encode()}, "AEM file")


def _path(path: object) -> str:
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"AEM file: {kind_of(path)}; allowed: a path, as text or a Path")
    return os.fsdecode(path)


def _checked_metadata(given: dict[str, str] | None) -> dict[str, str]:
    """Return the keywords with the values of a user, and with defaults for the others."""
    keywords = dict(_DEFAULTS)
    allowed = (*_DEFAULTS, *_OPTIONAL)
    for key, value in (given or {}).items():
        if key not in allowed:
            raise unknown("keyword", str(key), allowed, "metadata")
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            raise InputError(f"metadata: {key} is no text of one line; allowed: a text")
        if not value.isascii():
            raise InputError(f"metadata: {key} has characters that are not ASCII; allowed: ASCII")
        keywords[key] = value.strip()
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S")
    read_epoch("metadata: CREATION_DATE", keywords.setdefault("CREATION_DATE", now))
    return keywords


def _text(keywords: dict[str, str], epochs: Sequence[Epoch], rows: Array) -> str:
    start, stop = epoch_text(epochs[0]), epoch_text(epochs[-1])
    lines = ["CCSDS_AEM_VERS = 2.0"]
    lines += [f"{key} = {keywords[key]}" for key in ("CREATION_DATE", "ORIGINATOR")]
    lines += ["", "META_START"]
    fixed = {"START_TIME": start, "STOP_TIME": stop, "ATTITUDE_TYPE": "QUATERNION/ANGVEL"}
    fixed["ANGVEL_FRAME"] = keywords["REF_FRAME_B"]
    every = keywords | fixed
    ordered = (
        *("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME_A", "REF_FRAME_B", "TIME_SYSTEM"),
        *(*fixed, "INTERPOLATION_METHOD", "INTERPOLATION_DEGREE"),
    )
    lines += [f"{key} = {every[key]}" for key in ordered if key in every]
    lines += ["META_STOP", "", "DATA_START"]
    for epoch, row in zip(epochs, rows.tolist(), strict=True):
        lines.append(" ".join([epoch_text(epoch), *(f"{value:.15e}" for value in row)]))
    return "\n".join([*lines, "DATA_STOP", ""])


def read_aem(path: str | os.PathLike[str]) -> list[AttitudeEphemeris]:
    """Return the attitudes of a CCSDS attitude ephemeris message.

    Quaternions are normalised. Frame B of the file is taken as the body, unless the name of frame A
    alone begins with ``SC_BODY``. Omega is derived from the derivatives of the quaternion if the
    file has these.

    Parameters
    ----------
    path : str or path
        A file of version 1 or 2 in the notation of keywords and values, with the attitude type
        QUATERNION, QUATERNION/DERIVATIVE or QUATERNION/ANGVEL.

    Returns
    -------
    list of AttitudeEphemeris
        One ephemeris for each segment, in the order of the file.

    Raises
    ------
    InputError
        If the file can't be read, or has anything else; the message has the number of the line.

    Examples
    --------
    >>> segment = read_aem("brick.aem")[0]  # doctest: +SKIP
    >>> segment.attitude.shape  # doctest: +SKIP
    (3, 4)
    """
    name = _path(path)
    try:
        with open(name, encoding="utf-8") as file:
            text = file.read()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        raise InputError(f"AEM file '{name}': {reason}; allowed: a file in KVN notation") from None
    found = [_segment(each) for each in _segments(name, text)]
    if not found:
        raise InputError(f"AEM file '{name}': there is no segment; allowed: one or more")
    return found


@dataclass
class _Lines:
    """The lines of a segment with their numbers, for messages."""

    file: str
    metadata: dict[str, str]
    rows: list[tuple[int, str]]
    number: int

    def wrong(self, why: str, number: int = 0) -> InputError:
        return InputError(f"AEM file '{self.file}', line {number or self.number}: {why}")


def _segments(file: str, text: str) -> Iterator[_Lines]:
    """Yield the segments of a file; check the order of its parts."""
    place, header = "header", _Lines(file, {}, [], 1)
    now = header
    after = {"META_START": "metadata", "META_STOP": "data", "DATA_START": "data"}
    after["DATA_STOP"] = "between"
    for number, line in enumerate(map(str.strip, text.splitlines()), 1):
        now.number = number
        if not line or line == "COMMENT" or line.startswith("COMMENT "):
            continue
        if line in after:
            # Version 1 has no DATA_START.
            if line not in {
                "header": ("META_START",),
                "metadata": ("META_STOP",),
                "data": ("DATA_START", "DATA_STOP", "META_START"),
                "between": ("META_START",),
            }.get(place, ()):
                raise now.wrong(f"{line} is out of place")
            if line == "META_START":
                if place == "data":
                    yield now
                now = _Lines(file, dict(header.metadata), [], number)
            if line == "DATA_STOP":
                yield now
            place = after[line]
        elif place == "data":
            now.rows.append((number, line))
        elif place == "between":
            raise now.wrong("a row is outside of DATA_START and DATA_STOP")
        else:
            key, equal, value = map(str.strip, line.partition("="))
            if not equal or not key or not value:
                raise now.wrong("there is no keyword with a value")
            if key in now.metadata:
                raise now.wrong(f"{key} occurs twice")
            if place == "header" and not header.metadata and key != "CCSDS_AEM_VERS":
                raise now.wrong("the first keyword must be CCSDS_AEM_VERS")
            now.metadata[key] = value
    if place == "data":
        yield now
    elif place == "metadata":
        raise now.wrong("META_STOP is missing")


def _segment(lines: _Lines) -> AttitudeEphemeris:
    """Return the ephemeris of a segment."""
    meta = lines.metadata
    version = meta.get("CCSDS_AEM_VERS", "")
    if version not in ("1.0", "2.0"):
        raise lines.wrong(f"version '{version}' of the format; allowed: 1.0, 2.0", 1)
    if missing := [key for key in _REQUIRED if key not in meta]:
        raise lines.wrong(f"the segment has no {missing[0]}")
    kind = meta["ATTITUDE_TYPE"].upper()
    if kind not in _TYPES or (version == "1.0" and kind == "QUATERNION/ANGVEL"):
        raise lines.wrong(f"attitude type {kind}; allowed: {', '.join(_TYPES)}")
    if len(lines.rows) < 1:
        raise lines.wrong("the segment has no rows")
    epochs, values = [], []
    for number, line in lines.rows:
        first, *others = line.split()
        try:
            row = [parsed_float(each) for each in others]
        except ValueError:
            raise lines.wrong("the row has what is no number", number) from None
        if len(row) != _TYPES[kind] or not np.isfinite(row).all():
            raise lines.wrong(f"{kind} has {_TYPES[kind]} finite numbers in a row", number)
        epochs.append(read_epoch(f"AEM file '{lines.file}', line {number}", first))
        values.append(row)
    time = np.array([seconds_between(epochs[0], each) for each in epochs])
    if not (np.diff(time) > 0.0).all():
        late = lines.rows[1 + int(np.argmin(np.diff(time) > 0.0))][0]
        raise lines.wrong("the times are not in ascending order", late)
    if meta["TIME_SYSTEM"].upper() == "UTC":
        for epoch, (number, _) in zip(epochs, lines.rows, strict=True):
            if half_years(epochs[0], epoch):
                raise lines.wrong(
                    "UTC may have a leap second at the end of June and December; allowed: times "
                    "within a half year, or the time system TAI",
                    number,
                )
    rows = np.array(values)
    scalar_first = version == "1.0" and _choice(lines, "QUATERNION_TYPE", "LAST", "FIRST") != "LAST"
    order = [0, 1, 2, 3] if scalar_first else [3, 0, 1, 2]
    attitude = rows[:, :4][:, order]
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(attitude, axis=1, keepdims=True)
    # No quaternion of another size has a meaning, and its square may be out of range.
    if not ((norm > _SMALLEST) & (norm < 1.0 / _SMALLEST)).all():
        odd = int(np.argmin((norm > _SMALLEST) & (norm < 1.0 / _SMALLEST)))
        raise lines.wrong("a quaternion is 0, or far from length 1", lines.rows[odd][0])
    attitude = attitude / norm
    a, b = meta["REF_FRAME_A"], meta["REF_FRAME_B"]
    a_is_body = a.upper().startswith(_BODY) and not b.upper().startswith(_BODY)
    backward = version == "1.0" and _choice(lines, "ATTITUDE_DIR", "A2B", "B2A") != "A2B"
    omega = None
    if kind == "QUATERNION/DERIVATIVE":
        # q' = q (0, omega)/2, with omega about the axes of frame B
        rate = rows[:, 4:][:, order] / norm
        omega = 2.0 * _vector_of_product(attitude, rate)
    elif kind == "QUATERNION/ANGVEL":
        omega = np.radians(rows[:, 4:])
        frame = meta.get("ANGVEL_FRAME", b)
        if frame not in (a, b):
            raise lines.wrong(f"ANGVEL_FRAME is {frame}; allowed: {a}, {b}")
        if frame == a:
            omega = _rotated(attitude, omega, back=True)
    if a_is_body != backward:
        # The rotation from B to A is the inverse, and the angular velocity of A against B the
        # negative, here about the axes of A.
        omega = None if omega is None else -_rotated(attitude, omega)
        attitude = attitude * [1.0, -1.0, -1.0, -1.0]
    return AttitudeEphemeris(dict(meta), epoch_text(epochs[0]), time, attitude, omega)


def _choice(lines: _Lines, key: str, usual: str, other: str) -> str:
    """Return the value of a keyword that has two values; `usual` is the default."""
    found = lines.metadata.get(key, usual).upper()
    if found not in (usual, other):
        raise lines.wrong(f"{key} is {found}; allowed: {usual}, {other}")
    return found


def _vector_of_product(q: Array, p: Array) -> Array:
    """Return the vector part of the product q* p of quaternions in rows, scalar first."""
    found: Array = q[:, :1] * p[:, 1:] - p[:, :1] * q[:, 1:] - np.cross(q[:, 1:], p[:, 1:])
    return found


def _rotated(attitude: Array, vectors: Array, back: bool = False) -> Array:
    """Return vectors, in rows, transformed from body to space, or from space to body if `back`."""
    rotation = matrices(attitude)
    if back:
        rotation = rotation.transpose(0, 2, 1)
    found: Array = np.einsum("nij,nj->ni", rotation, vectors)
    return found
