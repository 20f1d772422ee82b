"""The noise floor: the distances between builds of the original."""

import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from pyharness.checks.agree.comparing import are_same, largest_distance
from pyharness.checks.agree.plan import Plan, Program
from pyharness.checks.agree.programs import answers, compile_source
from pyharness.checks.agree.reading import Rows
from pyharness.checks.port_process import PortError

_ROUNDING = {
    "gfortran": (
        "-O0", "-O1", "-O2", "-O3", "-O3 -march=native -ffp-contract=fast",
        "-O2 -mfpmath=387", "-O2 -funsafe-math-optimizations", "-O2 -fno-frontend-optimize",
    ),
    "gcc": (
        "-O0", "-O1", "-O2", "-O3", "-O3 -march=native -ffp-contract=fast",
        "-O2 -mfpmath=387", "-O2 -funsafe-math-optimizations",
    ),
}  # fmt: skip
"""Flags that change only the rounding of results, by compiler."""
_INITIAL = {
    "gfortran": (
        "-O0 -finit-real=zero -finit-integer=0", "-O0 -finit-real=snan -finit-integer=-99",
        "-O0 -fno-automatic", "-O0 -frecursive",
    ),
    "gcc": ("-O0 -ftrivial-auto-var-init=zero", "-O0 -ftrivial-auto-var-init=pattern"),
}  # fmt: skip
"""Flags that change only the initial values of variables, or whether a call keeps them."""
_OTHERS = {"gfortran": ("flang-new", "flang"), "gcc": ("clang",)}
_OF_STORAGE = re.compile("-(O|m|funsafe|finit|fno-automatic|fauto|frecursive|ftrivial)")
_WARNED = re.compile(r"\W([\w.%]+)\W (?:is|may be) used uninitialized")
_AT = re.compile(r":(\d+):\d+:")


@dataclass(frozen=True)
class Build:
    flags: str
    rows: list[Rows] | None  # None if it failed
    note: str = ""


@dataclass(frozen=True)
class Noise:
    """The builds of the original, and how far they differ."""

    builds: tuple[Build, ...]
    floor: dict[str, float]  # by column, largest distance (ulp) from the build of the plan
    initial: tuple[str, ...]  # findings on initial values of variables

    @property
    def count(self) -> int:
        return sum(each.rows is not None for each in self.builds)


def noise(
    plan: Plan, rows: Sequence[Rows], said: Callable[[int, str], None] = lambda done, what: None
) -> Noise | None:
    """Return the noise of the original, whose rows are known; None if it has no source."""
    program = plan.original
    if program.source is None or program.compiler not in _ROUNDING:
        return None
    kept = tuple(x for x in program.flags if not re.match("-(O|m|funsafe)", x))
    others = [x for x in _OTHERS[program.compiler] if shutil.which(x)]
    builds = [
        _build(plan, replace(program, flags=(*kept, *flags.split())), flags, said)
        for flags in _ROUNDING[program.compiler]
    ]
    builds += [_build(plan, replace(program, compiler=x, flags=("-O2",)), x, said) for x in others]
    floor = dict.fromkeys(plan.outputs.columns, 0.0)
    for each in builds:
        if each.rows is not None:
            far = largest_distance(plan, rows, each.rows)
            floor = {name: max(floor[name], far[name]) for name in floor}
    return Noise(tuple(builds), floor, tuple(_initial(plan, program, said)))


def _build(plan: Plan, program: Program, flags: str, said: Callable[[int, str], None]) -> Build:
    try:
        return Build(flags, answers(plan, program, lambda done, what: said(0, flags)))
    except PortError as error:
        return Build(flags, None, str(error))


def _initial(plan: Plan, program: Program, said: Callable[[int, str], None]) -> list[str]:
    kept = tuple(x for x in program.flags if not _OF_STORAGE.match(x))
    builds = [
        _build(plan, replace(program, flags=(*kept, *flags.split())), flags, said)
        for flags in _INITIAL[program.compiler]
    ]
    first, *rest = builds
    found = []
    for each in rest:
        what = each.flags.removeprefix("-O0 ")
        if first.rows is None or (each.rows is None and each.note != first.note):
            if each.rows is not None or first.rows is not None:
                found.append(f"with {what}, it fails: {each.note or first.note}")
        elif each.rows is not None and not are_same(first.rows, each.rows):
            found.append(f"with {what}, its results differ from those with variables set to 0")
    return [*found, *_find_warnings(program, kept)] if found else []


def _find_warnings(program: Program, kept: Sequence[str]) -> list[str]:
    """Return the variables that the compiler reports as used before they are set."""
    lines: list[str] = []
    flags = (*kept, "-O2", "-Wall", "-Wuninitialized", "-Wmaybe-uninitialized")
    with TemporaryDirectory() as place:
        compile_source(replace(program, flags=flags), Path(place), lines)
    found, line = [], "?"
    for each in lines:
        line = at[1] if (at := _AT.search(each)) else line
        if name := _WARNED.search(each):
            found.append(f"{name[1].upper()} is used before it is set (line {line})")
    return list(dict.fromkeys(found))
