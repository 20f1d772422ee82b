"""Options that several verbs share: help texts, parsing and checks."""

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

from pyharness.cli import end_progress as end_progress
from pyharness.cli import progress as progress
from pyharness.cli import say, shown, write_text
from pyharness.engine.torques.scene_reader import read_scene
from pyharness.model.attitude import NEAR_ONE
from pyharness.model.errors import InputError, unknown
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, names_of, subset, switchable
from pyharness.model.output_files import check_writable, write_files
from pyharness.model.report import Report, format_duration
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.values import parsed_float, parsed_whole

FORMATS = ("table", "json", "csv", "markdown")
# Part of the usage of verbs that require one of two options.
ONE_SCENE = "(--case N | --scene FILE)"
# A placeholder after an option's name, as N in "--case N", stands for the option's value.
BODY = {
    "--case N": "Case 1 to 7 of the thesis.",
    "--scene FILE": "Scene file (sample: `pyharness scene new`).",
    "--omega A,B,C": "Replace the initial angular velocity (body axes, rad/s).",
}
SCENE = {
    **BODY,
    "--step-size H": "Replace the step size (s).",
    "--steps N": "Replace the number of steps.",
}
LISTING = {
    "--listing L": "Version: original (default), or corrected (without the author's defects).",
    "--fix NAME,...": "Correct only these defects (`pyharness defects --all` lists all names).",
    "--keep NAME,...": "Correct all defects but these.",
    "--reading NAME,...": "Use the rejected reading of these doubtful lines.",
    "--conjecture NAME,...": "Make these assumptions about missing lines, or `none` (default "
    "torque-held).",
    "--lipschitz L": "Lipschitz quotient (1/s) above which the Runge-Kutta program stops (default "
    "500).",
    "--no-stop": "Omit this stop test.",
}
_EFFORT = "Multiply each computation's work limit, about {} s{}, by F."
EFFORT = {"--effort F": _EFFORT.format(10, " (programs: 30 s)")}
EFFORT_WITHOUT_PROGRAMS = {"--effort F": _EFFORT.format(10, "")}
EFFORT_OF_PROGRAMS = {"--effort F": _EFFORT.format(30, "")}
STRICT = {
    "--strict": "Exit with status 1 not only if a comparison fails, but also if results are "
    "incomplete, or rounding errors may exceed the tolerance."
}
ALSO = {"--also FILE,...": "Write the result also to these files (.md, .json; .xml: JUnit)."}
_BY_SUFFIX = {".md": "markdown", ".xml": "junit", ".json": "json"}
# Options and arguments that name a file to read; --check, which names several, is separate.
_INPUTS = ("scene", "file", "scan", "vectors", "external", "listing_output", "sweep")
_MORE_OUTPUTS = {"animate": "the animation", "certificate": "the certificate"}
_WORTH_SAYING = 60.0  # run time (s) above which a forecast is printed


class Cost(NamedTuple):
    """The cost of a random draw on a core of 2026, and the largest number of draws."""

    what: str  # plural noun for the draws, as in "random scenes"
    seconds: float  # run time (s) of a draw
    n_bytes: float  # memory (bytes) of a draw
    most: int  # largest allowed number of draws


# A draw of `verify` makes nearly three checks, which stay in memory until the report.
CHECKS = Cost("random draws", 0.035, 2e3, 1_000_000)
# `bench` computes the reference of each random scene, and runs every solver with all its settings.
SCENES = Cost("random scenes", 8.0, 1e5, 10_000)


def outputs(formats: Sequence[str] = FORMATS, plot: str = "the results") -> dict[str, str]:
    """Return the helps of --format, --plot and --out, by option.

    The first format is the default; an empty `plot` omits --plot.
    """
    first, *others = formats
    form = {"--format F": f"Output format: {first} (default), {', '.join(others)}."}
    picture = {"--plot FILE": f"Draw {plot} (.png, .svg, .pdf), and write the numbers (.csv)."}
    out = {"--out FILE": "File for the result (default: standard output)."}
    return {**form, **(picture if plot else {}), **out}


def chosen_effort(options: argparse.Namespace) -> float:
    return positive(options.effort, "--effort", 1.0)


