"""The command line: parse, call one room, pick one view."""

import argparse
import gc
import math
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NoReturn

from pyharness.errors import InputError, NotBuiltError, unknown
from pyharness.facts import facts
from pyharness.listing import PROGRAMS, Listing, subset
from pyharness.scene import Scene
from pyharness.scene_file import case_numbers, case_scene, read_scene

FORMATS = ("table", "json", "csv", "markdown")
_NEGATIVE = re.compile(r"-[.\d]")


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, with the nearest name."""

    def error(self, message: str) -> NoReturn:
        raise InputError(message)

    def option_names(self) -> list[str]:
        return [name for name in self._option_string_actions if name.startswith("--")]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code.

    0 as expected; 1 an unexpected difference; 2 wrong usage or input; 3 the extension is not
    built.
    """
    # A command is short: collecting cycles while rooms are imported costs 4 % and frees nothing.
    gc.set_threshold(100_000)
    try:
        code = _run(list(sys.argv[1:] if arguments is None else arguments))
        sys.stdout.flush()
        return code
    except InputError as error:
        return _complain(str(error), 2)
    except NotBuiltError as error:
        return _complain(str(error), 3)
    except MemoryError:
        return _complain("not enough memory; take fewer steps", 2)
    except BrokenPipeError:
        # The reader has seen enough; Python must not complain when it closes the pipe.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return _complain("interrupted", 130)


def _complain(message: str, code: int) -> int:
    line = " ".join(message.split())
    # A name from the command line may hold bytes that are no text.
    text = f"pyharness: {line}\n".encode(errors="backslashreplace").decode()
    sys.stderr.write(text)
    return code


