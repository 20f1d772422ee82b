"""`compare`: original against corrected, Fortran against Python, all against the truth."""

import argparse

from pyharness.cli import options as shared
from pyharness.compare import report as views
from pyharness.compare.comparison import compare_programs, listings_for
from pyharness.methods.registry import METHODS, SCIPY_METHODS
from pyharness.model.errors import InputError, unknown
from pyharness.model.listing import PROGRAMS, names_of
from pyharness.model.scene import Scene


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    shared.add_scene_options(parser)
    shared.add_listing_options(parser)
    parser.add_argument("--program", metavar="P", help="this program only")
    parser.add_argument("--tolerance", metavar="E", help="asked of solve_ivp (default 1e-8)")
    parser.add_argument(
        "--ablate", action="store_true", help="every subset of the defects, sorted by effect"
    )
    shared.add_effort_option(parser)
    shared.add_output_options(parser)


def run(options: argparse.Namespace) -> int:
    """Compare and show; 1 where something is not as it should be."""
    scene = shared.chosen_scene(options)
    if options.program is not None and options.program not in PROGRAMS:
        raise unknown("program", options.program, PROGRAMS, "--program")
    form = shared.chosen_format(options, shared.FORMATS)
    shared.check_base(options)
    tolerance = shared.positive(options.tolerance, "--tolerance", 1e-8)
    finest = max(METHODS[name].finest for name in SCIPY_METHODS)
    if not finest <= tolerance <= 1.0:
        raise InputError(f"--tolerance: {tolerance:g}; allowed: {finest:.2g} to 1")
    if options.ablate:
        return _ablate(options, scene, form)
    if options.program not in (None, "runge-kutta"):
        shared.refuse(options, f"--program {options.program}", ("lipschitz", "no_stop"))
    if options.no_stop:
        shared.refuse(options, "--no-stop", ("lipschitz",))
    lipschitz = shared.positive(options.lipschitz, "--lipschitz", shared.default_lipschitz())
    listings = listings_for(
        PROGRAMS if options.program is None else (options.program,),
        options.listing,
        shared.names(options.fix),
        shared.names(options.keep),
        shared.names(options.reading),
    )
    shared.check_outputs(options)
    effort = shared.chosen_effort(options)
    found = compare_programs(scene, listings, lipschitz, not options.no_stop, tolerance, effort)

    if form == "json":
        from pyharness.model.build import build
        from pyharness.views.records import comparison_record, json_text

        text = json_text(comparison_record(found, build()))
    elif form == "csv":
        from pyharness.views.text import csv_text

        text = csv_text(*views.comparison_rows(found))
    elif form == "markdown":
        text = views.comparison_markdown(found)
    else:
        text = views.comparison_table(found)
    if options.plot is not None:
        from pyharness.views.pictures import comparison_picture

        shared.write(comparison_picture(found, options.plot), "--plot")
    shared.emit(text, options.out)
    return 1 if found.unexpected else 0


def _ablate(options: argparse.Namespace, scene: Scene, form: str) -> int:
    meaningless = ("listing", "fix", "keep", "lipschitz", "no_stop", "tolerance", "plot")
    shared.refuse(options, "--ablate", meaningless)
    programs = PROGRAMS if options.program is None else (options.program,)
    readings = shared.names(options.reading)
    for name in readings:
        allowed = [known for program in programs for known in names_of("reading", program)]
        if name not in allowed:
            raise unknown("reading", name, allowed, "--reading")
    effort = shared.chosen_effort(options)
    shared.check_outputs(options)

    from pyharness.history.ablation import lattice
    from pyharness.history.apparatus_report import lattice_rows, lattice_table
    from pyharness.views.records import SCHEMA, effect_record, json_text, scene_record
    from pyharness.views.text import csv_text, markdown_text

    found = {}
    for program in programs:
        own = tuple(name for name in readings if name in names_of("reading", program))
        found[program] = lattice(scene, program, own, effort)
    if form == "table":
        parts = [lattice_table(scene, program, effects) for program, effects in found.items()]
        text = "\n".join(parts)
    elif form == "json":
        effects = {name: [effect_record(e) for e in each] for name, each in found.items()}
        record = {"schema": SCHEMA, "scene": scene_record(scene), "lattice": effects}
        text = json_text(record)
    else:
        tables = [lattice_rows(program, effects) for program, effects in found.items()]
        rows = [row for _, part in tables for row in part]
        text = (csv_text if form == "csv" else markdown_text)(tables[0][0], rows)
    shared.emit(text, options.out)
    return 0
