"""The verb `compare`."""

import argparse
from collections.abc import Sequence
from typing import Any

from pyharness.checks.compare.comparison import compare_methods, compare_programs, listings_for
from pyharness.checks.compare.findings import Comparison
from pyharness.checks.compare.report import comparison_report
from pyharness.cli import options as shared
from pyharness.engine.plan.registry import METHODS, SCIPY_METHODS
from pyharness.model.errors import InputError, unknown
from pyharness.model.listing import PROGRAMS, names_of
from pyharness.model.scene import Scene
from pyharness.thesis.programs import BINARY64, WORD_NAMES

OPTIONS = {
    **shared.SCENE,
    **shared.LISTING,
    "--listing L": "Only this version: original, or corrected (without the author's defects).",
    "--program P": f"Only this program: {', '.join(PROGRAMS)}.",
    "--method M,...": "Compare methods instead of programs (names: docs/reference/methods.md).",
    "--word W": f"Arithmetic of programs: {', '.join(WORD_NAMES)} (default {WORD_NAMES[0]}; "
    "cdc48: CDC computers).",
    "--tolerance E": "Allowed error of omega, relative to its largest component, for --method or "
    "solve_ivp (default: each method's own).",
    "--attitude": "Compare the attitude (orientation) too, by an angle in rad.",
    "--ablate": "Run each program with every subset of its defects.",
    "--numerics": "Show also drifts of energy and momentum, differences between Fortran and "
    "Python, error amplification, solve_ivp and run times (always in JSON and CSV).",
    **shared.STRICT,
    **shared.EFFORT,
    **shared.outputs(),
}
# Formats that show methods of `solve_ivp` beside programs only with --numerics; no verdict on
# programs depends on these.
_WITHOUT_METHODS = {"table", "markdown"}
USAGE = shared.ONE_SCENE
EXAMPLE = "compare --case 3 --listing original --plot case-3.png"


def run(options: argparse.Namespace) -> int:
    """Compare original and corrected programs, or methods, with the reference solution.

    Return 1 for unexpected or, with --strict, incomplete or sensitive results.
    """
    if options.method is not None:
        return _methods(options)
    scene = shared.chosen_scene(options)
    programs = shared.chosen_programs(options)
    shared.check_known("word", options.word, WORD_NAMES)
    shared.check_known("listing", options.listing, ("original", "corrected"))
    tolerance = shared.chosen_tolerance(options)
    finest = max(METHODS[name].finest for name in SCIPY_METHODS)
    if tolerance is not None and not finest <= tolerance <= 1.0:
        raise InputError(f"--tolerance: {tolerance:g}; allowed: {finest:.2g} to 1")
    if options.ablate:
        return _ablate(options, scene, programs)
    stops = shared.chosen_stops(options)
    listings = listings_for(programs, options.listing, **shared.changes_of(options))
    shared.tell_inactive(options, listings)
    shared.check_outputs(options)
    effort = shared.chosen_effort(options)
    forms = {options.format or shared.FORMATS[0], *shared.also_files(options).values()}
    more: dict[str, Any] = {"attitude": options.attitude, "word": options.word or BINARY64}
    more["methods"] = options.numerics or not forms <= _WITHOUT_METHODS
    found = compare_programs(scene, listings, **stops, tolerance=tolerance, effort=effort, **more)
    return _show(options, found)


def _show(options: argparse.Namespace, found: Comparison) -> int:
    failed = found.unexpected or (options.strict and (found.is_sensitive or not found.is_complete))
    return shared.show(comparison_report(found, options.numerics), options, failed=failed)


def _methods(options: argparse.Namespace) -> int:
    shared.refuse(options, "--method", ("program", *shared.LISTING, "word", "ablate", "numerics"))
    scene = shared.chosen_scene(options, any_state=True)
    shared.check_outputs(options)
    tolerance, effort = shared.chosen_tolerance(options), shared.chosen_effort(options)
    more: dict[str, Any] = {"tolerance": tolerance, "effort": effort}
    more["attitude"] = options.attitude or None
    found = compare_methods(scene, shared.names(options.method), **more)
    return _show(options, found)


def _ablate(options: argparse.Namespace, scene: Scene, programs: Sequence[str]) -> int:
    others = [option for option in shared.LISTING if not option.startswith("--reading")]
    others += ["tolerance", "word", "attitude", "plot", "strict", "numerics"]
    shared.refuse(
        options,
        "--ablate",
        others,
        "--program, --reading, --effort, and the options of scene and output",
    )
    readings = shared.names(options.reading)
    for name in readings:
        allowed = [known for program in programs for known in names_of("reading", program)]
        if name not in allowed:
            raise unknown("reading", name, allowed, "--reading")
    effort = shared.chosen_effort(options)
    shared.check_outputs(options)

    from pyharness.history.ablation import lattice, lattice_report

    found = {}
    for program in programs:
        own = tuple(name for name in readings if name in names_of("reading", program))
        found[program] = lattice(scene, program, own, effort)
    return shared.show(lattice_report(scene, found), options)
