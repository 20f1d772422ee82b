"""The check that a compiler leaves arithmetic as it is written.

The build makes it, and `leaf_cache.py` for the torques that it compiles. A library is loaded in
another process, since loading can change the arithmetic of the whole process.
"""

import sys
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

REFUSED = (
    "-Ofast", "-ffast-math", "-funsafe-math-optimizations", "-ffinite-math-only",
    "-freciprocal-math", "-fno-signed-zeros", "-fdefault-real-8", "-fassociative-math",
    "-fcx-limited-range", "-fsingle-precision-constant", "-mrecip*", "-mdaz-ftz",
    "-mfpmath=*387*", "-mfpmath=both",
    # Numbers of other kinds than the sources declare.
    "-fdefault-real-1*", "-fdefault-double-*", "-fdefault-integer-*", "-freal-*-real-*",
    "-finteger-*-integer-*",
    # Clang and flang, then Intel.
    "-fapprox-func", "-fno-honor-nans", "-fno-honor-infinities", "-fdenormal-fp-math=p*",
    "-ffp-model=fast", "-ffp-model=aggressive", "-fp-model=fast*", "-ftz",
)  # fmt: skip
"""Options that change the arithmetic, as patterns; some do so only beside others."""

PROBE = """
int arithmetic_faults(const volatile double *numbers)
{
  const double five = numbers[0], nan = numbers[2], tiny = numbers[3], big = 0.25 / tiny;
  const double zero = -numbers[1] + 0.0, product = five * 0.1 * 3.0;
  const float three = (float)(0.6 * five);
  const _Complex double z = big * (1.0 + 1.0i), one = z / z;
  return five * 0.1 != 0.5 || product != 1.5 || five / 3.0 != 5.0 / 3.0 ||
         1.0f / three != 1.0f / 3.0f || __builtin_copysign(1.0, zero) < 0.0 || nan == nan ||
         32.0 * big != __builtin_inf() || !(0.5 * tiny > 0.0) || __real__ one != 1.0;
}
"""
"""C code; its result is 0 if all operations are done as written."""

SHARED = ("-fPIC", "-shared")
MOST_SECONDS = 60.0  # of a compilation
_CHANGED = 77  # exit status
_CALL = f"""
import ctypes, sys
numbers = (ctypes.c_double * 4)(5.0, 0.0, float("nan"), sys.float_info.min)
sys.exit(ctypes.CDLL(sys.argv[1]).arithmetic_faults(numbers) and {_CHANGED})
"""


class UncheckedError(Exception):
    """A failure to compile or load the probe, with the reason in one line."""


def check_options(command: Sequence[str]) -> str | None:
    """Return why a compiler's options are refused, in one line, or None."""
    words = dict.fromkeys(command)
    named = [each for each in words if any(fnmatchcase(each, some) for some in REFUSED)]
    return _refusal(command, ", ".join(named)) if named else None


def check_library(command: Sequence[str], library: Path) -> str | None:
    """Return why a library with `arithmetic_faults`, made by `command`, is refused, or None."""
    status, error = run([sys.executable, "-I", "-S", "-c", _CALL, str(library)])
    if status == _CHANGED:
        return _refusal(command, f"options such as {', '.join(REFUSED[:7])}")
    if status:
        reason = (error.splitlines() or [f"exit status {status}"])[-1]
        raise UncheckedError(f"what '{_said(command)}' compiles can't be loaded: {reason}")
    return None


def check_compiler(command: Sequence[str], source: Path | None = None) -> str | None:
    """Return why a compiler with its options is refused, or None; `source` replaces `PROBE`."""
    from tempfile import TemporaryDirectory

    if fault := check_options(command):
        return fault
    with TemporaryDirectory() as folder:
        library = Path(folder, "probe.so")
        if source is None:
            source = Path(folder, "probe.c")
            source.write_text(PROBE)
        status, error = run([*command, *SHARED, str(source), "-o", str(library)])
        if status:
            reason = " ".join(error.split()) or f"exit status {status}"
            return f"'{_said(command)}' does not compile {source.name}: {reason}"
        return check_library(command, library)


def run(command: Sequence[str]) -> tuple[int, str]:
    """Return exit status and error output of a command, which may be missing or hang."""
    import subprocess

    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=MOST_SECONDS
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return 1, str(error)
    return done.returncode, done.stderr


def _refusal(command: Sequence[str], options: str) -> str:
    return f"'{_said(command)}' changes the arithmetic: leave out {options}"


def _said(command: Sequence[str]) -> str:
    return " ".join(dict.fromkeys(command))
