"""`make mutate`: put one fault at a time into a copy of the checkout, and see what catches it.

Nothing in the checkout is changed but the record, and that only by --update. 0 where every row is
caught, or has a reason why it is not.
"""

import argparse
import signal
import sys
import tempfile
import time
import zlib
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Lock

from tests.mutations.table import Row, chosen, page, rows, update
from tests.mutations.tree import Processes, Stopped, Tree
from tests.mutations.trial import Verdict, attempt, false_killers

# Two of each language, from rooms far apart, that one short test each catches.
CI = (
    "fortran/modern/taylor_series/rescaled-sum",
    "fortran/original/runge_kutta/second-stage-base",
    "pyharness/compare/agreement/tolerance-sense",
    "pyharness/model/scene_file/inertia-order",
)
FEW = 4


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the rows asked for, and say what became of each."""
    options = _options(arguments)
    table = rows()
    asked = [row for row in table if row.id in CI] if options.ci else chosen(table, options.rows)
    if not options.ci and not options.rows and options.survivors == "skip":
        asked = [row for row in asked if row.lives is None]
    if not asked:
        print(f"{' '.join(options.rows)}: no such row", file=sys.stderr)
        return 2
    if options.page:
        print(page(table), end="")
        return 0
    begin = time.perf_counter()
    processes = Processes()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
            verdicts = _all(asked, options, Path(folder), processes)
    except KeyboardInterrupt:
        print("interrupted: the checkout is as it was", file=sys.stderr)
        return 130
    return _score(verdicts, time.perf_counter() - begin)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutations", description=__doc__)
    parser.add_argument("rows", nargs="*", help="parts of names, * for anything (default: all)")
    parser.add_argument("--jobs", type=int, default=2, help="side by side (default 2)")
    parser.add_argument(
        "--survivors", choices=("skip", "near", "all"), default="near",
        help="what rows with a reason to live are tried with (default: the tests near to them)",
    )  # fmt: skip
    parser.add_argument("--all-checks", action="store_true", help="forget what caught them before")
    parser.add_argument("--update", action="store_true", help="write down what caught each")
    parser.add_argument("--page", action="store_true", help="show the score of the record and end")
    parser.add_argument("--ci", action="store_true", help="four rows, for the gate")
    return parser.parse_args(arguments)


def _all(
    asked: list[Row], options: argparse.Namespace, folder: Path, processes: Processes
) -> list[Verdict]:
    """Try them, some side by side; one job begins with what is compiled, the next with the rest."""
    if options.all_checks:
        asked = [replace(row, killer=None) for row in asked]
    # In an order that has nothing to do with the outcome: those tried first are a fair sample.
    queue = deque(sorted(asked, key=lambda row: (not row.compiled, zlib.crc32(row.id.encode()))))
    known = [row.killer for row in asked if row.killer]
    unchanged = Tree(folder / "unchanged", processes)
    lock = Lock()
    verdicts: list[Verdict] = []

    def work(job: int) -> None:
        tree = Tree(folder / str(job), processes)
        if job == 0 and (false := false_killers(unchanged, known)):
            raise SystemExit(f"fails though nothing is changed: {', '.join(false)}")
        while True:
            with lock:
                # For the last few a build of its own does not pay.
                if not queue or (job and queue[-1].compiled and len(queue) <= FEW):
                    return
                row = queue.popleft() if job % 2 == 0 else queue.pop()
            begin = time.perf_counter()
            killer = attempt(tree, unchanged, row, options.survivors if row.lives else "all")
            verdict = Verdict(row, killer, time.perf_counter() - begin)
            with lock:
                verdicts.append(verdict)
                _say(verdict)
                if options.update:
                    update({row.id: killer})

    with ThreadPoolExecutor(options.jobs) as pool:
        jobs = [pool.submit(work, job) for job in range(min(options.jobs, len(queue)))]
        try:
            for each in jobs:
                each.result()
        except BaseException as stop:
            processes.end()
            queue.clear()
            if isinstance(stop, Stopped):
                raise KeyboardInterrupt from stop
            raise
    return verdicts


def _say(verdict: Verdict) -> None:
    row = verdict.row
    if verdict.killer:
        what = f"caught  {verdict.seconds:6.1f} s  {row.id}: {verdict.killer}"
        what += "  (it had a reason to live)" if row.lives else ""
    else:
        what = f"LIVES   {verdict.seconds:6.1f} s  {row.id}: {row.lives or 'and should not'}"
    print(what, flush=True)


def _score(verdicts: list[Verdict], seconds: float) -> int:
    caught = sum(v.killer is not None for v in verdicts)
    alive = [v.row.id for v in verdicts if v.killer is None and v.row.lives is None]
    print(
        f"{caught} of {len(verdicts)} caught ({100.0 * caught / max(1, len(verdicts)):.1f} %), "
        f"{len(verdicts) - caught - len(alive)} live for a reason, {len(alive)} without; "
        f"{seconds / 60.0:.1f} min"
    )
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main())
