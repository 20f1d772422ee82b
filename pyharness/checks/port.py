"""Bit-for-bit checks of a port of the programs, in any language, against our Python versions.

The port runs random scenes and all cells (combinations of program, case, defects and readings) by
the protocol in `docs/how-to/ports.md`.
"""

import math
import re
import shlex
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pyharness.checks.cells import of_cell
from pyharness.checks.check import BITS, Check, Name, selected
from pyharness.checks.compare.agreement import ulps
from pyharness.checks.port_process import PATIENCE, PortError, PortProcess, refuse_other
from pyharness.checks.port_protocol import VARIABLES, Answer, read_answer, request
from pyharness.checks.report import checks_report, summary, summary_page
from pyharness.checks.scenes.random_scenes import draw
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.report import Column, Report, Section, Table, counted, digits, words
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.thesis.cells import all_cells, cell_name
from pyharness.thesis.programs import PROGRAM_REGISTRY

_DECK_LIPSCHITZ = 500.0  # 1/s, on the author's cards
_DRAWN = re.compile(r"random/(\d{1,9})(?:/|$)")
_LIBRARY = "the torque has sines or cosines, whose last bits differ between libraries"


@dataclass(frozen=True, eq=False)
class Cell:
    """A run to request from a port."""

    name: str
    of: Name  # name of the check
    options: str  # options of ``verify --port`` that request this run alone
    listing: Listing
    scene: Scene
    lipschitz: float = _DECK_LIPSCHITZ  # constant of the stop test, 1/s
    may_stop: bool = True

    @property
    def request(self) -> bytes:
        return request(self.scene, self.listing, self.lipschitz, self.may_stop)

    def twin(self) -> Trajectory:
        run = PROGRAM_REGISTRY[self.listing.program].run
        return run(self.scene, self.listing, "python", self.lipschitz, self.may_stop)


@dataclass(frozen=True)
class PortCheck(Check):
    """The comparison of a port with the Python version in one run."""

    seconds: float | None = None  # time until the port's answer (s)
    difference: dict[str, Any] | None = None  # values of all variables in the first differing step


def port_cells(programs: Sequence[str], cases: Sequence[int], cells: Sequence[str]) -> list[Cell]:
    """Return runs of `programs` in `cases`; `cells`, if any, are the beginnings of their names."""
    found = []
    for listing, case in all_cells():
        name, of = cell_name(listing, case), of_cell("port", listing, case)
        if listing.program in programs and case in cases and selected(name, cells):
            found.append(Cell(name, of, f"--cell {name}", listing, case_scene(case)))
    return found


def random_cells(
    seed: str, draws: int, cells: Sequence[str] = (), programs: Sequence[str] = PROGRAMS
) -> list[Cell]:
    """Return runs in random scenes by number, named as in ``random/7/two-term``.

    Beginnings of names in `cells`, if any, select runs.
    """
    named = {int(match[1]) for each in cells if (match := _DRAWN.match(each))}
    found = []
    for number in sorted(named.union(range(draws))):
        drawn = draw(seed, number)
        name = f"random/{number}/{drawn.listing.program}"
        if drawn.listing.program in programs and selected(name, cells):
            of = Name("port", "random", str(number), drawn.listing.program, scene=drawn.scene)
            options = f"--cell {name} --seed {shlex.quote(seed)}"
            stop_test = drawn.lipschitz, drawn.may_stop
            found.append(Cell(name, of, options, drawn.listing, drawn.scene, *stop_test))
    return found


def port(command: str, cells: Sequence[Cell], patience: float = PATIENCE) -> Iterator[PortCheck]:
    """Yield checks that a port agrees bit for bit with the Python version.

    The checks end if a valid answer does not come within `patience` (s).
    """
    name, again, begin = Name("port", "start"), replay_command(command), time.perf_counter()
    try:
        with PortProcess(command, patience) as process:
            for cell in cells:
                name, again = cell.of, replay_command(command, cell)
                begin = time.perf_counter()
                line = process.ask(cell.request)
                seconds = time.perf_counter() - begin
                yield compared(cell, cell.twin(), line, again, seconds)
    except PortError as error:
        failed = {"again": again, "took": time.perf_counter() - begin}
        yield PortCheck(**vars(name.judged(False, str(error))) | failed)


def refuse_port(command: str) -> None:
    """Raise an InputError that advises `--port` if `command` starts a port."""
    cell = port_cells(PROGRAMS, (1,), ())[0]
    read = partial(read_answer, steps=cell.scene.steps)
    refuse_other(command, "--integrator", "--port", cell.request, read)


def replay_command(command: str, cell: Cell | None = None) -> str:
    verb = f"python -m pyharness verify --port {shlex.quote(command)}"
    return verb if cell is None else f"{verb} {cell.options}"