def chosen_case(options: argparse.Namespace) -> int | None:
    check_known("case", options.case, [str(each) for each in case_numbers()])
    return None if options.case is None else int(options.case)


def chosen_cases(options: argparse.Namespace) -> list[int]:
    case = chosen_case(options)
    return list(case_numbers()) if case is None else [case]


def chosen_tolerance(options: argparse.Namespace) -> float | None:
    return None if options.tolerance is None else positive(options.tolerance, "--tolerance", 1.0)


def chosen_seed(options: argparse.Namespace) -> str | None:
    if options.seed is not None and not options.seed.isprintable():
        raise InputError(
            "--seed: contains characters that can't be printed; allowed: printable characters"
        )
    seed: str | None = options.seed
    return seed


def check_known(what: str, name: str | None, allowed: Sequence[str]) -> None:
    if name is not None and name not in allowed:
        raise unknown(what, name, allowed, f"--{what}")


def chosen_names(text: str | None, what: str, allowed: Sequence[str]) -> list[str]:
    """Return the names in --only, which are beginnings of checks' ids, as in ``cells/two-term``.

    The part before the slash must be in `allowed`.
    """
    only = names(text)
    for each in only:
        if each.partition("/")[0] not in allowed:
            raise unknown(what, each.partition("/")[0], allowed, "--only")
    return only


def chosen_scene(options: argparse.Namespace, **allowed: bool) -> Scene:
    """Return the scene of --case or --scene, changed by --omega, --step-size and --steps.

    `allowed` are flags of `checked_scene`.
    """
    if (options.case is None) == (options.scene is None):
        raise InputError("give either --case N (1 to 7) or --scene FILE")
    case = chosen_case(options)
    scene = read_scene(options.scene) if case is None else case_scene(case)
    changes: dict[str, Any] = {}
    if options.omega is not None:
        values = numbers(options.omega, "--omega")
        if len(values) != 3:
            raise InputError(f"--omega: {len(values)} numbers; allowed: three, as in 0,1,10")
        changes["omega"] = tuple(values)
    if getattr(options, "step_size", None) is not None:
        changes["step_size"] = number(options.step_size, "--step-size")
    if getattr(options, "steps", None) is not None:
        changes["steps"] = whole(options.steps, "--steps")
    warn_of_attitude(scene)
    scene = checked_scene(replace(scene, **changes), **allowed)
    if scene.is_impossible:
        warn("no rigid body has these moments: the largest exceeds the sum of the others")
    return scene


def warn_of_attitude(scene: Scene) -> None:
    if abs(scene.attitude_length - 1.0) > NEAR_ONE:
        norm = f"the norm {scene.attitude_length:.6g}"
        if math.isinf(scene.attitude_length):
            norm = f"a norm above {sys.float_info.max:.6g}"
        warn(f"the attitude has {norm}; it was normalised")


def chosen_programs(options: argparse.Namespace) -> tuple[str, ...]:
    check_known("program", options.program, PROGRAMS)
    return PROGRAMS if options.program is None else (options.program,)


def chosen_listing(options: argparse.Namespace) -> Listing:
    chosen_programs(options)
    listing = subset(options.program, options.listing, **changes_of(options))
    tell_inactive(options, [listing])
    return listing


def changes_of(options: argparse.Namespace) -> dict[str, Any]:
    """Return the names in --fix, --keep, --reading and --conjecture, as arguments of `subset`.

    Raise InputError for a change without meaning.
    """
    if options.listing == "corrected":
        refuse(options, "--listing corrected", ("fix",))
    fixed = {*names(options.fix)}
    for name in sorted({*names(options.keep)} - fixed):
        having = [each for each in chosen_programs(options) if name in names_of("defect", each)]
        # With names to fix and no --listing, the original program is changed.
        changed = options.listing is None and all(fixed & {*switchable(each)} for each in having)
        if having and (changed or options.listing == "original"):
            chosen = f"--listing {options.listing}" if options.listing else "--fix"
            raise InputError(f"--keep {name} has no meaning with {chosen}")
    found = {"fix": options.fix, "keep": options.keep, "readings": options.reading}
    assumed = None if options.conjecture is None else names(options.conjecture)
    return {**{each: names(text) for each, text in found.items()}, "conjectures": assumed}


