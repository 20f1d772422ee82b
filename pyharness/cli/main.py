"""The command line: find the verb, let it run, turn what went wrong into one line."""

import gc
import os
import sys
from collections.abc import Sequence

from pyharness.cli import say
from pyharness.cli.interruption import came, report
from pyharness.model.errors import InputError, NotBuiltError, unknown

# Each verb is a module of pyharness.cli.verbs, loaded when it is called for.
VERBS = {
    "compare": "original against corrected, Fortran against Python, all against the truth",
    "run": "one trajectory: a program of the appendix, or a method",
    "cards": "the text of the edition, card by card: scan, port, twin, apparatus",
    "deck": "a program as a deck of cards, in fixed-form FORTRAN",
    "defects": "the apparatus: every defect and reading, the evidence, and its effect",
    "limits": "what the original programs tend to as the step goes to zero",
    "figures": "Figures 6 to 12 of the thesis, original and corrected: SVG, PNG, CSV",
    "claims": "statements of the thesis by kind, judged for the programs as printed and corrected",
    "family": "the weighted residual methods: orders derived, and orders measured",
    "plan": "what a scene needs, what is therefore not computed, and why",
    "rotations": "the steady rotations of a scene, their stability, and the time between flips",
    "words": "the programs in words of any length and rounding, those of the CDC among them",
    "bench": "run time against error: ours, the programs, and other people's integrators",
    "sweep": "a grid of scenes, solved here or by a cluster, in a store that resumes",
    "verify": "bits between languages, error against the truth, and what changed since recorded",
    "stress": "numerical stability tried to breaking, each trial with a bound derived beforehand",
    "edition": "all of it as pages: a static site in which the programs run",
    "doctor": "what is built, with what, and what is missing",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code.

    0 as expected; 1 an unexpected difference; 2 wrong usage or input; 3 the extension is not
    built; 130 interrupted.
    """
    # A command is short: collecting cycles while rooms are imported costs 4 % and frees nothing.
    gc.set_threshold(100_000)
    # No matrix here is worth a second thread, and starting a pool of them costs a seventh of
    # `compare`. It counts only where NumPy is not imported yet.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if sys.stderr is None:  # closed by the caller, as in 2>&-
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115  (as long as the process)
    if sys.stdout is None:
        return _complain("standard output is closed", 2)
    try:
        try:
            return _run(list(sys.argv[1:] if arguments is None else arguments))
        finally:
            sys.stdout.flush()
    except InputError as error:
        return _complain(str(error), 2)
    except NotBuiltError as error:
        return _complain(str(error), 3)
    except MemoryError:
        return _complain("not enough memory; take fewer steps", 2)
    except BrokenPipeError:
        # The reader has seen enough.
        _leave_stdout()
        return 0
    except OSError as error:
        _leave_stdout()
        return _complain(f"standard output: {error.strerror or error}", 2)
    except KeyboardInterrupt:
        return report()


def _run(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help"):
        lines = ["usage: pyharness VERB [options]; pyharness VERB --help tells the options", ""]
        lines += [f"  {verb:10s}{description}" for verb, description in VERBS.items()]
        sys.stdout.write("\n".join(lines) + "\n")
        return 0
    verb, *rest = arguments
    if verb == "--version":
        from pyharness import __version__

        sys.stdout.write(f"pyharness {__version__}\n")
        return 0
    if verb not in VERBS:
        raise unknown("verb", verb, VERBS)
    from pyharness.cli.options import Parser

    parser = Parser(verb, VERBS[verb])
    code: int = parser.module.run(parser.read(verb, rest))
    return code


def _leave_stdout() -> None:
    # Python would try once more when it closes the stream, and complain.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(message: str, code: int) -> int:
    if came():
        # An interrupt may turn into another error on its way here.
        return report()
    line = " ".join(message.split())
    say(f"pyharness: {line}\n")
    return code