def compared(
    cell: Cell, twin: Trajectory, line: bytes, again: str = "", seconds: float | None = None
) -> PortCheck:
    """Return the check that an answer agrees with `twin`; raise PortError if it is invalid."""
    answer = read_answer(line, cell.scene.steps)
    found = differences(twin, answer)
    wanted = _rows(twin)
    difference, law = _difference(wanted, answer.rows), cell.scene.law
    if difference and (law.sines or law.cosines):
        found.append(_LIBRARY)
    same = len(wanted) == len(answer.rows)
    apart = ulps(wanted, answer.rows) if same else math.inf
    check = cell.of.judged(not found, "; ".join(found), apart, 0.0, BITS)
    known = {"again": again, "took": seconds}
    return PortCheck(**vars(check) | known, seconds=seconds, difference=difference)


def differences(twin: Trajectory, answer: Answer) -> list[str]:
    """Return texts on the answer's differences from `twin`, the Python version's run."""
    wanted, given = _rows(twin), answer.rows
    found = []
    if difference := _difference(wanted, given):
        first = next(each for each in difference["values"] if each["ulps"])
        where = f"first at step {difference['step']}, {first['variable']}"
        pair = f"{first['theirs']}, due {first['ours']}"
        found.append(f"{where}: {first['ulps']:.0f} ulp ({pair})")
    seen, due = (len(given), answer.ended, answer.stop), (len(wanted), twin.ended, twin.stop)
    triples = zip(("rows", "ended", "stop"), seen, due, strict=True)
    found += [f"{name}: {value}, due {wants}" for name, value, wants in triples if value != wants]
    found += _of_ier(None if twin.ier is None else twin.ier.tolist(), answer.ier)
    return found


def _difference(wanted: Array, given: Array) -> dict[str, Any] | None:
    for step, (due, row) in enumerate(zip(wanted, given, strict=False), 1):
        if ulps(due, row):
            values = []
            for name, x, y in zip(VARIABLES, due.tolist(), row.tolist(), strict=True):
                # Hexadecimal text, because JSON has no inf and nan.
                pair = {"ours": x.hex(), "theirs": y.hex(), "ulps": ulps(x, y)}
                values.append({"variable": name, **pair})
            return {"step": step, "values": values}
    return None


def _of_ier(wanted: list[int] | None, given: list[int] | None) -> list[str]:
    if wanted is None or given is None:
        due = "null" if wanted is None else counted(len(wanted), "value")
        return [] if wanted is given else [f"ier: due {due}"]
    pairs = enumerate(zip(wanted, given, strict=False), 1)
    wrong = [(step, *pair) for step, pair in pairs if pair[0] != pair[1]]
    return [f"IER at step {step}: {value}, due {due}" for step, due, value in wrong[:1]]


def _rows(twin: Trajectory) -> Array:
    assert twin.velocity is not None
    return np.column_stack([twin.recorded_time, twin.omega, twin.velocity])


_MOST_STEPS = 3  # failed checks shown in full
_UNITS = {"T": "s", "U": "rad/s", "V": "m/s"}
_STEP = (*words("variable unit ours theirs"), Column("ulp"))
_TIMES = (
    *words("runs"), Column("answers"), Column("total (s)", digits(".3f")),
    Column("median (ms)", digits(".3f", 1e3)), Column("longest (ms)", digits(".3f", 1e3)),
)  # fmt: skip


def port_report(command: str, checks: Sequence[PortCheck], asked: int, seed: str) -> Report:
    """Return the report of a port's `checks` (at least one) for `asked` requested runs."""
    title = [f"{command}: against the twins, bit for bit"]
    title += [f"seed of the random scenes: {seed}"] if seed else []
    if checks[-1].value is None:
        title.append(f"ended at the first of {asked} cells that it did not answer")
    seconds = sum(check.seconds or 0.0 for check in checks)
    steps = [step_section(check) for check in checks if check.difference][:_MOST_STEPS]
    text = summary(title, checks, depth=2, more=_times(checks))
    # Insert the tables of steps after the title and the list of failures.
    text[2:2] = steps
    page = summary_page("verify --port", checks, title, depth=2, more=[*steps, _times(checks)])
    known = {"seed": seed} if seed else {}
    return checks_report("verify", checks, text, page, port=command, seconds=seconds, **known)


def step_section(check: PortCheck) -> Section:
    assert check.difference is not None
    rows = []
    for each in check.difference["values"]:
        name, pair = each["variable"], (float.fromhex(each[who]) for who in ("ours", "theirs"))
        rows.append([name, _UNITS[name[0]], *map(repr, pair), f"{each['ulps']:.0f}"])
    return [f"{check.id}, step {check.difference['step']}:", Table(_STEP, rows)]


def _times(checks: Sequence[PortCheck]) -> Section:
    groups: dict[str, list[float]] = {}
    for check in checks:
        if check.seconds is not None:
            groups.setdefault("/".join(check.id.split("/")[:2]), []).append(check.seconds)
    measures = (len, sum, statistics.median, max)
    rows = [[name, *(f(each) for f in measures)] for name, each in groups.items()]
    told = "times from a request to the port's answer; the first one includes the start of the port"
    return [told, Table(_TIMES, rows)] if rows else []
