"""Options that verbs share: how they are declared, read and refused."""

import argparse
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NoReturn

from pyharness.cli.stderr import say
from pyharness.model.errors import InputError, unknown
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, subset
from pyharness.model.report import Report
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_numbers, case_scene, read_scene

FORMATS = ("table", "json", "csv", "markdown")
_NEGATIVE = re.compile(r"-[.\d]")


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, with the nearest name."""

    def __init__(self, verb: str, description: str) -> None:
        """Start with no options."""
        super().__init__(
            prog=f"pyharness {verb}",
            description=description,
            allow_abbrev=False,
            # Given a width, argparse need not ask the terminal, which costs it an import.
            formatter_class=lambda prog: argparse.HelpFormatter(prog, width=100),
        )
        self.formats: Sequence[str] = ()

    def error(self, message: str) -> NoReturn:
        """Raise InputError in place of printing the usage."""
        raise InputError(message)

    def option_names(self) -> list[str]:
        """Return the names of all options."""
        return [name for name in self._option_string_actions if name.startswith("--")]

    def read(self, verb: str, arguments: Sequence[str]) -> argparse.Namespace:
        """Return the options of a command line; InputError for one that is unknown."""
        options, rest = self.parse_known_args(self._joined(arguments))
        if rest:
            raise unknown("option", rest[0], self.option_names(), verb)
        for name, value in vars(options).items():
            # What argparse makes of `--name=--`.
            if isinstance(value, list):
                raise InputError(f"--{name.replace('_', '-')}: '--' is no value; give one")
        check_format(getattr(options, "format", None), self.formats)
        return options

    def _joined(self, arguments: Sequence[str]) -> list[str]:
        """Join an option and a value with a minus sign, which argparse takes for an option."""
        result: list[str] = []
        for argument in arguments:
            if result and result[-1] in self.option_names() and _NEGATIVE.match(argument):
                result[-1] += "=" + argument
            else:
                result.append(argument)
        return result


def add_scene_options(parser: Parser) -> None:
    """Declare what chooses and changes the scene."""
    parser.add_argument("--case", metavar="N", help="a case of Table 1, 1 to 7")
    parser.add_argument("--scene", metavar="FILE", help="a scene file (TOML)")
    parser.add_argument("--omega0", metavar="A,B,C", help="initial angular velocity, rad/s")
    parser.add_argument("--step-size", metavar="H", help="step, s")
    parser.add_argument("--steps", metavar="N", help="number of steps")


def add_listing_options(parser: Parser) -> None:
    """Declare what chooses the defects, the readings and the stop test."""
    parser.add_argument("--listing", metavar="L", help="original or corrected")
    parser.add_argument("--fix", metavar="NAME,...", help="correct these defects")
    parser.add_argument("--keep", metavar="NAME,...", help="keep these; alone: correct all others")
    parser.add_argument("--reading", metavar="NAME,...", help="select readings not adopted")
    parser.add_argument("--lipschitz", metavar="L", help="constant of the stop test (default 500)")
    parser.add_argument(
        "--no-stop", action="store_true", help="run on where the stop test would end the run"
    )


def add_effort_option(parser: Parser) -> None:
    """Declare what lifts the limits."""
    parser.add_argument(
        "--effort", metavar="F", help="factor on the work that is done before giving up (default 1)"
    )


def chosen_effort(options: argparse.Namespace) -> float:
    """Return the factor on the limits."""
    return positive(options.effort, "--effort", 1.0)


def add_output_options(
    parser: Parser, formats: Sequence[str] = FORMATS, plot: str = "draw a picture"
) -> None:
    """Declare where results go, and in what form; `plot` is empty where nothing is drawn."""
    parser.formats = formats
    parser.add_argument("--format", metavar="F", help=", ".join(formats))
    if plot:
        parser.add_argument("--plot", metavar="FILE", help=f"{plot}, with its numbers as CSV")
    parser.add_argument("--out", metavar="FILE", help="write to this file, not to the terminal")


def check_format(form: str | None, allowed: Sequence[str]) -> None:
    """Refuse a form that is given and not allowed."""
    if form is not None and form not in allowed:
        raise unknown("format", form, allowed, "--format")


def chosen_scene(options: argparse.Namespace) -> Scene:
    """Return the scene asked for; warn where no body has its moments."""
    if (options.case is None) == (options.scene is None):
        raise InputError("give either --case N (1 to 7) or --scene FILE")
    if options.case is not None:
        known = [str(each) for each in case_numbers()]
        if options.case not in known:
            raise unknown("case", options.case, known, "--case")
        scene = case_scene(int(options.case))
    else:
        scene = read_scene(options.scene)
    changes: dict[str, Any] = {}
    if options.omega0 is not None:
        values = numbers(options.omega0, "--omega0")
        if len(values) != 3:
            raise InputError(f"--omega0: {len(values)} numbers; allowed: three, as in 0,1,10")
        changes["omega"] = tuple(values)
    if options.step_size is not None:
        changes["step_size"] = number(options.step_size, "--step-size")
    if options.steps is not None:
        changes["steps"] = whole(options.steps, "--steps")
    scene = replace(scene, **changes)
    if scene.is_impossible:
        warn("no rigid body has these moments, one exceeds the sum of the others; run all the same")
    return scene


def chosen_listing(options: argparse.Namespace) -> Listing:
    """Return the listing of the one program asked for."""
    if options.program not in PROGRAMS:
        raise unknown("program", options.program, PROGRAMS, "--program")
    return subset(
        options.program,
        options.listing,
        names(options.fix),
        names(options.keep),
        names(options.reading),
    )


def check_base(options: argparse.Namespace) -> None:
    """Refuse a listing of another name."""
    if options.listing not in (None, "original", "corrected"):
        raise unknown("listing", options.listing, ("original", "corrected"), "--listing")


def listing_text(listing: Listing) -> str:
    """Say a listing in a line."""
    active = ", ".join(sorted(listing.defects)) or "no defects"
    readings = f"; readings: {', '.join(sorted(listing.readings))}" if listing.readings else ""
    return f"{listing.label} listing: {active}{readings}"


def default_lipschitz() -> float:
    """Return the constant of the decks (1/s)."""
    return float(facts("cases")["deck"]["lipschitz"])


def refuse(options: argparse.Namespace, chosen: str, names: Sequence[str]) -> None:
    """Refuse options that mean nothing beside what was chosen."""
    for name in names:
        if getattr(options, name):
            raise InputError(f"--{name.replace('_', '-')} has no meaning with {chosen}")


def names(text: str | None) -> list[str]:
    """Return the names of a list, as in a,b."""
    return [] if text is None else [name.strip() for name in text.split(",")]


def numbers(text: str, option: str) -> list[float]:
    """Return the finite numbers of a list, as in 1,2."""
    return [number(part, option) for part in text.split(",")]


def number(text: str, option: str) -> float:
    """Return a finite number."""
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{option}: '{text}' where a number belongs") from None
    if not math.isfinite(value):
        raise InputError(f"{option}: '{text}' is not finite; allowed: finite numbers")
    return value


def positive(text: str | None, option: str, default: float) -> float:
    """Return a number above 0, or the default where none is given."""
    if text is None:
        return default
    value = number(text, option)
    if value <= 0.0:
        raise InputError(f"{option}: {value:g}; allowed: a number above 0")
    return value


def whole(text: str, option: str) -> int:
    """Return a whole number."""
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{option}: '{text}' where a whole number belongs") from None


def warn(message: str) -> None:
    """Say on stderr what the user should know."""
    say(f"pyharness: warning: {message}\n")


def progress(text: str) -> None:
    """Say on a terminal how far it is, in a line that the next one replaces; "" wipes it."""
    if sys.stderr.isatty():
        say(f"\r\x1b[K{text}")


def check_outputs(options: argparse.Namespace) -> None:
    """Refuse outputs that can't be written, before anything is computed."""
    picture = getattr(options, "plot", None)
    if picture is None and options.out is None:
        return
    from pyharness.cli.output import check_apart, check_writable

    if picture is not None:
        from pyharness.views.pictures import check_picture, numbers_beside

        check_picture(picture)
        for path in (picture, numbers_beside(picture)):
            check_writable(path, "--plot")
    if options.out is not None:
        check_writable(options.out, "--out")
    if picture is not None and options.out is not None:
        check_apart(picture, options.out)


