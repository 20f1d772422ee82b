"""The checks of `verify --port` and `verify --integrator`, and reports of self-tests."""

import argparse
import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from functools import partial
from typing import Any

from pyharness.checks.check import Selection, selected
from pyharness.checks.integrators.coverage import Tried, with_coverage
from pyharness.checks.integrators.judging import judge_integrator, replay_command
from pyharness.checks.integrators.problem import DRAWS, Problem, problems
from pyharness.checks.integrators.protocol import refuse_integrator
from pyharness.checks.plants.outcome import Outcome, self_test_report
from pyharness.checks.port import Cell, port, port_cells, port_report, random_cells, refuse_port
from pyharness.checks.scenes.random_scenes import MODERATE as KINDS
from pyharness.cli import options as shared
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Report
from pyharness.model.scene_file import case_numbers

_OF_THE_CHECKS = ("only", "external", "update", "record")
_SCENES = shared.Cost("random scenes of each kind", 1.0, 1e5, 1000)
_HIGHEST = 40.0


def check_port(options: argparse.Namespace, programs: Sequence[str], cases: Sequence[int]) -> int:
    """Check the port that `options.port` starts; return 1 if a check fails, else 0."""
    shared.refuse(options, "--port", _OF_THE_CHECKS)
    names, seed = shared.names(options.cell), shared.chosen_seed(options)
    count = shared.chosen_count(options.draws, "--draws", 0, 0, shared.CHECKS)
    used = Selection().seed if seed is None else seed
    drawn = random_cells(used, count, names, programs)
    if seed is not None and not drawn:
        raise InputError("--seed has no meaning without random scenes; give --draws N")
    cells = [*port_cells(programs, cases, names), *drawn]
    for name in names:
        if not any(selected(cell.name, [name]) for cell in cells):
            raise _no_such_cell(name)
    if count and names and not any(map(_is_random, names)):
        raise InputError("--draws has no meaning with these cells; add random to --cell")
    shared.check_outputs(options)
    if options.self_test:
        return _port_self_test(options, cells)
    checks = []
    for check in port(options.port, cells):
        checks.append(check)
        shared.progress(len(checks), len(cells), check.id)
    if checks[0].value is None:
        refuse_integrator(options.port)
    report = port_report(options.port, checks, len(cells), used if drawn else "")
    return shared.show(report, options, failed=not all(check.passed for check in checks))


def _is_random(cell: str) -> bool:
    return cell.partition("/")[0] == "random"


def _no_such_cell(name: str) -> InputError:
    if _is_random(name):
        return InputError(
            f"--cell {name}: no random scene is in it; give --draws N, or leave out --program"
        )
    cells = [cell.name for cell in port_cells(PROGRAMS, case_numbers(), [])]
    if any(selected(cell, [name]) for cell in cells):
        return InputError(f"--cell {name}: excluded by --program or --case; leave them out")
    near = get_close_matches(name, cells, n=1, cutoff=0.7)
    hint = f"did you mean '{near[0]}'? " if near else ""
    return InputError(
        f"--cell {name}: there is no such cell; {hint}allowed: cells as in two-term/case-3"
    )


def _port_self_test(options: argparse.Namespace, cells: Sequence[Cell]) -> int:
    from pyharness.checks.plants.port_plants import PLANTS, self_test

    command = options.port
    title = [f"{command}: faults planted in its answers"]
    again = f"python -m pyharness verify --port {shlex.quote(command)} --self-test"
    outcomes, refuse = self_test(command, cells), partial(refuse_integrator, command)
    return show_self_test(options, outcomes, len(PLANTS), title, again, refuse, port=command)


def check_integrator(options: argparse.Namespace) -> int:
    """Check the integrator of `options.integrator`; return 1 if a check fails, else 0."""
    shared.refuse(options, "--integrator", (*_OF_THE_CHECKS, "port", "program", "case"))
    command = options.integrator
    due = shared.positive(options.order, "--order", 1.0)
    if due > _HIGHEST:
        raise InputError(f"--order: {due:g}; allowed: a number above 0, at most {_HIGHEST:g}")
    draws = shared.chosen_count(options.draws, "--draws", DRAWS, 1, _SCENES)
    given = shared.chosen_seed(options)
    seed = Selection().seed if given is None else given
    names = shared.names(options.cell)
    _check_names(names)
    numbers = [int(each.rpartition("-")[2]) + 1 for each in names if "-" in each]
    chosen = problems(seed, max([draws, *numbers]), names)
    shared.check_outputs(options)
    order = "" if options.order is None else f" --order {due:g}"

    def again(name: str) -> str:
        return replay_command(command, seed, draws, name) + order

    if options.self_test:
        shared.refuse(options, "--self-test", ("plot",))
        return _integrator_self_test(options, chosen, due, f"{again('')} --self-test")
    total = len(chosen) + 1
    found = judge_integrator(
        command, chosen, again, due, lambda done, what: shared.progress(done, total, what)
    )
    if not found.judged:
        refuse_port(command)
    from pyharness.checks.integrators.report import integrator_report

    failed = not all(check.passed for check in found.checks)
    return shared.show(integrator_report(found, seed), options, failed=failed)


def _check_names(names: list[str]) -> None:
    form = re.compile(rf"({'|'.join(KINDS)})(-[0-9]{{1,4}})?")
    for each in names:
        if not form.fullmatch(each):
            raise InputError(
                f"--cell '{each}': there is no such scene; allowed: {', '.join(KINDS)}, or one of "
                "their scenes, as in wave-1"
            )


def _integrator_self_test(
    options: argparse.Namespace, chosen: list[Problem], due: float, again: str
) -> int:
    from pyharness.checks.integrators.plants import PLANTS, self_test

    command = options.integrator
    title = [f"{command}: faults planted in its requests and answers"]
    tried: list[Tried] = []
    outcomes, refuse = self_test(command, chosen, tried, due), partial(refuse_port, command)
    return show_self_test(
        options, outcomes, len(PLANTS), title, again, refuse,
        lambda report: with_coverage(report, tried), integrator=command,
    )  # fmt: skip


def show_self_test(
    options: argparse.Namespace,
    outcomes: Iterable[Outcome],  # the first is the control, a run without a fault
    count: int,  # number of planted faults
    title: Sequence[str],
    again: str,
    refuse: Callable[[], None] = lambda: None,
    completed: Callable[[Report], Report] = lambda report: report,
    **extra: Any,
) -> int:
    """Write the report of a self-test; return 1 if an outcome failed, else 0.

    `refuse` is called if the control failed; `completed` adds to the report.
    """
    found = []
    for each in outcomes:
        found.append(each)
        shared.progress(len(found), count + 1, each.check.id)
    if not found[0].passed:
        refuse()
    report = completed(self_test_report(title, found, again, **extra))
    return shared.show(report, options, failed=not all(each.passed for each in found))
