"""The document `docs/explanation/proofs.md`, made from certificates and runs.

Its text is in the template `proofs.md.in`. A ball is a proved enclosure of omega: its middle and
radius (rad/s). Errors of the programs are intervals that contain the difference from the true
solution.
"""

import json
from collections.abc import Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from functools import cache
from typing import Any

from docs.article.build import rendered, wrapped
from docs.certificates.limits import counts_table, limits_table
from docs.certificates.write import DIGITS, HERE, TIMES, file_name, planned
from pyharness.edition.made_pages import table
from pyharness.history.claims.laboratory import starts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.programs import run_program
from pyharness.truth.enclosed import Balls, rounded_up

PAGE = "explanation/proofs.md"
"""The path of the document in the folder `docs`."""

JUDGED = (2, 3, 4, 5, 6)
"""The cases that decide whether collocation is superior."""

_HEAD = "case | steps | two-term | four-term | Runge-Kutta"
_SHOWN = 4  # significant digits of a bound

Bounds = tuple[Fraction, Fraction]


def proofs_page() -> str:
    """Return the document on the proofs as Markdown."""
    original, corrected = errors(True), errors(False)
    both = [solution_rows(), limit_rows()]
    (solutions, solution_error), (limits, limit_error) = map(_decimal_table, both)
    template = (HERE / "proofs.md.in").read_text(encoding="utf-8")
    text = rendered(
        template,
        {
            "count": str(len(planned())),
            "other_starts": {2: "two"}[len(starts()) - 1],
            "steps": str(case_scene(1).steps),
            "solutions": solutions,
            "solution_error": solution_error,
            "limits": limits,
            "limit_error": limit_error,
            "original_errors": _errors_table(original),
            "corrected_errors": _errors_table(corrected),
            "original_ratio": rounded(
                max(max(two[1], four[1]) / third[0] for two, four, third in _judged(original)), True
            ),
            "corrected_ratio": rounded(
                min(min(two[0], four[0]) / third[1] for two, four, third in _judged(corrected)),
                False,
            ),
            "original_end": _end_table(True),
            "corrected_end": _end_table(False),
            "files": _files_table(),
            "limit_counts": counts_table(),
            "check_limits": limits_table(),
        },
    )
    return wrapped(text)


@cache
def proved_rows(name: str) -> dict[float, Balls]:
    """Return the balls of a certificate by their time (s)."""
    certificate = json.loads((HERE / name).read_text(encoding="ascii"))
    return {
        row["time"]: Balls(tuple(map(Fraction, row["omega"])), Fraction(row["radius"]))
        for row in certificate["rows"]
    }


def solution_rows() -> list[tuple[int, float, Balls]]:
    """Return the case, time (s) and ball of each row of the page."""
    return [(n, t, proved_rows(file_name(n))[t]) for n in case_numbers() for t in TIMES]


def limit_rows() -> list[tuple[int, float, Balls]]:
    """Return case, time (s) and ball of the limit of the original Runge-Kutta program.

    The limit is 2 y(t/2) - y(0), where y is the solution. It is not so under a varying torque;
    these cases are left out.
    """
    found = []
    for case in case_numbers():
        scene = case_scene(case)
        if scene.law.varies:
            continue
        for time in TIMES:
            middle, radius = proved_rows(file_name(case))[time / 2.0]
            pairs = zip(middle, map(Fraction, scene.omega), strict=True)
            found.append((case, time, Balls(tuple(2 * y - y0 for y, y0 in pairs), 2 * radius)))
    return found


def errors(original: bool) -> dict[int, tuple[int, list[Bounds]]]:
    """Return for each case the number of steps that all three programs ran, and bounds of errors.

    The bounds (rad/s) are for the largest error of each program at these steps.
    """
    found = {}
    for case in case_numbers():
        runs = [_run(program, case, original, True) for program in PROGRAMS]
        common = min(run.steps for run in runs)
        found[case] = common, [error_bounds(run, case, range(common)) for run in runs]
    return found


