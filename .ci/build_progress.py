"""Print how far a build is, until it or its parent ends: build_progress.py FOLDER.

FOLDER is where ninja builds; it may be a pattern.
"""

import os
import re
import sys
import time
from collections.abc import Iterator
from glob import glob
from pathlib import Path

# Shares of the processor time: the part of an object's name, seconds on one machine. The first part
# that is found counts, and of the seconds only the ratios.
COSTS = {
    "ready_leaves": 10.0, "taylor_terms_": 8.0, "tape_lanes": 2.5, "tape_perturbations": 2.5,
    "tape_variations": 1.5, "tape_terms": 1.0, "_kernelsmodule": 3.5, "tapes_": 18.0,
    "bodies_": 16.0, "hot_": 7.0, "many_": 1.5,
}  # fmt: skip
OTHERS = 0.4
_BUILT = re.compile(r"^build ((?:\\.|[^:\n])*?): (?!phony)(\w+)", re.MULTILINE)


def edges(folder: Path) -> dict[str, str]:
    """Return the first output of each step of the build, by all of its outputs."""
    found = {}
    for outputs, rule in _BUILT.findall((folder / "build.ninja").read_text()):
        names = [each for each in outputs.split() if each != "|"]
        # meson's own targets, such as for an installation, are no files.
        if rule not in ("REGENERATE_BUILD", "SHSYM") and "." in names[0]:
            found |= dict.fromkeys(names, names[0])
    return found


def cost(output: str) -> float:
    """Return the expected processor time of a step, in seconds of one machine."""
    name = os.path.basename(output) if output.endswith(".o") else ""
    return next((s for part, s in COSTS.items() if part in name), OTHERS)


def finished(folder: Path, steps: dict[str, str]) -> dict[str, float]:
    """Return the run time (s) of each finished step, by its first output."""
    found = {}
    with open(folder / ".ninja_log") as log:
        for line in log:
            words = line.split("\t")
            if len(words) == 5 and words[3] in steps:
                found[steps[words[3]]] = (int(words[1]) - int(words[0])) / 1000
    return found


def describe(folder: Path, jobs: int, elapsed: float) -> str:
    """Return a line: the number of steps done and in all, and the time left, if it is known.

    The speed is that of the finished steps; `jobs` run at a time.
    """
    steps = edges(folder)
    done, names = finished(folder, steps), {*steps.values()}
    text = f"compiling {len(done)} of {len(names)}"
    expected = sum(map(cost, done))
    if expected < 0.05 * sum(map(cost, names)):
        return text
    whole = sum(done.values()) / expected * sum(map(cost, names)) / jobs
    return f"{text}, about {max(1, round(whole - elapsed))} s left"


def watch(pattern: str, seconds: float) -> Iterator[str]:
    """Yield a line whenever `seconds` have passed, once something is being compiled."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    jobs = min(cores or 1, 2) + 1 if (cores or 1) < 3 else (cores or 1) + 2  # as ninja
    parent = os.getppid()
    while os.getppid() == parent:
        time.sleep(seconds)
        for log in glob(f"{pattern}/.ninja_log"):
            begin = os.stat(f"{Path(log).parent}/build.ninja").st_mtime
            try:
                yield describe(Path(log).parent, jobs, time.time() - begin)
            except OSError:  # the folder of a finished build may be gone
                continue


if __name__ == "__main__":
    is_terminal = sys.stderr.isatty()
    for line in watch(sys.argv[1], 1.0 if is_terminal else 15.0):
        sys.stderr.write(f"\r{line}\033[K" if is_terminal else f"set-up: {line}\n")
        sys.stderr.flush()
