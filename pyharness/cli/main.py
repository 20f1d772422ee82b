"""The entry point: parse and run a command (verb), and report errors in one line."""

import gc
import os
import sys
from collections.abc import Sequence

from pyharness.cli import say
from pyharness.cli.interruption import came, report
from pyharness.model.errors import InputError, NotBuiltError, unknown

# The verbs in the order of the overview; each is a module of pyharness.cli.verbs.
_GROUPS = {
    "for everyone": {
        "compare": "compare original and corrected programs with the true solution",
        "run": "compute one trajectory by a program of the thesis or another method",
        "plan": "show which computations a scene requires, and which are omitted",
        "scene": "write or check a scene file, or print the schema of scene files",
        "doctor": "report versions, the build and missing packages, for bug reports",
    },
    "the thesis": {
        "claims": "judge the statements of the thesis by runs of its programs",
        "figures": "redraw Figures 6 to 12 of the thesis with original and corrected programs",
        "cards": "show program lines (cards) with their scan, our Fortran and Python, and notes",
        "defects": "list defects and doubtful lines of the programs, and their effects",
        "deck": "write a program of the thesis as a deck of FORTRAN cards",
        "limits": "show what the original programs converge to as the step size goes to 0",
        "family": "derive and measure convergence orders of weighted residual methods",
        "words": "run the programs in the arithmetic of CDC computers and in other precisions",
    },
    "rigid bodies": {
        "rotations": "find steady rotations, their stability, and the time between flips",
        "prove": "compute intervals that provably contain the true solution; check certificates",
        "sweep": "solve a grid of scenes, locally or on a cluster; store the results",
    },
    "checks and publication": {
        "verify": "check the thesis programs, your port of them, our methods, or your integrator",
        "agree": "compare any programs, such as FORTRAN and its port, cell by cell",
        "stress": "test every method in extreme scenes against bounds from theory",
        "bench": "measure run times and errors of our solvers and of third-party solvers",
        "edition": "write the annotated programs as a web site or as plain data",
    },
}
VERBS = {verb: about for group in _GROUPS.values() for verb, about in group.items()}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line, by default this process's; return the exit status.

    Status 1 is for unexpected results, such as failed checks.
    """
    # Garbage collection during imports takes 4 % of a command's time and frees nothing.
    gc.set_threshold(100_000)
    # The package's matrices are too small for a second thread, and the start of a thread pool takes
    # a seventh of the time of `compare`. Set the variable before NumPy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if sys.stderr is None:  # closed by the caller, as in 2>&-
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115  (as long as the process)
    if sys.stdout is None:
        return _complain("standard output is closed", 2)
    code = 0
    try:
        try:
            if "_ARGCOMPLETE" in os.environ:
                return _complete()
            code = _run(list(sys.argv[1:] if arguments is None else arguments))
        finally:
            sys.stdout.flush()
        return code
    except InputError as error:
        return _complain(str(error), 2)
    except NotBuiltError as error:
        return _complain(str(error), 3)
    except MemoryError:
        return _complain("not enough memory; use fewer steps", 2)
    except BrokenPipeError:
        # The reader of the pipe closed it, as `head` does.
        _leave_stdout()
        return code
    except OSError as error:
        _leave_stdout()
        return _complain(f"standard output: {error.strerror or error}", 2)
    except KeyboardInterrupt:
        return report()


def _run(arguments: list[str]) -> int:
    verb, *rest = arguments or ["--help"]
    if verb == "help" and rest[:1] == ["json"]:
        if len(rest) != 2 or rest[1] not in VERBS:
            raise InputError(f"help json: give one verb; allowed: {', '.join(VERBS)}")
        from pyharness.cli.json_help import json_help

        sys.stdout.write(json_help(rest[1]))
        return 0
    if verb == "help" and len(rest) > 1:
        raise InputError(f"help {rest[0]}: '{rest[1]}' has no meaning; give one verb")
    if verb == "help":
        verb, rest = (*rest, "--help")[0], ["--help"]
    if verb in ("-h", "--help"):
        sys.stdout.write(_overview())
        return 0
    if verb == "--version":
        from pyharness import __version__

        sys.stdout.write(f"pyharness {__version__}\n")
        return 0
    if verb not in VERBS:
        raise unknown("verb", verb, VERBS)
    from pyharness.cli.parser import Parser

    parser = Parser(verb, VERBS[verb])
    if {"-h", "--help"} & {*rest}:
        sys.stdout.write(parser.format_help())
        return 0
    code: int = parser.module.run(parser.read(verb, rest))
    return code


def _complete() -> int:
    """Print completions for the shell; return 1 if argcomplete is missing."""
    from argparse import ArgumentParser

    try:
        import argcomplete
    except ImportError:  # argcomplete is installed for the shell, but not in this environment
        return 1
    line, first = os.environ["COMP_LINE"], int(os.environ["_ARGCOMPLETE"])
    # An argument is complete only if a blank follows.
    typed = f"{line[: int(os.environ['COMP_POINT'])]}|".split()[:-1]
    verb = typed[first] if len(typed) > first else ""
    parser = ArgumentParser("pyharness", add_help=False)
    if verb in VERBS:
        from pyharness.cli.parser import Parser

        parser = Parser(verb, VERBS[verb])
    else:
        parser.add_argument("verb", choices=[*VERBS] if verb == "help" else [*VERBS, "help"])
    if verb in (*VERBS, "help"):
        os.environ["_ARGCOMPLETE"] = str(first + 1)
    argcomplete.autocomplete(parser)
    return 0


def _overview() -> str:
    lines = ["usage: pyharness VERB [options]", "       pyharness help VERB"]
    lines.append("       pyharness help json VERB    explains the fields of --format json")
    lines += ["", "Rotation of rigid bodies, and three FORTRAN programs of a thesis of 1982."]
    for title, verbs in _GROUPS.items():
        lines += ["", f"{title}:", *(f"  {verb:10s}{about}" for verb, about in verbs.items())]
    lines += ["", "example:", "  pyharness compare --case 3"]
    return "\n".join(lines) + "\n"


def _leave_stdout() -> None:
    # Prevents Python from flushing the stream at exit and reporting the error again.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(message: str, code: int) -> int:
    if came():
        # The interrupted code may have replaced KeyboardInterrupt by another exception.
        return report()
    line = " ".join(message.split())
    say(f"pyharness: {line}\n")
    return code