def error_bounds(run: Trajectory, case: int, rows: Sequence[int]) -> Bounds:
    """Return bounds of the largest error of any component of omega (rad/s) in rows of a run."""
    proved = proved_rows(file_name(case))
    low = high = Fraction(0)
    for n in rows:
        middle, radius = proved[float(run.time[n])]
        numbers = map(Fraction, map(float, run.omega[n]))
        distance = max(abs(x - y) for x, y in zip(numbers, middle, strict=True))
        low, high = max(low, distance - radius), max(high, distance + radius)
    return low, high


def rounded(x: Fraction, up: bool) -> str:
    """Return a number with four significant digits, rounded up or down."""
    if not x:
        return "0"
    context = Context(prec=_SHOWN, rounding=ROUND_CEILING if up else ROUND_FLOOR)
    quotient = context.divide(Decimal(x.numerator), Decimal(x.denominator))
    return f"{quotient:f}" if abs(quotient.adjusted()) < _SHOWN else f"{quotient:.{_SHOWN - 1}e}"


@cache
def _run(program: str, case: int, original: bool, may_stop: bool) -> Trajectory:
    listing = (Listing.original if original else Listing.corrected)(program)
    return run_program(case_scene(case), listing, may_stop=may_stop)


def _judged(found: Mapping[int, tuple[int, list[Bounds]]]) -> list[list[Bounds]]:
    return [found[case][1] for case in JUDGED]


def _interval(bounds: Bounds) -> str:
    low, high = bounds
    return f"[{rounded(low, False)}, {rounded(high, True)}]"


def _errors_table(found: Mapping[int, tuple[int, list[Bounds]]]) -> str:
    rows = [
        [str(case), str(common), *map(_interval, bounds)]
        for case, (common, bounds) in found.items()
    ]
    return table(_HEAD, rows)


def _end_table(original: bool) -> str:
    rows = []
    for case in case_numbers():
        row = [str(case)]
        for program in PROGRAMS:
            run = _run(program, case, original, False)
            complete = run.ended == "complete"
            last = range(run.steps - 1, run.steps)
            row.append(
                _interval(error_bounds(run, case, last))
                if complete
                else f"overflow in step {run.steps + 1}"
            )
        rows.append(row)
    return table(_HEAD.replace("steps | ", ""), rows)


def _decimal_table(found: Sequence[tuple[int, float, Balls]]) -> tuple[str, str]:
    """Return a table of balls in decimal digits, and a bound of the error of its numbers."""
    rows, error = [], Fraction(0)
    for case, time, (middle, radius) in found:
        wholes = [round(x * 10**DIGITS) for x in middle]
        distances = [
            abs(x - Fraction(whole, 10**DIGITS)) for x, whole in zip(middle, wholes, strict=True)
        ]
        error = max(error, radius + max(distances))
        rows.append([str(case), f"{time:g}", *map(_shifted, wholes)])
    return table("case | time, s | omega1 | omega2 | omega3", rows), f"{rounded_up(error):g}"


def _shifted(whole: int) -> str:
    """Return `whole` / 10**DIGITS as a decimal number."""
    sign, text = "-" if whole < 0 else "", str(abs(whole)).rjust(DIGITS + 1, "0")
    return f"{sign}{text[:-DIGITS]}.{text[-DIGITS:]}"


def _files_table() -> str:
    rows: list[list[Any]] = []
    for each in planned():
        certificate = json.loads((HERE / each.name).read_text(encoding="ascii"))
        start = ", ".join(f"{x:g}" for x in certificate["scene"]["omega"])
        counts = [str(len(certificate[name])) for name in ("steps", "rows")]
        rows.append([f"`{each.name}`", str(each.case), f"({start})", *counts])
    return table("file | case | initial omega, rad/s | steps of the proof | rows", rows)
