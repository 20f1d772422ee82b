"""`compare`: original against corrected, Fortran against Python, all against the truth."""

import argparse

from pyharness.cli import options as shared
from pyharness.compare.comparison import compare_programs, listings_for
from pyharness.compare.report import comparison_report
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
    shared.check_base(options)
    tolerance = shared.positive(options.tolerance, "--tolerance", 1e-8)
    finest = max(METHODS[name].finest for name in SCIPY_METHODS)
    if not finest <= tolerance <= 1.0:
        raise InputError(f"--tolerance: {tolerance:g}; allowed: {finest:.2g} to 1")
    if options.ablate:
        return _ablate(options, scene)
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
    shared.show(comparison_report(found), options)
    return 1 if found.unexpected else 0


def _ablate(options: argparse.Namespace, scene: Scene) -> int:
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
    from pyharness.history.apparatus_report import lattice_report

    found = {}
    for program in programs:
        own = tuple(name for name in readings if name in names_of("reading", program))
        found[program] = lattice(scene, program, own, effort)
    shared.show(lattice_report(scene, found), options)
    return 0
