"""Checks of a port, an implementation of the programs in any language, against the twins.

The results must agree with those of the Python twins bit for bit, in all combinations of program,
case and listing. `docs/how-to/ports.md` describes the protocol.
"""

import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pyharness.checks.cells import of_cell
from pyharness.checks.check import Check, Name, selected
from pyharness.checks.port_process import PATIENCE, PortError, PortProcess
from pyharness.checks.port_protocol import VARIABLES, Answer, read_answer, request
from pyharness.compare.agreement import ulps
from pyharness.model.listing import Listing
from pyharness.model.report import counted
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.original.cells import all_cells, cell_name
from pyharness.original.programs import PROGRAM_REGISTRY

Cell = tuple[str, Listing, int]


def port_cells(programs: Sequence[str], cases: Sequence[int], cells: Sequence[str]) -> list[Cell]:
    """Return name, listing and case number of the requested cells.

    A cell is a listing with a case of Table 1 of the thesis. A listing is a program with a choice
    of its defects, and of its readings of doubtful cards. `cells` has the leading parts of names of
    cells, as in ``two-term/case-3``. If it is empty, all cells of the programs and cases are
    requested.
    """
    return [
        (cell_name(listing, case), listing, case)
        for listing, case in all_cells()
        if listing.program in programs
        and case in cases
        and selected(cell_name(listing, case), cells)
    ]


def port(command: str, cells: Sequence[Cell], patience: float = PATIENCE) -> Iterator[Check]:
    """Yield checks that a port gives the same bits as our Python programs in the given cells.

    A port is an implementation of the programs of the thesis in any language, started by `command`.
    A cell is a program, a choice of its defects, and a case. An invalid answer is a failed check
    and ends the comparison. `patience` is the longest time to wait for an answer (s). Raise
    InputError if `command` is empty.
    """
    verb = f"python -m pyharness verify --port {shlex.quote(command)}"
    name, again = Name("port", "start"), verb
    try:
        with PortProcess(command, patience) as process:
            for cell, listing, case in cells:
                name, again = of_cell("port", listing, case), f"{verb} --cell {cell}"
                yield replace(_compared(name, process, listing, case_scene(case)), again=again)
    except PortError as error:
        yield replace(name.judged(False, str(error)), again=again)


def _compared(name: Name, process: PortProcess, listing: Listing, scene: Scene) -> Check:
    answer = read_answer(process.ask(request(scene, listing)), scene.steps)
    twin = PROGRAM_REGISTRY[listing.program].run(scene, listing, "python")
    note = "; ".join(differences(twin, answer))
    wanted = _rows(twin)
    same = len(wanted) == len(answer.rows)
    apart = ulps(wanted, answer.rows) if same else math.inf
    return name.judged(not note, note, apart, 0.0)


def differences(twin: Trajectory, answer: Answer) -> list[str]:
    """Return texts that describe how a port's answer differs from the run of our Python program.

    A port is an implementation of a program in any language, and `twin` is the run of our Python
    version. The texts report the first row that differs, the number of rows, and how the run ended.
    They also report where the Runge-Kutta program's stop test ended it, and the first error code
    IER that differs. The list is empty if nothing differs.
    """
    wanted, given = _rows(twin), answer.rows
    found = []
    for step, (due, row) in enumerate(zip(wanted, given, strict=False), 1):
        apart = [ulps(due[i : i + 1], row[i : i + 1]) for i in range(len(VARIABLES))]
        if any(apart):
            first = next(i for i, distance in enumerate(apart) if distance)
            found.append(
                f"first at step {step}, {VARIABLES[first]}: {apart[first]:.0f} ulp "
                f"({float(row[first]).hex()}, due {float(due[first]).hex()})"
            )
            break
    for name, value, wants in (
        ("rows", len(given), len(wanted)),
        ("ended", answer.ended, twin.ended),
        ("stop", answer.stop, twin.stop),
    ):
        if value != wants:
            found.append(f"{name}: {value}, due {wants}")
    found += _of_ier(None if twin.ier is None else twin.ier.tolist(), answer.ier)
    return found


def _of_ier(wanted: list[int] | None, given: list[int] | None) -> list[str]:
    if wanted is None or given is None:
        due = "null" if wanted is None else counted(len(wanted), "value")
        return [] if wanted is given else [f"ier: due {due}"]
    pairs = enumerate(zip(wanted, given, strict=False), 1)
    wrong = [
        f"IER at step {step}: {value}, due {due}" for step, (due, value) in pairs if due != value
    ]
    return wrong[:1]


def _rows(twin: Trajectory) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    assert twin.velocity is not None
    return np.column_stack([twin.recorded_time, twin.omega, twin.velocity])
