"""A campaign of random inputs: `python -m tests.campaigns.fuzz --inputs 100000 --seed 1`.

Every input is generated from a seed, its kind and its number. A worker process tries it, so that a
crash or an endless loop is found, counted and named like any other fault. To repeat one input:
`python -m tests.campaigns.fuzz --seed 1 --kind method --number 123`.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random

from tests.campaigns.fuzz.checks import KINDS, LONGEST, tried

# Of a thousand inputs: many cheap ones, and few whole processes.
SHARES = {
    "scene-file": 350, "program": 200, "method": 10, "prepared": 180, "listing": 150,
    "command": 107, "process": 3,
}  # fmt: skip
_BLOCK = 250
PATIENCE = 10.0 * LONGEST  # s, on a machine that may be busy with other work


def main() -> int:
    """Run the campaign, a block of it, or one input; return exit status 1 if there were faults."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=tuple(KINDS), help="this kind only")
    parser.add_argument("--number", type=int, help="this input only")
    parser.add_argument("--until", type=int, help="and those up to here, for a worker")
    options = parser.parse_args()
    if options.number is None:
        return _campaign(options.seed, options.inputs, options.kind)
    if options.until is None:
        given = made(options.kind, options.seed, options.number)
        print(given)
        with tempfile.TemporaryDirectory() as folder:
            tried(options.kind, given, Path(folder))
        return 0
    _work(options.kind, options.seed, options.number, options.until)
    return 0


def made(kind: str, seed: int, number: int) -> object:
    """Return an input, which depends only on its kind, its seed and its number."""
    return KINDS[kind].make(Random(f"{kind} {seed} {number}"))


def _work(kind: str, seed: int, begin: int, end: int) -> None:
    """Try a block of inputs; write the number of each, and its faults, to the pipe."""
    pipe = os.fdopen(os.dup(1), "w", buffering=1)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(begin, end):
            pipe.write(f"at {number}\n")
            # The signal ends a worker that hangs.
            signal.setitimer(signal.ITIMER_REAL, PATIENCE)
            try:
                tried(kind, made(kind, seed, number), Path(folder))
            except AssertionError as error:
                text = str(error).replace("\n", "\\n")
                pipe.write(f"fault {number} {text}\n".encode(errors="backslashreplace").decode())
        pipe.write("done\n")


def _campaign(seed: int, inputs: int, only: str | None) -> int:
    counts: Counter[str] = Counter()
    faults: list[str] = []
    lock = threading.Lock()

    def block(job: tuple[str, int, int]) -> None:
        kind, begin, end = job
        while begin < end:
            begin, found = _watched(kind, seed, begin, end)
            with lock:
                for each in found:
                    faults.append(each)
                    print(each, flush=True)
        with lock:
            counts[kind] += end - job[1]
            if sys.stderr.isatty():
                sys.stderr.write(f"\r{sum(counts.values())} inputs, {len(faults)} faults ")

    shares = {only: 1000} if only else SHARES
    jobs = []
    for kind, share in shares.items():
        size = inputs * share // sum(shares.values())
        jobs += [(kind, i, min(i + _BLOCK, size)) for i in range(0, size, _BLOCK)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(block, jobs))
    for kind, count in counts.items():
        print(f"{kind:12s}{count:8d}")
    print(f"{'all':12s}{sum(counts.values()):8d} inputs, seed {seed}: {len(faults)} faults")
    return 1 if faults else 0


def _watched(kind: str, seed: int, begin: int, end: int) -> tuple[int, list[str]]:
    """Run a worker until it ends or dies; return the next number, and the faults."""
    command = [sys.executable, "-m", "tests.campaigns.fuzz", "--kind", kind, "--seed", str(seed)]
    number = begin
    faults: list[str] = []

    def fault(what: str) -> None:
        faults.append(f"FAULT --seed {seed} --kind {kind} --number {number}: {what}")

    try:
        done = subprocess.run(
            [*command, "--number", str(begin), "--until", str(end)], capture_output=True,
            check=False, timeout=PATIENCE * (end - begin + 2),
        )  # fmt: skip
    except subprocess.TimeoutExpired:  # before the first input, or after the last one
        fault("the worker neither began nor ended")
        return end, faults
    for line in done.stdout.decode().splitlines():
        word, _, text = line.partition(" ")
        if word == "done":
            return end, faults
        if word == "at":
            number = int(text)
        elif word == "fault":
            fault(text.partition(" ")[2])
    if done.returncode == -signal.SIGALRM:
        fault(f"no end within {PATIENCE:g} s")
    else:
        said = done.stderr.decode(errors="replace")[-600:]
        fault(f"the worker ended with {done.returncode}: {said}")
    return number + 1, faults