def _run(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help"):
        sys.stdout.write(_overview())
        return 0
    if arguments[0] == "--version":
        from pyharness import __version__

        sys.stdout.write(f"pyharness {__version__}\n")
        return 0
    if arguments[0] not in _VERBS:
        raise unknown("verb", arguments[0], _VERBS)
    action, make_parser = _VERBS[arguments[0]]
    parser = make_parser()
    options, rest = parser.parse_known_args(_joined(arguments[1:], parser))
    if rest:
        raise unknown("option", rest[0], parser.option_names(), arguments[0])
    return action(options)


def _joined(arguments: list[str], parser: _Parser) -> list[str]:
    """Join an option and a value that begins with a minus sign: argparse takes it for an option."""
    result: list[str] = []
    for argument in arguments:
        if result and result[-1] in parser.option_names() and _NEGATIVE.match(argument):
            result[-1] += "=" + argument
        else:
            result.append(argument)
    return result


def _overview() -> str:
    lines = ["usage: pyharness VERB [options]; pyharness VERB --help tells the options", ""]
    lines += [f"  {verb:10s}{make().description}" for verb, (_, make) in _VERBS.items()]
    return "\n".join(lines) + "\n"


# Parsers


def _parser(verb: str, description: str) -> _Parser:
    return _Parser(
        prog=f"pyharness {verb}",
        description=description,
        allow_abbrev=False,
        # Given a width, argparse need not ask the terminal, which costs it an import.
        formatter_class=lambda prog: argparse.HelpFormatter(prog, width=100),
    )


def _compare_parser() -> _Parser:
    parser = _parser(
        "compare", "original against corrected, Fortran against Python, all against the truth"
    )
    _add_scene_options(parser)
    _add_listing_options(parser)
    parser.add_argument("--program", metavar="P", help="this program only")
    parser.add_argument("--tolerance", metavar="E", help="asked of solve_ivp (default 1e-8)")
    _add_output_options(parser)
    return parser


def _run_parser() -> _Parser:
    parser = _parser("run", "one trajectory: a program of the appendix, or a method")
    _add_scene_options(parser)
    parser.add_argument("--program", metavar="P", help=", ".join(PROGRAMS))
    parser.add_argument("--implementation", metavar="I", help="fortran (default) or python")
    parser.add_argument("--method", metavar="M", help="a method in place of a program")
    _add_listing_options(parser)
    parser.add_argument(
        "--times", metavar="T1,T2,...", help="where results are wanted, s (methods)"
    )
    parser.add_argument(
        "--tolerance", metavar="E", help="error at these times over the largest |omega| (methods)"
    )
    _add_output_options(parser)
    return parser


def _doctor_parser() -> _Parser:
    parser = _parser("doctor", "what is built, with what, and what is missing")
    parser.add_argument("--format", metavar="F", help="table (default) or json")
    parser.add_argument("--out", metavar="FILE", help="write to this file")
    return parser


def _add_scene_options(parser: _Parser) -> None:
    parser.add_argument("--case", metavar="N", help="a case of Table 1, 1 to 7")
    parser.add_argument("--scene", metavar="FILE", help="a scene file (TOML)")
    parser.add_argument("--omega0", metavar="A,B,C", help="initial angular velocity, rad/s")
    parser.add_argument("--step-size", metavar="H", help="step, s")
    parser.add_argument("--steps", metavar="N", help="number of steps")


def _add_listing_options(parser: _Parser) -> None:
    parser.add_argument("--listing", metavar="L", help="original or corrected")
    parser.add_argument("--fix", metavar="NAME,...", help="mend these defects")
    parser.add_argument("--keep", metavar="NAME,...", help="keep these; alone: mend all others")
    parser.add_argument("--reading", metavar="NAME,...", help="select readings not adopted")
    parser.add_argument("--lipschitz", metavar="L", help="constant of the stop test (default 500)")
    parser.add_argument(
        "--no-stop", action="store_true", help="run on where the stop test would end the run"
    )


def _add_output_options(parser: _Parser) -> None:
    parser.add_argument("--format", metavar="F", help=", ".join(FORMATS))
    parser.add_argument("--plot", metavar="FILE", help="draw a picture, with its numbers as CSV")
    parser.add_argument("--out", metavar="FILE", help="write to this file, not to the terminal")


# Verbs


def _compare(options: argparse.Namespace) -> int:
    scene = _scene(options)
    if options.program is not None and options.program not in PROGRAMS:
        raise unknown("program", options.program, PROGRAMS, "--program")
    form = _format(options, FORMATS)
    _check_base(options)
    programs = PROGRAMS if options.program is None else (options.program,)
    tolerance = _positive(options.tolerance, "--tolerance", 1e-8)
    lipschitz = _positive(options.lipschitz, "--lipschitz", _default_lipschitz())
    from pyharness.compare import compare, listings_for
    from pyharness.methods import METHODS, SCIPY_METHODS

    finest = max(METHODS[name].finest for name in SCIPY_METHODS)
    if not finest <= tolerance <= 1.0:
        raise InputError(f"--tolerance: {tolerance:g}; allowed: {finest:g} to 1")
    listings = listings_for(
        programs,
        options.listing,
        _names(options.fix),
        _names(options.keep),
        _names(options.reading),
    )
    _check_outputs(options)
    found = compare(scene, listings, lipschitz, not options.no_stop, tolerance)

    from pyharness import comparison_tables as views

    if form == "json":
        from pyharness.build import build
        from pyharness.records import comparison_record, json_text

        text = json_text(comparison_record(found, build()))
    elif form == "csv":
        from pyharness.tables import csv_text

        text = csv_text(*views.comparison_rows(found))
    elif form == "markdown":
        text = views.comparison_markdown(found)
    else:
        text = views.comparison_table(found)
    if options.plot is not None:
        from pyharness.plots import comparison_picture

        _write(comparison_picture(found, options.plot), "--plot")
    _emit(text, options.out)
    return 1 if found.unexpected else 0


def _run_one(options: argparse.Namespace) -> int:
    scene = _scene(options)
    form = _format(options, FORMATS)
    from pyharness import methods

    if (options.program is None) == (options.method is None):
        raise InputError(
            f"run: give either --program ({', '.join(PROGRAMS)}) "
            f"or --method ({', '.join(methods.METHODS)})"
        )
    listing: Listing | None = None
    if options.program is not None:
        _refuse(options, "--program", ("times", "tolerance"))
        listing = _listing(options)
        if options.program != "runge-kutta":
            _refuse(options, f"--program {options.program}", ("lipschitz", "no_stop"))
        implementation = options.implementation or "fortran"
        if implementation not in methods.IMPLEMENTATIONS:
            raise unknown(
                "implementation", implementation, methods.IMPLEMENTATIONS, "--implementation"
            )
        lipschitz = _positive(options.lipschitz, "--lipschitz", _default_lipschitz())
        _check_outputs(options)
        program = methods.PROGRAM_REGISTRY[options.program]
        trajectory = program.run(scene, listing, implementation, lipschitz, not options.no_stop)
        name = options.program
        title = [f"program {name} ({implementation}), {_listing_text(listing)}"]
    else:
        listing_options = ("implementation", "listing", "fix", "keep", "reading", "lipschitz")
        _refuse(options, "--method", (*listing_options, "no_stop"))
        if options.method not in methods.METHODS:
            raise unknown("method", options.method, methods.METHODS, "--method")
        name = options.method
        default = max(1e-9, methods.METHODS[name].finest)
        tolerance = _positive(options.tolerance, "--tolerance", default)
        times = _times(options.times) if options.times is not None else scene.times()
        _check_outputs(options)
        trajectory = methods.solve(scene, times, name, tolerance)
        title = [f"method {name}: {methods.METHODS[name].title}, tolerance {tolerance:g}"]

    from pyharness import tables

    if form == "json":
        from pyharness.build import build
        from pyharness.records import json_text, run_record

        text = json_text(run_record(scene, name, listing, trajectory, build()))
    elif form == "csv":
        text = tables.csv_text(*tables.trajectory_rows(trajectory))
    elif form == "markdown":
        text = tables.markdown_text(*tables.trajectory_rows(trajectory))
    else:
        text = tables.trajectory_table(title, scene, trajectory)
    if options.plot is not None:
        from pyharness.plots import trajectory_picture

        _write(trajectory_picture(f"{scene.name}: {title[0]}", trajectory, options.plot), "--plot")
    _emit(text, options.out)
    return 0


def _doctor(options: argparse.Namespace) -> int:
    form = _format(options, ("table", "json"))
    _check_outputs(options)
    from pyharness.build import OPTIONAL, build, missing

    found, absent = build(), missing()
    if form == "json":
        from pyharness.records import doctor_record, json_text

        _emit(json_text(doctor_record(found, absent)), options.out)
    else:
        from pyharness.tables import doctor_table

        _emit(doctor_table(found, OPTIONAL, absent), options.out)
    return 0 if found.extension else 3


# Values


def _scene(options: argparse.Namespace) -> Scene:
    if (options.case is None) == (options.scene is None):
        raise InputError("give either --case N (1 to 7) or --scene FILE")
    if options.case is not None:
        numbers = case_numbers()
        if options.case not in map(str, numbers):
            raise unknown("case", options.case, map(str, numbers), "--case")
        scene = case_scene(int(options.case))
    else:
        scene = read_scene(options.scene)
    changes: dict[str, Any] = {}
    if options.omega0 is not None:
        values = _numbers(options.omega0, "--omega0")
        if len(values) != 3:
            raise InputError(f"--omega0: {len(values)} numbers; allowed: three, as in 0,1,10")
        changes["omega"] = tuple(values)
    if options.step_size is not None:
        changes["step_size"] = _number(options.step_size, "--step-size")
    if options.steps is not None:
        changes["steps"] = _whole(options.steps, "--steps")
    scene = replace(scene, **changes)
    if scene.is_impossible:
        _warn(
            "no rigid body has these moments, one exceeds the sum of the others; run all the same"
        )
    return scene


def _listing(options: argparse.Namespace) -> Listing:
    if options.program not in PROGRAMS:
        raise unknown("program", options.program, PROGRAMS, "--program")
    return subset(
        options.program,
        options.listing,
        _names(options.fix),
        _names(options.keep),
        _names(options.reading),
    )


def _check_base(options: argparse.Namespace) -> None:
    if options.listing not in (None, "original", "corrected"):
        raise unknown("listing", options.listing, ("original", "corrected"), "--listing")


def _listing_text(listing: Listing) -> str:
    active = ", ".join(sorted(listing.defects)) or "no defects"
    readings = f"; readings: {', '.join(sorted(listing.readings))}" if listing.readings else ""
    return f"{listing.label} listing: {active}{readings}"


def _default_lipschitz() -> float:
    return float(facts("cases")["deck"]["lipschitz"])


def _format(options: argparse.Namespace, allowed: Sequence[str]) -> str:
    form = options.format or allowed[0]
    if form not in allowed:
        raise unknown("format", form, allowed, "--format")
    return str(form)


def _refuse(options: argparse.Namespace, chosen: str, names: Sequence[str]) -> None:
    for name in names:
        if getattr(options, name):
            raise InputError(f"--{name.replace('_', '-')} has no meaning with {chosen}")


def _names(text: str | None) -> list[str]:
    return [] if text is None else [name.strip() for name in text.split(",")]


def _times(text: str) -> list[float]:
    return _numbers(text, "--times")


def _numbers(text: str, option: str) -> list[float]:
    return [_number(part, option) for part in text.split(",")]


def _number(text: str, option: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{option}: '{text}' where a number belongs") from None
    if not math.isfinite(value):
        raise InputError(f"{option}: '{text}' is not finite; allowed: finite numbers")
    return value


def _positive(text: str | None, option: str, default: float) -> float:
    if text is None:
        return default
    value = _number(text, option)
    if value <= 0.0:
        raise InputError(f"{option}: {value:g}; allowed: a number above 0")
    return value


def _whole(text: str, option: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{option}: '{text}' where a whole number belongs") from None


# Output


def _warn(message: str) -> None:
    sys.stderr.write(f"pyharness: warning: {message}\n")


def _check_outputs(options: argparse.Namespace) -> None:
    picture = getattr(options, "plot", None)
    if picture is None and options.out is None:
        return
    from pyharness.output import check_writable

    if picture is not None:
        from pyharness.plots import check_picture

        check_picture(picture)
        check_writable(picture, "--plot")
    if options.out is not None:
        check_writable(options.out, "--out")


def _write(contents: dict[str, bytes], option: str) -> None:
    from pyharness.output import write_files

    write_files(contents, option)


def _emit(text: str, out: str | None) -> None:
    if out is None:
        sys.stdout.write(text)
    else:
        _write({out: text.encode()}, "--out")


_VERBS: dict[str, tuple[Callable[[argparse.Namespace], int], Callable[[], _Parser]]] = {
    "compare": (_compare, _compare_parser),
    "run": (_run_one, _run_parser),
    "doctor": (_doctor, _doctor_parser),
}
