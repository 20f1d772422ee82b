"""The verb `run`."""

import argparse
import sys
from dataclasses import replace
from functools import partial
from typing import Any

from pyharness.cli import options as shared
from pyharness.engine.plan.report import trajectory_report
from pyharness.model.assumptions import mark
from pyharness.model.attitude import FORMS
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene
from pyharness.model.scene_report import ending
from pyharness.model.trajectory import Trajectory
from pyharness.thesis.programs import (
    BINARY64,
    IMPLEMENTATIONS,
    WORD_NAMES,
    checked_word,
    run_program,
)

# Output formats for programs only: the line printer's page, and the binary file TAPE5.
PROGRAM_FORMATS = ("printer", "tape5")
FORMATS = (*shared.FORMATS, *PROGRAM_FORMATS)
OPTIONS = {
    **shared.SCENE,
    "--program P": f"This program: {', '.join(PROGRAMS)}.",
    "--implementation I": "Language: fortran (default for binary64) or python (default otherwise).",
    "--word W": f"Arithmetic: {', '.join(WORD_NAMES)} (default {WORD_NAMES[0]}). cdc48 "
    "truncates, as CDC computers did; cdc48-rounded rounds; both only with python.",
    "--method M": "Method (list: docs/reference/methods.md; with --scene, default auto).",
    **shared.LISTING,
    "--times T1,T2,...": "Times of the results (s), also negative, ascending or descending "
    "(default: the scene's steps).",
    "--attitude [FORM]": f"Compute the attitude (orientation), as {', '.join(FORMS)} (default "
    f"{FORMS[0]}).",
    "--animate FILE": "Animate the body (.gif, .html); needs an attitude.",
    "--tolerance E": "Allowed error of omega, relative to its largest component (default: the "
    "method's own).",
    "--strict": "Exit with status 1 if results are missing, or errors may exceed the tolerance.",
    **shared.EFFORT,
    **shared.outputs(FORMATS),
    "--format F": f"Output format: {FORMATS[0]} (default), {', '.join(shared.FORMATS[1:])}; for "
    "programs also printer, tape5.",
}
GROUPS = {
    "a program of the thesis": "program implementation word",
    "another method (not with --program)": "method times tolerance animate strict",
}
USAGE = "--case N (--program P | --method M)\n--scene FILE [--program P | --method M]"
EXAMPLE = "run --case 5 --method auto --times 1,2,3"


def run(options: argparse.Namespace) -> int:
    """Print a trajectory by a program of the thesis or another method.

    With --strict, return 1 unless the trajectory's ending is "complete".
    """
    if options.scene is not None and options.program is None and options.method is None:
        options.method = "auto"
    by_method = options.method is not None
    kinds = ("any_axes", "any_torque", "any_state", "changing", "states", "t0")
    scene = shared.chosen_scene(options, **dict.fromkeys(kinds, by_method))
    if (options.program is None) == (options.method is None):
        from pyharness.engine.plan.registry import METHODS

        raise InputError(
            f"run: give either --program ({', '.join(PROGRAMS)}) or --method ({', '.join(METHODS)})"
        )
    if options.attitude == "":
        options.attitude = FORMS[0]
    shared.check_known("attitude", options.attitude, FORMS)
    shared.check_known("word", options.word, WORD_NAMES)
    if options.format in PROGRAM_FORMATS:
        _check_program_format(options, scene, options.format)
    listing: Listing | None = None
    bound = None
    if options.program is not None:
        name, listing, title, trajectory = _program(options, scene)
    else:
        name, title, trajectory = _method(options, scene)
        if name == "reference":
            from pyharness.engine.plan.report import trajectory_bound

            bound = trajectory_bound(scene, trajectory, shared.chosen_effort(options))

    def write(form: str) -> str | bytes:
        from pyharness.thesis.printer import page, tape5

        return tape5(trajectory) if form == "tape5" else page(scene, name, trajectory)

    form = options.attitude or FORMS[0]
    word = None if options.word == BINARY64 else options.word
    report = trajectory_report(scene, name, listing, title, trajectory, form, word, bound)
    failed = options.strict and trajectory.ended != "complete"
    own = {each: partial(write, each) for each in PROGRAM_FORMATS}
    # No warning for programs of the thesis, whose expected result may be an overflow.
    if by_method and options.format in ("csv", "markdown") and not trajectory.has_all_rows:
        shared.warn(ending(trajectory))
    return shared.show(report, options, own, failed)


