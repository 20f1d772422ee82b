"""Write the constants that Python and the kernels share: make_codes.py SOURCE FOLDER.

Each class becomes a Fortran module in a file of its own, because Meson records one module per file.
C code gets a header, codes.h. A file is written only if it changes, so that only its users are
compiled again.
"""

import runpy
import sys
from collections.abc import Iterator
from pathlib import Path


def written(source: str) -> dict[str, str]:
    """Return the texts of the files by name, for the classes in pyharness/model/codes.py."""
    classes = {
        name: {each: value for each, value in vars(codes).items() if each.isupper()}
        for name, codes in runpy.run_path(source).items()
        if isinstance(codes, type)
    }
    texts = {
        f"{name.lower()}.f90": "\n".join(_module(name.lower(), numbers))
        for name, numbers in classes.items()
    }
    # The other statuses include OVERFLOW, a macro of some math.h.
    for_c = classes["Operations"] | classes["Storage"]
    for_c["COMPLETE"] = classes["Statuses"]["COMPLETE"]
    listed = ", ".join(f"{name} = {value}" for name, value in for_c.items())
    return texts | {"codes.h": f"enum {{ {listed} }};"}


def _module(name: str, numbers: dict[str, int | float]) -> Iterator[str]:
    yield f"module {name}"
    yield "  !! Written by fortran/make_codes.py; pyharness/model/codes.py says what is what."
    if any(isinstance(value, float) for value in numbers.values()):
        yield "  use, intrinsic :: iso_fortran_env, only: real64"
    yield "  implicit none(type, external)"
    yield "  private"
    for each, value in numbers.items():
        if isinstance(value, float):
            yield f"  real(real64), parameter, public :: {each} = {value!r}_real64"
        else:
            yield f"  integer, parameter, public :: {each} = {value}"
    yield f"end module {name}"


def main(source: str, folder: str) -> None:
    """Write the files that have changed, or are missing, to `folder`."""
    for name, text in written(source).items():
        target = Path(folder, name)
        if not target.exists() or target.read_text() != f"{text}\n":
            target.write_text(f"{text}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