def show(
    report: Report,
    options: argparse.Namespace,
    own: Mapping[str, Callable[[], str | bytes]] | None = None,
) -> None:
    """Give a report in the form asked for, and draw its picture where one is asked for.

    `own` are forms, by name, that this report alone has.
    """
    from pyharness.views.render import render

    progress("")
    form = options.format or FORMATS[0]
    content = own[form]() if own and form in own else render(report, form)
    if getattr(options, "plot", None) is not None:
        from pyharness.views.pictures import saved

        assert report.pictures is not None
        (draw,) = report.pictures.values()
        write(saved(draw(), options.plot), "--plot")
    emit(content, options.out)


def write(contents: dict[str, bytes], option: str) -> None:
    """Write files whole or not at all."""
    from pyharness.cli.output import write_files

    write_files(contents, option)


def emit(content: str | bytes, out: str | None) -> None:
    """Write to the terminal, or to the file asked for."""
    if out is not None:
        write({out: content if isinstance(content, bytes) else content.encode()}, "--out")
    elif isinstance(content, bytes):
        sys.stdout.buffer.write(content)
    else:
        # A name may hold letters that the terminal's encoding lacks.
        encoding = sys.stdout.encoding or "utf-8"
        sys.stdout.write(content.encode(encoding, "backslashreplace").decode(encoding))
