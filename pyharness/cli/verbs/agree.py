"""The verb `agree`."""

import argparse
import shlex
from collections.abc import Callable
from time import perf_counter

from pyharness.checks.agree.plan import Plan, read_plan
from pyharness.checks.agree.programs import answers
from pyharness.checks.agree.reading import Rows
from pyharness.checks.port_process import PortError
from pyharness.cli import options as shared
from pyharness.model.errors import InputError
from pyharness.model.report import Report, counted

FORMATS = ("table", "json", "markdown", "html", "junit")
OPTIONS = {
    "file FILE": "TOML file with the programs, inputs, outputs and limits "
    "(docs/tutorials/own-fortran.md).",
    "--noise": "Build the original's source with other flags and initial values of variables, and "
    "report how far it differs from itself.",
    "--self-test": "Plant faults in the results, and in a port's Python source, and report which "
    "are found.",
    "--update REASON": "Run the original, and write its results and REASON to the record that the "
    "file names.",
    "--new COMMAND": "Run COMMAND, and write a first TOML file.",
    **shared.outputs(FORMATS, plot="the growth of the distances"),
    **shared.ALSO,
}
USAGE = "FILE\n--new COMMAND"
EXAMPLE = "agree pendulum.toml --noise"


def run(options: argparse.Namespace) -> int:
    """Compare programs on the same inputs; return 1 if a port differs by more than its limits."""
    if options.new is not None:
        return _new(options)
    if options.file is None:
        raise InputError("agree: give a TOML file, or --new COMMAND, which writes one")
    plan = read_plan(options.file)
    shared.check_outputs(options)
    if options.update is not None:
        return _update(options, plan)
    if not plan.ports:
        raise InputError(f"'{options.file}': one program only; give a port as [programs.port]")
    original, title = _original(plan)
    again = f"python -m pyharness agree {shlex.quote(options.file)}"
    if options.self_test:
        return _self_test(options, plan, original, f"{again} --self-test")
    from pyharness.checks.agree.comparing import compare
    from pyharness.checks.agree.noise import noise
    from pyharness.checks.agree.report import Compared, agreement_report

    found = []
    for port in plan.ports:
        begin, agreement, failure = perf_counter(), None, ""
        try:
            agreement = compare(plan, original, _run(plan, port))
        except PortError as error:
            failure = str(error)
        found.append(Compared(port.name, agreement, failure, perf_counter() - begin))
    floor = None
    if options.noise:
        if plan.original.source is None:
            raise InputError(f"'{options.file}': --noise needs the original's source; give source")
        floor = noise(plan, original, lambda done, what: shared.progress(0, 1, what))
    report = agreement_report(plan, found, floor, again, title)
    return _show(report, options, any(x.agreement is None or not x.agreement.passed for x in found))


def _run(plan: Plan, program: object) -> list[Rows]:
    total = len(plan.runs)
    said: Callable[[int, str], None] = lambda done, what: shared.progress(done, total, what)  # noqa: E731
    return answers(plan, program, said)  # type: ignore[arg-type]


def _original(plan: Plan) -> tuple[list[Rows], list[str]]:
    from pyharness.checks.agree.comparing import refuse_idle_limits
    from pyharness.checks.agree.record import is_recorded, read_record

    name = plan.original.name
    if is_recorded(plan):
        rows, how = read_record(plan), f"recorded in {plan.record}"
    else:
        rows, how = _run_original(plan), "run"
    refuse_idle_limits(plan, rows)
    runs, count = counted(len(plan.runs), "run"), sum(map(len, rows))
    return rows, [f"{plan.path}: {name} ({how}) in {runs}, {counted(count, 'row')}"]


def _run_original(plan: Plan) -> list[Rows]:
    try:
        return _run(plan, plan.original)
    except PortError as error:
        raise InputError(f"'{plan.path}': {plan.original.name}: {error}") from None


def _show(report: Report, options: argparse.Namespace, failed: object) -> int:
    def page() -> str:
        from html import escape

        from pyharness.views.render import render

        head = f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>{escape(report.title)}'
        return f"{head}</title>\n{render(report, 'html')}\n</html>\n"

    return shared.show(report, options, {"html": page}, failed)


def _self_test(options: argparse.Namespace, plan: Plan, original: list[Rows], again: str) -> int:
    from pyharness.checks.agree.plants import self_test
    from pyharness.checks.plants.outcome import self_test_report

    shared.refuse(options, "--self-test", ("noise", "plot"))
    outcomes = list(self_test(plan, original, plan.ports[0]))
    shared.end_progress()
    title = [f"{options.file}: faults planted in {plan.ports[0].name}"]
    report = self_test_report(title, outcomes, again)._replace(title="agree")
    return _show(report, options, not all(each.passed for each in outcomes))


def _update(options: argparse.Namespace, plan: Plan) -> int:
    from pyharness.checks.agree.record import update_record

    shared.refuse(options, "--update", ("noise", "self_test", "plot", "format", "also"))
    if plan.record is None:
        raise InputError(f"'{options.file}': no record is named; give record = 'NAME.json'")
    if not options.update.strip():
        raise InputError("--update: give the reason of the change, as in --update 'first record'")
    lines = update_record(plan, _run_original(plan), options.update.strip())
    shared.end_progress()
    shared.emit("".join(f"{line}\n" for line in lines), options.out)
    return 0


def _new(options: argparse.Namespace) -> int:
    from pyharness.checks.agree.first_file import first_file
    from pyharness.checks.port_process import split_command

    refused = ("file", "noise", "self_test", "update", "plot", "format", "also")
    shared.refuse(options, "--new", refused)
    shared.check_outputs(options)
    shared.emit(first_file(split_command(options.new, "--new")), options.out)
    return 0