def _check_program_format(options: argparse.Namespace, scene: Scene, form: str) -> None:
    if options.program is None:
        raise InputError(
            f"--format {form} has no meaning with --method; allowed: {', '.join(shared.FORMATS)}"
        )
    shared.refuse(options, f"--format {form}", ("attitude",))
    if form == "printer" and scene.moments is None:
        raise InputError(
            "--format printer prints the moments, and this scene has only coefficients; give "
            f"moments, or one of {', '.join(shared.FORMATS)}"
        )
    if form == "tape5" and options.word not in (None, BINARY64):
        raise InputError(
            f"--format tape5 has records of {BINARY64} only, not of --word {options.word}; "
            "give another --format"
        )
    if form == "tape5" and options.out is None and sys.stdout.isatty():
        raise InputError(
            "--format tape5 is binary and can't be shown on a terminal; give --out FILE, or "
            "pipe the output"
        )


def _program(options: argparse.Namespace, scene: Scene) -> tuple[str, Listing, str, Trajectory]:
    shared.refuse(options, "--program", ("times", "tolerance", "strict", "animate"))
    listing = shared.chosen_listing(options)
    name = listing.program
    stops = shared.chosen_stops(options)
    word = options.word or BINARY64
    implementation = options.implementation or ("fortran" if word == BINARY64 else "python")
    shared.check_known("implementation", implementation, IMPLEMENTATIONS)
    checked_word(word, implementation)
    shared.check_outputs(options)
    effort = shared.chosen_effort(options)
    trajectory = run_program(scene, listing, implementation, **stops, effort=effort, word=word)
    if options.attitude is not None:
        from pyharness.engine.steps.from_rows import attitude_from_rows

        rows = attitude_from_rows(scene, trajectory.time, trajectory.omega)
        trajectory = replace(trajectory, attitude=rows)
    how = implementation if word == BINARY64 else f"{implementation}, {word}"
    title = f"program {name}{mark(scene, listing)} ({how}), {shared.listing_text(listing)}"
    return name, listing, title, trajectory


def _method(options: argparse.Namespace, scene: Scene) -> tuple[str, str, Trajectory]:
    # Imported here, because a program's run does not need these modules.
    from pyharness.engine.plan.registry import METHODS
    from pyharness.engine.solve import solve

    shared.refuse(options, "--method", ("implementation", "word", *shared.LISTING))
    name = options.method
    shared.check_known("method", name, tuple(METHODS))
    tolerance = shared.chosen_tolerance(options)
    times = scene.times() if options.times is None else shared.numbers(options.times, "--times")
    shared.check_outputs(options)
    attitude = None if options.attitude is None else True
    if options.animate is not None:
        from pyharness.model.attitude_picture import check_animation
        from pyharness.model.principal import principal

        if options.attitude is None and not scene.has_attitude:
            raise InputError(
                "--animate needs an attitude; request one, as in --attitude quaternion"
            )
        check_animation(options.animate, scene.changing or principal(scene)[0].moments)
        attitude = True
    is_dense = options.animate is not None
    # Only with these methods: for dense output, others would solve again.
    is_dense |= options.plot is not None and name in ("auto", "taylor", "closed-form")
    more: dict[str, Any] = {"attitude": attitude, "dense_output": is_dense}
    trajectory = solve(scene, times, name, tolerance, effort=shared.chosen_effort(options), **more)
    if options.animate is not None:
        trajectory.animate(options.animate)
    title = f"method {name}: {METHODS[name].title}"
    if trajectory.tolerance is not None:
        title += f", tolerance {trajectory.tolerance:g}"
    return name, title, trajectory