def tell_inactive(options: argparse.Namespace, listings: Iterable[Listing]) -> None:
    """Warn of requested readings, conjectures and corrections that have no effect."""
    asked = {*names(options.reading), *names(options.conjecture)} - {"none"}
    active = {name for listing in listings for name in listing.active}
    for name in sorted(asked - active - set(names(options.fix))):
        warn(f"'{name}' has no effect on corrected statements; --keep {name} leaves it active")
    given, programs = changes_of(options), chosen_programs(options)
    found: set[str] = set()
    for program in programs:
        own = [name for name in given["readings"] if name in names_of("reading", program)]
        found |= subset(program, readings=own, conjectures=given["conjectures"]).active
    for name in sorted({*given["fix"]} - found):
        kind = "reading" if any(name in names_of("reading", p) for p in programs) else "conjecture"
        warn(
            f"--fix {name}: it is not active; allowed: with --{kind} "
            f"{name}, or one of {', '.join(sorted(found))}"
        )


def listing_text(listing: Listing) -> str:
    active = ", ".join(sorted(listing.defects)) or "no defects"
    more = {"readings": listing.readings, "conjectures": listing.conjectures}
    told = [f"; {what}: {', '.join(sorted(names))}" for what, names in more.items() if names]
    return f"{listing.label} listing: {active}{''.join(told)}"


def chosen_stops(options: argparse.Namespace) -> dict[str, Any]:
    """Return a run's arguments `lipschitz` (constant of the stop test, 1/s) and `may_stop`."""
    if options.program not in (None, "runge-kutta"):
        refuse(options, f"--program {options.program}", ("lipschitz", "no_stop"))
    if options.no_stop:
        refuse(options, "--no-stop", ("lipschitz",))
    limit = positive(options.lipschitz, "--lipschitz", facts("cases")["deck"]["lipschitz"])
    return {"lipschitz": limit, "may_stop": not options.no_stop}


def refuse(
    options: argparse.Namespace, chosen: str, names: Iterable[str], allowed: str = ""
) -> None:
    """Raise InputError if an option in `names` is specified together with `chosen`.

    Names are as in `options` ("no_stop") or OPTIONS ("--case N").
    """
    for name in names:
        option = name.partition(" ")[0].removeprefix("--").replace("_", "-")
        if getattr(options, option.replace("-", "_")):
            end = f"; allowed: {allowed}" if allowed else ""
            raise InputError(f"--{option} has no meaning with {chosen}{end}")


def names(text: str | None) -> list[str]:
    return [] if text is None else [name.strip() for name in text.split(",")]


def numbers(text: str, option: str) -> list[float]:
    return [number(part, option) for part in text.split(",")]


def number(text: str, option: str) -> float:
    try:
        value = parsed_float(text)
    except ValueError:
        raise InputError(f"{option}: '{text}' where a number belongs") from None
    if not math.isfinite(value):
        raise InputError(f"{option}: '{text}' is not finite; allowed: finite numbers")
    return value


def positive(text: str | None, option: str, default: float) -> float:
    if text is None:
        return default
    value = number(text, option)
    if value <= 0.0:
        raise InputError(f"{option}: {value:g}; allowed: a number above 0")
    return value


def whole(text: str, option: str) -> int:
    try:
        return parsed_whole(text)
    except ValueError:
        raise InputError(f"{option}: '{text}' where a whole number belongs") from None


def whole_up_to(most: int, text: str | None, option: str, default: int) -> int:
    count = default if text is None else whole(text, option)
    if not 1 <= count <= most:
        raise InputError(f"{option}: {count}; allowed: 1 to {most}")
    return count


def chosen_count(text: str | None, option: str, default: int, least: int, cost: Cost) -> int:
    """Return an option's number of draws, from `least` to `cost.most`, or the default.

    If the draws take long, print a forecast.
    """
    if text is None:
        return default
    count = whole(text, option)
    if not least <= count <= cost.most:
        shown = str(count) if abs(count) < 10**18 else "a number of more than 18 digits"
        longest = format_duration(cost.most * cost.seconds)
        raise InputError(
            f"{option}: {shown}; allowed: a whole number from {least} to {cost.most}, which takes "
            f"about {longest}"
        )
    seconds = count * cost.seconds
    if seconds > _WORTH_SAYING:
        took, memory = format_duration(seconds), max(1.0, count * cost.n_bytes / 1e6)
        say(f"pyharness: {count} {cost.what} take about {took} and {memory:.0f} MB of memory\n")
    return count


