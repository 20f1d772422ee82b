"""The checks of `verify --port`: selection, report and self-test."""

import argparse
from collections.abc import Sequence

from pyharness.checks.integrators.protocol import refuse_integrator
from pyharness.checks.port import Cell, port, port_cells, random_cells
from pyharness.checks.port_report import port_report
from pyharness.checks.selection import Selection
from pyharness.cli import options as shared
from pyharness.cli.forecast import CHECKS, check_count
from pyharness.model.errors import InputError

_REFUSED = ("only", "external", "update", "record")


def check_port(options: argparse.Namespace, programs: Sequence[str], cases: Sequence[int]) -> int:
    """Compare a port, started by `options.port`; return 0 if all checks pass, else 1."""
    shared.refuse(options, "--port", _REFUSED)
    cells, seed = requested_cells(
        shared.names(options.cell), programs, cases, options.draws, shared.chosen_seed(options)
    )
    shared.check_outputs(options)
    if options.self_test:
        return _self_test(options, cells)
    checks = []
    for check in port(options.port, cells):
        checks.append(check)
        shared.progress(len(checks), len(cells), check.id)
    if checks[0].value is None:
        refuse_integrator(options.port)
    shared.show(port_report(options.port, checks, len(cells), seed), options)
    return 0 if all(check.passed for check in checks) else 1


def requested_cells(
    names: Sequence[str],
    programs: Sequence[str],
    cases: Sequence[int],
    draws: str | None,
    seed: str | None,
) -> tuple[list[Cell], str]:
    """Return the runs, those of Table 1 first, and the seed of random scenes.

    `names` are beginnings such as ``two-term/case-3`` or ``random/7``, empty for all; `draws` is
    the number of random scenes as text. The seed is by default the present year and week, and empty
    without draws.
    """
    count = 0 if draws is None else shared.whole(draws, "--draws")
    check_count("--draws", count, 0, CHECKS)
    used = Selection().seed if seed is None else seed
    drawn = random_cells(used, count, names, programs)
    if seed is not None and not drawn:
        raise InputError("--seed has no meaning without random scenes; give --draws N")
    found = [*port_cells(programs, cases, names), *drawn]
    if not found:
        raise InputError(
            f"--cell {','.join(names)}: there is no such cell; give one as in two-term/case-3"
        )
    return found, used if drawn else ""


def _self_test(options: argparse.Namespace, cells: Sequence[Cell]) -> int:
    from pyharness.checks.plants.port_plants import PLANTS
    from pyharness.checks.plants.port_self_test import as_check, report, self_test

    found = []
    for caught in self_test(options.port, cells):
        found.append(caught)
        shared.progress(len(found), len(PLANTS) + 1, as_check(caught).id)
    if not found[0].passed:
        refuse_integrator(options.port)
    shared.show(report(options.port, found), options)
    return 0 if all(caught.passed for caught in found) else 1
