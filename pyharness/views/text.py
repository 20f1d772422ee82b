"""Tables: text of at most 100 columns out of trajectories; nothing is computed here."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory

if TYPE_CHECKING:
    from pyharness.model.build import Build

WIDTH = 100
_MOST_ROWS = 200
_END_ROWS = 10

_RUN_HEAD = ("step", "time", "TIME", "U1", "U2", "U3", "V1", "V2", "V3")


def trajectory_table(title: Sequence[str], scene: Scene, trajectory: Trajectory) -> str:
    """Return the rows of one trajectory; those in the middle are left out where there are many."""
    rows = []
    n = len(trajectory.time)
    shown = list(range(n))
    if n > _MOST_ROWS:
        shown = shown[:_END_ROWS] + shown[-_END_ROWS:]
    for index in shown:
        row = [str(index + 1), f"{trajectory.time[index]:.6g}"]
        row.append(f"{trajectory.recorded_time[index]:.6g}")
        row += [f"{x:.6g}" for x in trajectory.omega[index]]
        if trajectory.velocity is not None:
            row += [f"{x:.6g}" for x in trajectory.velocity[index]]
        rows.append(row)
    head = _RUN_HEAD if trajectory.velocity is not None else _RUN_HEAD[:6]
    body = aligned(head, rows, left=0)
    if n > _MOST_ROWS:
        left_out = f"... {n - 2 * _END_ROWS} rows left out; --format csv gives all ..."
        body.insert(len(body) - _END_ROWS, left_out)
    lines = [*heading(scene), *(line for each in title for line in wrapped(each)), "", *body]
    lines += ["", ending(trajectory)]
    return "\n".join(lines) + "\n"


def ending(trajectory: Trajectory) -> str:
    """Say in a line how a run ended."""
    steps = counted(trajectory.steps, "step")
    counts = f"{steps}, {counted(trajectory.evaluations, 'right-hand side')}"
    if trajectory.stop is not None:
        stop = trajectory.stop
        return (
            f"stopped at step {stop.step} by {stop.variable}: "
            f"Lipschitz quotient {short(stop.quotient)} ({counts})"
        )
    if trajectory.ended == "overflow":
        return f"overflow: the rows end before the first omega that is not finite ({counts})"
    return f"complete ({counts})"


def trajectory_rows(trajectory: Trajectory) -> tuple[Sequence[str], list[list[str]]]:
    """Return head and rows of a trajectory for CSV and Markdown, floats that round-trip."""
    head = ["time", "recorded_time", "omega1", "omega2", "omega3"]
    parts = [trajectory.time[:, None], trajectory.recorded_time[:, None], trajectory.omega]
    if trajectory.velocity is not None:
        head += ["velocity1", "velocity2", "velocity3"]
        parts.append(trajectory.velocity)
    columns = [column for part in parts for column in part.T.tolist()]
    return head, [[repr(x) for x in row] for row in zip(*columns, strict=True)]


def doctor_table(build: "Build", optional: Mapping[str, str], missing: Sequence[str]) -> str:
    """Return what is built, with what, and which of the optional packages are missing."""
    rows = [
        ("pyharness", build.version),
        ("extension", build.extension or "not built: 'make compare', or 'pip install .'"),
        ("Fortran compiler", build.compiler or "unknown, for nothing is built"),
        ("Fortran flags", build.flags or "unknown, for nothing is built"),
        ("Python", build.python),
        ("NumPy", build.numpy or "missing"),
        ("SciPy", build.scipy or "missing"),
        ("platform", build.platform),
    ]
    for package, purpose in optional.items():
        state = f"missing: 'pip install {package}'" if package in missing else "installed"
        rows.append((package, f"{state} ({purpose})"))
    return "".join(f"{name:18s}{text}\n" for name, text in rows)


def csv_text(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return rows as CSV."""
    import csv
    import io

    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return buffer.getvalue()


def markdown_text(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return rows as a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def short(x: float | None) -> str:
    """Return two digits of a number in a few characters: 1.2e-3, 0, -, inf."""
    if x is None:
        return "-"
    if math.isnan(x) or math.isinf(x) or x == 0:
        return {"nan": "nan", "inf": "inf", "-inf": "-inf"}.get(str(x), "0")
    mantissa, exponent = f"{x:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def counted(number: int, what: str) -> str:
    """Say a number of things: 1 step, 2 steps."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def heading(scene: Scene) -> list[str]:
    """Say what a scene is: body, torque, start, steps."""
    title = f"Case {scene.case}: {scene.name}" if scene.case else scene.name
    lines = wrapped(title)
    if scene.moments is not None:
        body = f"I = {_tuple(scene.moments)} kg m2"
    else:
        body = f"A, B, C = {_tuple(scene.euler_coefficients)}"
    unit = "N m" if scene.moments is not None else "1/s2"
    torque = f"N = {_law(scene)} {unit}" if not scene.torque.is_zero else "no torque"
    lines += wrapped(
        f"{body}; {torque}; omega(0) = {_tuple(scene.omega)} rad/s; "
        f"{counted(scene.steps, 'step')} of {scene.step_size:g} s"
    )
    if scene.is_impossible:
        lines.append("no rigid body has these moments: the largest exceeds the sum of the others")
    return lines


def _law(scene: Scene) -> str:
    law = scene.torque
    if not law.varies:
        return _tuple(law.constant)
    parts = [_tuple(law.constant)] if any(law.constant) else []
    if any(law.rate):
        parts.append(f"{_tuple(law.rate)} t")
    for name, waves in (("sin", law.sines), ("cos", law.cosines)):
        parts += [f"{_tuple(a)} {name} {f:g}t" for a, f in waves]
    return " + ".join(parts)


def _tuple(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{x:g}" for x in values) + ")"


def wrapped(text: str) -> list[str]:
    """Return the lines of a text of any length."""
    # A name with a hyphen stays whole, for it is there to be typed.
    lines = textwrap.wrap(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False)
    return lines or [""]


def aligned(head: Sequence[str], rows: Sequence[Sequence[str]], left: int) -> list[str]:
    """Return lines with aligned columns: the first `left` to the left, the rest to the right."""
    widths = [max(len(line[i]) for line in [head, *rows]) for i in range(len(head))]
    gap = "  " if sum(widths) + 2 * (len(widths) - 1) <= WIDTH else " "
    lines = []
    for line in [head, *rows]:
        cells = [
            cell.ljust(width) if i < left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        lines.append(gap.join(cells).rstrip())
    return lines
