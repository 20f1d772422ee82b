"""The verb `deck`."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS
from pyharness.model.records import listing_record
from pyharness.model.report import Line, Report
from pyharness.model.scene_file import case_scene
from pyharness.thesis.decks import DIALECTS, SYSTEMS, deck_text, job_text, with_solver

FORMATS = ("table", "json")
OPTIONS = {
    "--program P": f"Write the deck of this program: {', '.join(PROGRAMS)}.",
    "--case N": "Put the data of this case of the thesis, 1 to 7, on the cards (default, as "
    "published: 5 for runge-kutta, otherwise 2).",
    **{each: shared.LISTING[each] for each in list(shared.LISTING)[:5]},
    "--dialect D": "Form of the deck: 1982 (default; as printed), gfortran (for GNU Fortran) or "
    "ftn (batch job for CDC computers).",
    "--system S": f"With --dialect ftn, operating system: {' or '.join(SYSTEMS)} (default nos).",
    "--round": "With --dialect ftn, round results to nearest (default: truncate).",
    "--terms N": "With --program four-term, write our conjecture of the unprinted deck for N "
    "terms, 3 or 5.",
    **shared.outputs(FORMATS, plot=""),
}
USAGE = "--program P"
EXAMPLE = "deck --program runge-kutta --dialect gfortran --out runge-kutta.f"


def run(options: argparse.Namespace) -> int:
    if options.program is None:
        raise InputError("give --program two-term, four-term or runge-kutta")
    listing = shared.chosen_listing(options)
    case = shared.chosen_case(options)
    scene = None if case is None else case_scene(case)
    dialect = options.dialect or DIALECTS[0]
    if dialect == "1982" and (case == 7 or listing.has("do-variable")):
        shared.warn(
            "no card has the torque of Case 7 or the value of a DO variable after its loop; "
            "--dialect gfortran supplies both, --dialect ftn the torque"
        )
    terms = None if options.terms is None else shared.whole(options.terms, "--terms")
    text = deck_text(listing, scene, dialect, terms)
    if dialect == "ftn":
        text = job_text(text, options.system or SYSTEMS[0], options.round)
    else:
        shared.refuse(options, f"--dialect {dialect}; allowed: with ftn", ("system", "round"))
    if dialect == "gfortran":
        text = with_solver(text)
    lines = text.splitlines()
    shared.check_outputs(options)
    record = {
        "program": listing.program, "case": case, "dialect": dialect,
        "terms": terms, "listing": listing_record(listing), "lines": lines,
    }  # fmt: skip
    report = Report("deck", [[Line(each) for each in lines]], record=lambda: {"deck": record})
    return shared.show(report, options)
