"""The verb `verify`."""

import argparse
from pathlib import Path
from typing import Any

from pyharness.checks.check import (
    DRAWS,
    RECORD,
    Check,
    Selection,
    may_hold,
    requested_suites,
    without_check,
)
from pyharness.checks.kinds import KINDS, verify
from pyharness.checks.random_methods import ROUNDING
from pyharness.checks.report import checks_report, references, samples, summary
from pyharness.checks.scenes.random_scenes import MODERATE
from pyharness.cli import options as shared
from pyharness.model.errors import InputError
from pyharness.thesis.decks import compiler

FORMATS = ("table", "json", "junit", "markdown")
FORMATS_WITH = {"listing_output": ("table", "json")}
# Options that apply to only one kind of checks, by kind.
_OF_ONE_KIND = {"random": ("seed", "draws"), "golden": ("record",)}
_OF_THE_CHECKS = ("only", "seed", "draws", "external", "self_test", "update", "record", "also")
_ABOUT = {
    "cells": "Fortran against Python",
    "words": "other arithmetics",
    "decks": "compiled cards",
    "schemes": "single steps",
    "stops": "stop test",
    "methods": "errors of omega",
    "prepared": "solvers for many calls",
    "attitudes": "errors of attitudes",
    "orders": "orders of convergence",
    "random": "programs and methods in random scenes",
    "external": "published results",
    "golden": "stored trajectories",
}
OPTIONS = {
    "--only ID,...": "Only checks of these kinds, or whose ids begin with ID, as in "
    "cells/two-term. Kinds: "
    f"{', '.join(f'{kind} ({_ABOUT[kind]})' for kind in KINDS)}.",
    "--seed S": "Seed of random scenes, any text (default: this week, as 2026-W47).",
    "--draws N": f"Number of random scenes (default {DRAWS}; with --port, 0; with --integrator, "
    "2 of each kind).",
    "--external FILE": "Check our methods against published results (format: "
    "docs/how-to/external.md).",
    "--listing-output FILE": "Identify a computer's arithmetic from a page that a thesis program "
    "printed there.",
    "--port COMMAND": "Check bit for bit the port that COMMAND starts (docs/how-to/ports.md).",
    "--integrator COMMAND": "Check the integrator that COMMAND starts "
    "(docs/how-to/integrators.md).",
    "--order P": "With --integrator, lowest order of convergence that passes (default 1).",
    "--program P": "Only this program: two-term, four-term, runge-kutta (not with --integrator).",
    "--case N": "Only this case of the thesis, 1 to 7 (not with --integrator).",
    "--cell NAME,...": "With --port, only these runs (as two-term/case-3, random/7); with "
    f"--integrator, scenes (as wave-1) or kinds ({', '.join(MODERATE)}).",
    "--self-test": "Plant known faults, and report which are detected (also with --port or "
    "--integrator).",
    "--update": "Recompute and write the stored trajectories (golden), and report changes.",
    "--record DIR": "Folder of the stored trajectories (default: tests/golden in the checkout).",
    **shared.outputs(FORMATS, plot="the errors of --integrator"),
    **shared.ALSO,
}
GROUPS = {
    "our programs and methods": "only update record",
    "your program": "port integrator order",
    "your data": "external listing-output",
    "selection for --port, --integrator and --listing-output": "program case cell",
    "random scenes and planted faults": "seed draws self-test",
}
EXAMPLE = "verify --only cells,methods"


def run(options: argparse.Namespace) -> int:
    """Check programs and methods against each other and the true solution; return 1 on failure."""
    if options.listing_output is not None:
        return _listing_output(options)
    if options.integrator is not None:
        from pyharness.cli.command_checks import check_integrator

        return check_integrator(options)
    shared.refuse(options, "our own checks; give --integrator", ("order", "plot"))
    if options.port is not None:
        from pyharness.cli.command_checks import check_port

        return check_port(options, *_programs_and_cases(options))
    shared.refuse(options, "our own checks; give --listing-output or --port", ("program", "case"))
    shared.refuse(options, "our own checks; give --port or --integrator", ("cell",))
    chosen = _selection(options)
    shared.check_outputs(options)
    if options.update:
        refused = ("self_test", "only", "seed", "draws", "external", "format", "out", "also")
        shared.refuse(options, "--update", refused)
        return _update(chosen.record)
    if options.self_test:
        shared.refuse(options, "--self-test", ("only", "draws", "external"))
        return _self_test(options, chosen)
    checks = []
    kinds = requested_suites(KINDS, chosen.only)
    for check in verify(chosen):
        checks.append(check)
        shared.progress(kinds.index(check.suite), len(kinds), check.id)
    missing = without_check(chosen.only, checks)
    if missing or not checks:
        if kinds == ["random"] and not chosen.draws:
            raise InputError("--draws 0 leaves no random scene to check; allowed: 1 or more")
        asked = missing[:1] or chosen.only
        if may_hold("decks", asked) and compiler() is None:
            raise InputError(
                "the check needs gfortran to compile decks; install it, or put it on the PATH"
            )
        if not chosen.record.is_dir() and may_hold("golden", asked):
            raise InputError(
                "there are no stored trajectories (golden) here; give --record DIR, or run in a "
                "source checkout"
            )
        raise InputError(
            f"--only {','.join(asked)}: there is no such check; allowed: {', '.join(KINDS)}"
        )
    drawn = samples(checks, ROUNDING) if options.draws is not None else []
    more = [*drawn, *references(checks)]
    text = summary([*_title(chosen), *_unjudged(chosen, checks)], checks, more=more)
    report = checks_report("verify", checks, text, seed=chosen.seed)
    return shared.show(report, options, failed=not all(check.passed for check in checks))


