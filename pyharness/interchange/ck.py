"""C-kernels: files with the attitude of a body for SPICE, written by SpiceyPy."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pyharness.interchange.epochs import read_epoch, seconds_past_j2000
from pyharness.interchange.knots import DEGREE, interpolation_times, solution_of, with_space
from pyharness.model.distribution import check_package, install_command
from pyharness.model.errors import InputError, kind_of
from pyharness.model.output_files import check_writable, write_files
from pyharness.model.trajectory import Trajectory

_TICKS = 1_000_000  # of the clock in a second
_LONGEST = 1e9  # s, which the clock can count
_SUBTYPE = 2  # packets of quaternion, its derivative, angular velocity, its derivative
_FRAMES = {
    "FRAME_{name}": "{body}",
    "FRAME_{body}_NAME": "'{name}'",
    "FRAME_{body}_CLASS": "3",
    "FRAME_{body}_CLASS_ID": "{body}",
    "FRAME_{body}_CENTER": "{clock}",
    "CK_{body}_SCLK": "{clock}",
    "CK_{body}_SPK": "{clock}",
}
_CLOCK = {
    "SCLK_KERNEL_ID": "( @2000-01-01 )",
    "SCLK_DATA_TYPE_{number}": "( 1 )",
    "SCLK01_TIME_SYSTEM_{number}": "( 1 )",
    "SCLK01_N_FIELDS_{number}": "( 2 )",
    "SCLK01_MODULI_{number}": "( 10000000000 {ticks} )",
    "SCLK01_OFFSETS_{number}": "( 0 0 )",
    "SCLK01_OUTPUT_DELIM_{number}": "( 1 )",
    "SCLK_PARTITION_START_{number}": "( 0 )",
    "SCLK_PARTITION_END_{number}": "( 1E16 )",
    "SCLK01_COEFFICIENTS_{number}": "( 0 {start!r} 1 )",
}


def write_ck(
    found: Trajectory,
    path: str | os.PathLike[str],
    text_path: str | os.PathLike[str],
    *,
    epoch: str = "2000-01-01T12:00:00",
    tolerance: float = 1e-9,
    body: int = -1_000_000,
    name: str = "PYHARNESS_BODY",
) -> None:
    """Write the attitude of a trajectory as a C-kernel of SPICE, with a clock and a frame.

    The C-kernel has the type 5 with angular velocity. Its times are chosen so that the
    interpolation of SPICE has at most the error `tolerance`. Both files are written, or none.

    Parameters
    ----------
    found : Trajectory
        A trajectory ``solve(..., attitude=True, dense_output=True)``, from one time to another.
    path, text_path : str or path
        The path of the C-kernel, usually with the suffix ``.bc``, and of a text kernel with the
        clock and the frame of the body, usually with the suffix ``.tk``. Files that exist are
        replaced.
    epoch : str
        The date and time of time 0 in barycentric dynamical time (TDB). SPICE computes with
        binary64 seconds since 2000-01-01T12:00:00, which is the default. At other dates it rounds
        times, by up to 6e-8 s in 2026.
    tolerance : float
        The largest error of the interpolated attitude (rad), and of omega as a fraction of its
        largest magnitude; at least 1e-12. See `interpolation_times`.
    body : int
        The number of the frame in SPICE, -1000 or less. Divided by 1000, it is the number of the
        clock.
    name : str
        The name of the frame in SPICE: capital letters, digits and ``_``, up to 26 characters.

    Raises
    ------
    InputError
        If SpiceyPy is not installed, if an argument is invalid, or if a file can't be written.

    Examples
    --------
    >>> from pyharness import case_scene, solve
    >>> found = solve(case_scene(3), 10.0, attitude=True, dense_output=True)
    >>> write_ck(found, "case-3.bc", "case-3.tk")  # doctest: +SKIP
    """
    check_package("spiceypy", "write_ck", install_command("spice"))
    import spiceypy

    if not isinstance(found, Trajectory):
        raise InputError(f"write_ck: {kind_of(found)}; allowed: a trajectory")
    paths = [_checked_path(each) for each in (path, text_path)]
    if paths[0] == paths[1]:
        raise InputError("write_ck: both files have the same path; give two")
    if not isinstance(body, int) or not -(2**31) <= body <= -1000 or body % 1000:
        raise InputError(f"body {body!r}; allowed: a negative multiple of 1000, as -1000000")
    letters = isinstance(name, str) and name.isascii() and name.replace("_", "A").isalnum()
    if not letters or name.upper() != name or not name[0].isalpha() or len(name) > 26:
        raise InputError(f"name {name!r}; allowed: capital letters, digits and _, at most 26")
    solution = solution_of(found.sol, "write_ck")
    # The clock begins with the first row, so that its ticks are rounded least.
    start = solution.t_min
    if solution.t_max - start > _LONGEST:
        raise InputError(f"write_ck: more than {_LONGEST:g} s; allowed: a shorter time")
    begin = seconds_past_j2000(read_epoch("epoch", epoch)) + start
    for each in paths:
        check_writable(each, "SPICE file")
    times = interpolation_times(solution, tolerance)
    states, rates = with_space(solution(times).T, solution.derivative(times).T)
    # SPICE's quaternion rotates from space to body, and its omega is about the axes of space.
    conjugate = [1.0, -1.0, -1.0, -1.0]
    packets = np.column_stack([
        *(each[:, 3:7] * conjugate for each in (states, rates)),
        *(each[:, 7:] for each in (states, rates)),
    ])  # fmt: skip
    ticks = (times - start) * _TICKS
    numbers = {"number": str(-body // 1000), "clock": str(body // 1000), "body": str(body)}
    text = _text_kernel(numbers | {"name": name}, begin)
    with TemporaryDirectory() as folder:
        written = Path(folder, "attitude.bc")
        handle = spiceypy.ckopn(str(written), "pyharness", 0)
        try:
            spiceypy.ckw05(
                handle, _SUBTYPE, DEGREE, ticks[0], ticks[-1], body, "J2000", True, "pyharness",
                ticks, packets, 1.0 / _TICKS, 1, ticks[:1],
            )  # fmt: skip
        finally:
            spiceypy.ckcls(handle)
        content = written.read_bytes()
    write_files({paths[0]: content, paths[1]: text.encode()}, "SPICE file")


def _checked_path(path: object) -> str:
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"SPICE file: {kind_of(path)}; allowed: a path, as text or a Path")
    return os.fsdecode(path)


def _text_kernel(names: dict[str, str], start: float) -> str:
    """Return a text kernel with the clock and the frame of the body."""
    lines = [
        "KPL/FK",
        "",
        "The clock and the frame of a body, for its C-kernel.",
        "",
        r"\begindata",
    ]
    for key, value in (_FRAMES | _CLOCK).items():
        number = value.format(**names, ticks=_TICKS, start=start)
        lines.append(f"{key.format(**names)} = {number}")
    return "\n".join([*lines, r"\begintext", ""])
