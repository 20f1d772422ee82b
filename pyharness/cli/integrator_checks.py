"""The checks of `verify --integrator`: selection, report and self-test."""

import argparse
import re

from pyharness.checks.integrators.judging import judge_integrator, replay_command
from pyharness.checks.integrators.problem import DRAWS, Problem, problems
from pyharness.checks.port import refuse_port
from pyharness.checks.scenes.moderate import KINDS
from pyharness.checks.selection import Selection
from pyharness.cli import options as shared
from pyharness.cli.forecast import Cost, check_count
from pyharness.model.errors import InputError

_REFUSED = ("only", "external", "update", "record", "port", "program", "case")
_SCENES = Cost("random scenes of each kind", 1.0, 1e5, 1000)
_HIGHEST = 40.0


def check_integrator(options: argparse.Namespace) -> int:
    """Compare an integrator with true solutions; return 0 if all checks pass, else 1.

    `options.integrator` starts it.
    """
    shared.refuse(options, "--integrator", _REFUSED)
    command = options.integrator
    due = shared.positive(options.order, "--order", 1.0)
    if due > _HIGHEST:
        raise InputError(f"--order: {due:g}; allowed: a number above 0, at most {_HIGHEST:g}")
    draws = DRAWS if options.draws is None else shared.whole(options.draws, "--draws")
    check_count("--draws", draws, 1, _SCENES)
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
        return _self_test(options, chosen, due, again("") + " --self-test")
    total = len(chosen) + 1
    found = judge_integrator(
        command, chosen, again, due, lambda done, what: shared.progress(done, total, what)
    )
    if not found.judged:
        refuse_port(command)
    from pyharness.checks.integrators.report import integrator_report

    shared.show(integrator_report(found, seed), options)
    return 0 if all(check.passed for check in found.checks) else 1


def _check_names(names: list[str]) -> None:
    form = re.compile(rf"({'|'.join(KINDS)})(-[0-9]{{1,4}})?")
    for each in names:
        if not form.fullmatch(each):
            raise InputError(
                f"--cell '{each}': there is no such scene; allowed: {', '.join(KINDS)}, or one of "
                "their scenes, as in wave-1"
            )


def _self_test(options: argparse.Namespace, chosen: list[Problem], due: float, again: str) -> int:
    from pyharness.checks.integrators.plants import (
        PLANTS,
        as_check,
        self_test,
        self_test_report,
    )

    found = []
    for each in self_test(options.integrator, chosen, due):
        found.append(each)
        shared.progress(len(found), len(PLANTS) + 1, as_check(each).id)
    if found[0].note:
        refuse_port(options.integrator)
    shared.show(self_test_report(options.integrator, found, again), options)
    return 0 if all(each.passed for each in found) else 1