def warn(message: str) -> None:
    say(f"pyharness: warning: {message}\n")


def also_files(options: argparse.Namespace) -> dict[str, str]:
    found: dict[str, str] = {}
    for path in names(getattr(options, "also", None)):
        suffix = path[path.rfind(".") :] if "." in path else ""
        if suffix not in _BY_SUFFIX:
            raise InputError(
                f"--also '{path}': the name has no known ending; allowed: {', '.join(_BY_SUFFIX)}"
            )
        if path == options.out or any(_is_same(path, each) for each in found):
            raise InputError(f"--also '{path}': the file is given twice; give another name")
        found[path] = _BY_SUFFIX[suffix]
    return found


def check_outputs(options: argparse.Namespace) -> None:
    """Raise InputError if an output file cannot be written, or is an input or another output."""
    also = also_files(options)
    for path in also:
        check_writable(path, "--also")
    files = [(path, "--also", "the result") for path in also]
    picture = getattr(options, "plot", None)
    if picture is not None:
        from pyharness.views.pictures import check_picture, numbers_beside

        check_picture(picture)
        pair = ((picture, "the picture"), (numbers_beside(picture), "its numbers"))
        for path, what in pair:
            check_writable(path, "--plot")
            files.append((path, "--plot", what))
    for name, what in _MORE_OUTPUTS.items():
        if getattr(options, name, None) is not None:
            files.append((getattr(options, name), f"--{name}", what))
    if options.out is not None:
        check_writable(options.out, "--out")
        for path, option, what in files:
            if _is_same(path, options.out):
                named = picture if option == "--plot" else path
                raise InputError(
                    f"--out '{options.out}': {option} '{named}' writes {what} to this file; "
                    "give another name"
                )
        files.append((options.out, "--out", ""))
    inputs = [getattr(options, name, None) for name in _INPUTS]
    for read in [*filter(None, inputs), *names(getattr(options, "check", None))]:
        for path, option, _ in files:
            # Input and output may be the same device, such as a terminal.
            if os.path.isfile(read) and _is_same(path, read):
                raise InputError(
                    f"{option} '{path}': is the input file '{read}'; give another name"
                )


def _is_same(one: str, other: str) -> bool:
    if os.path.isfile(one) and os.path.isfile(other):
        return os.path.samefile(one, other)
    return "\0" not in one + other and os.path.realpath(one) == os.path.realpath(other)


def without_out(options: argparse.Namespace) -> argparse.Namespace:
    """Return the options without --out, for verbs where it names a folder."""
    return argparse.Namespace(**{**vars(options), "out": None})


def show(
    report: Report,
    options: argparse.Namespace,
    own: Mapping[str, Callable[[], str | bytes]] | None = None,
    failed: object = False,
) -> int:
    """Write the outputs of --format, --plot and --also; return 1 if `failed`, else 0.

    `own` has functions for formats that only this report has.
    """
    from pyharness.views.render import render

    end_progress()
    form = options.format or FORMATS[0]
    content = own[form]() if own and form in own else render(report, form)
    if getattr(options, "plot", None) is not None:
        from pyharness.views.pictures import saved

        assert report.pictures is not None
        (draw,) = report.pictures.values()
        write_files(saved(draw(), options.plot), "--plot")
    texts = {path: shown(render(report, kind)) for path, kind in also_files(options).items()}
    write_files({path: text.encode() for path, text in texts.items()}, "--also")
    emit(content, options.out)
    return 1 if failed else 0


def emit(content: str | bytes, out: str | None) -> None:
    if out is not None:
        data = content if isinstance(content, bytes) else shown(content).encode()
        write_files({out: data}, "--out")
        return
    # If the reader closed the pipe, as `grep -q` does, keep the command's exit status.
    with suppress(BrokenPipeError):
        if isinstance(content, bytes):
            sys.stdout.buffer.write(content)
        else:
            write_text(sys.stdout, content)