def _listing_output(options: argparse.Namespace) -> int:
    from pyharness.history.listing_output import fits, listing_output_report, read_page

    shared.refuse(options, "--listing-output", (*_OF_THE_CHECKS, "port", "integrator", "cell"))
    programs, cases = _programs_and_cases(options)
    shared.check_outputs(options)
    lines = read_page(options.listing_output)
    found = fits(lines, programs, cases, shared.progress)
    report = listing_output_report(options.listing_output, found)
    return shared.show(report, options, failed=not found[0].is_whole)


def _programs_and_cases(options: argparse.Namespace) -> tuple[tuple[str, ...], list[int]]:
    cases = shared.chosen_cases(options)
    return shared.chosen_programs(options), cases


def _self_test(options: argparse.Namespace, chosen: Selection) -> int:
    from pyharness.checks.plants.plants import PLANTS, self_test
    from pyharness.cli.command_checks import show_self_test

    outcomes = self_test(chosen.seed, chosen.record)
    again = "python -m pyharness verify --self-test"
    return show_self_test(options, outcomes, len(PLANTS), _title(chosen), again, seed=chosen.seed)


def _selection(options: argparse.Namespace) -> Selection:
    only = shared.names(options.only)
    problems = None
    if options.external is not None:
        from pyharness.checks.external_file import read_problem

        shared.refuse(options, "--external", ("seed", "draws", "record"))
        if any(each.partition("/")[0] != "external" for each in only):
            raise InputError(
                f"--only {options.only}: allowed with --external: names that begin with external/"
            )
        problems = [read_problem(options.external)]
        only = only or ["external"]
    shared.chosen_names(options.only, "kind", tuple(KINDS))
    for kind, names in _OF_ONE_KIND.items():
        if only and not any(each.partition("/")[0] == kind for each in only):
            shared.refuse(options, f"--only {options.only}", names)
    draws = shared.chosen_count(options.draws, "--draws", DRAWS, 0, shared.CHECKS)
    seed = shared.chosen_seed(options)
    changes: dict[str, Any] = {} if seed is None else {"seed": seed}
    record = RECORD if options.record is None else Path(options.record)
    if options.record is not None and not options.update and not record.is_dir():
        raise InputError(
            f"--record '{options.record}': is not a folder; verify --update writes one"
        )
    return Selection(only=only, draws=draws, record=record, problems=problems, **changes)


def _title(chosen: Selection) -> list[str]:
    title = [f"seed of the random draws: {chosen.seed}"] if chosen.may_ask("random") else []
    if chosen.may_ask("golden") and not chosen.record.is_dir():
        title.append("golden: not run, as no stored trajectories are here (see --record)")
    return title


def _unjudged(chosen: Selection, checks: list[Check]) -> list[str]:
    """Return a line on checks that were not made or have no verdict, or []."""
    if chosen.may_ask("decks") and compiler() is None:
        return ["decks: not run, as there is no gfortran on the PATH"]
    count = sum(check.passed and check.value is None for check in checks)
    if chosen.problems is None or not count:
        return []
    return [
        f"{count} of {len(checks)} checks have no verdict, because the method can't solve the "
        "problem (--format json has the reason)"
    ]


def _update(record: Path) -> int:
    from pyharness.checks.golden import files_made, update
    from pyharness.cli.output import check_replaceable, write_tree

    if not record.parent.is_dir():
        raise InputError(
            "there are no stored trajectories (golden) here to update; give --record DIR"
        )
    check_replaceable(str(record), files_made, "--record")
    files, news = update(record)
    write_tree(str(record), files, "--record")
    lines = news or ["nothing moved"]
    shared.emit("".join(f"{line}\n" for line in [*lines, f"{len(files)} files in {record}"]), None)
    return 0
