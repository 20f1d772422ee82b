"""The verb `words`."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.words import LENGTHS, cells, machine_cells, machine_report, words_report
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS
from pyharness.model.report import Column, Report, Table
from pyharness.model.report import words as columns
from pyharness.thesis.vectors import answers

FORMATS = ("table", "json", "csv", "markdown")
OPTIONS = {
    "--case N": "Run only this case of the thesis, 1 to 7 (default: all).",
    "--program P": f"Run only this program: {', '.join(PROGRAMS)} (default: all three).",
    "--lengths": f"Show each run in selected precisions from {LENGTHS[0]} to {LENGTHS[-1]} bits; "
    "takes about two minutes (implied by --plot and by formats other than table; default: show "
    "only whether CDC arithmetic changes results).",
    "--all": f"Show each run in every precision from {LENGTHS[0]} to {LENGTHS[-1]} bits; takes "
    "about twelve minutes.",
    "--vectors FILE": "Check our CDC arithmetic against the results in this file (format: "
    "docs/explanation/words.md).",
    **shared.outputs(FORMATS, plot="the error in one --case as a function of the precision"),
}
EXAMPLE = "words --case 2 --program runge-kutta"


def run(options: argparse.Namespace) -> int:
    """Print the programs' errors in CDC arithmetic or other precisions.

    With --vectors, check CDC arithmetic; return 1 for a wrong result.
    """
    if options.vectors is not None:
        shared.refuse(options, "--vectors", ("case", "program", "lengths", "all", "plot"))
        return _vectors(options)
    cases = shared.chosen_cases(options)
    if options.plot is not None and options.case is None:
        raise InputError("words: --plot draws one case; give --case N (1 to 7)")
    programs = shared.chosen_programs(options)
    shared.check_outputs(options)
    is_table = (options.format or FORMATS[0]) == FORMATS[0]
    if is_table and not (options.lengths or options.all or options.plot):
        verdict = machine_report(machine_cells(cases, programs, shared.progress))
        return shared.show(verdict, options)
    lengths = range(LENGTHS[0], LENGTHS[-1] + 1) if options.all else LENGTHS
    found = list(cells(cases, programs, lengths, shared.progress))
    return shared.show(words_report(found), options)


def _vectors(options: argparse.Namespace) -> int:
    shared.check_outputs(options)
    found = answers(options.vectors)
    told = [f"{sum(each.agrees for each in found)} of {len(found)} vectors agree"]
    first = next((each for each in found if not each.agrees), None)
    if first is not None:
        vector = first.vector
        told.append(f"the first that differs: {vector.name} ({vector.op})")
        told += [f"{name:6s} {getattr(vector, name)}" for name in ("x", "y", "result")]
        told.append(f"ours   {first.found}")
    rows = [[*each.vector, each.found, each.agrees] for each in found]
    heads = [*columns("name op x y result found"), Column("agrees")]
    record = [{**each.vector._asdict(), "found": each.found} for each in found]
    whole = {"vectors": record, "passed": first is None}
    report = Report("words", [told], lambda: whole, Table(heads, rows))
    return shared.show(report, options, failed=first is not None)
