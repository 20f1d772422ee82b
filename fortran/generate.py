"""Write generated sources: generate.py KIND DEPFILE FOLDER TARGET ARGUMENT...

A file is written only if it changes, so that only its users are compiled again. DEPFILE then says
that TARGET, an output, depends on all files of the project that this process has read.
"""

import importlib
import sys
from collections.abc import Iterable
from importlib.util import source_from_cache
from os import path
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SOURCES = tuple(f"{ROOT}/{folder}/" for folder in ("fortran", "pyharness"))
# Each has a function `texts`, which returns the contents of files by name.
KINDS = {
    "tables": ("make_codes", "make_gauss", "make_fixed_steps", "make_cases", "make_leaves"),
    "words": ("make_words",),
    "hot": ("unroll",),
}


def main(kind: str, depfile: str, folder: str, target: str, *arguments: str) -> None:
    """Write the files of a kind that have changed, or are missing."""
    opened: set[str] = set()

    def watch(event: str, given: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(given[0], str):
            opened.add(given[0])

    sys.addaudithook(watch)
    sys.dont_write_bytecode = True
    # The finder of an editable installation, an instance, would start a build.
    sys.meta_path[:] = [each for each in sys.meta_path if isinstance(each, type)]
    sys.path[1:1] = [str(ROOT), str(ROOT / "fortran/modern")]
    written: dict[str, str] = {}
    for name in KINDS[kind]:
        written |= importlib.import_module(name).texts(*arguments)
    needed = list(_project_files(opened))
    write(Path(folder), written)
    names = (path.relpath(each).replace(" ", "\\ ") for each in sorted(needed))
    Path(depfile).write_text(f"{target}: {' '.join(names)}\n")


def write(folder: Path, texts: dict[str, str]) -> None:
    """Write the files that have changed, or are missing."""
    for name, text in texts.items():
        file = folder / name
        if not file.exists() or file.read_text() != text:
            file.write_text(text)


def _project_files(opened: Iterable[str]) -> Iterable[str]:
    loaded = (getattr(module, "__file__", None) for module in [*sys.modules.values()])
    for name in {*opened, *filter(None, loaded)}:
        source = path.abspath(name)
        if source.startswith(SOURCES):
            yield source_from_cache(source) if source.endswith(".pyc") else source


if __name__ == "__main__":
    main(*sys.argv[1:])
