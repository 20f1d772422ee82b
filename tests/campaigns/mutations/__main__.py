"""`make mutate`: change one line at a time in a copy of the checkout, and see which check fails.

Exit status 0 if enough mutations were caught, 1 if not, 2 for wrong usage, 130 if interrupted.
"""

import argparse
import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Lock

from tests.campaigns.mutations.ci import run_planted
from tests.campaigns.mutations.reach import reach
from tests.campaigns.mutations.sample import Mutation, draw, equivalent, stale
from tests.campaigns.mutations.tree import PLACE, Processes, Stopped, Tree
from tests.campaigns.mutations.trial import Verdict, attempt

ENOUGH = 0.85
COUNTED = ("caught", "lives", "equivalent", "same binary")


def main(arguments: Sequence[str] | None = None) -> int:
    """Try a sample of mutations and report the outcome of each."""
    options = _options(arguments)
    processes = Processes()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if options.ci:
        return run_planted(processes)
    try:
        next(draw(options.seed, options.only))
    except ValueError as error:
        print(f"--only: {error}", file=sys.stderr)
        return 2
    if entries := stale(equivalent()):
        print(
            "\n".join(["equivalent.toml names no change that there is:", *entries]), file=sys.stderr
        )
        return 2
    begin = time.perf_counter()
    verdicts: list[Verdict] = []
    try:
        _all(options, processes, verdicts)
    except (KeyboardInterrupt, Stopped):
        print(table(verdicts))
        print("interrupted: the same command continues from here", file=sys.stderr)
        return 130
    print(table(verdicts))
    score = caught_share(verdicts)
    slow = sum(each.outcome == "caught" and not each.is_fast for each in verdicts)
    print(f"score {100.0 * score:.1f} %, {slow} by campaigns or verify alone")
    print(f"{(time.perf_counter() - begin) / 60.0:.0f} min")
    return 0 if score >= ENOUGH else 1


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.campaigns.mutations", description=__doc__
    )
    parser.add_argument("--sample", type=int, default=300, help="how many (default: 300)")
    parser.add_argument("--seed", default="1", help="of the draw (default: 1)")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time (default: 2)")
    only = "files with one of these texts, separated by commas, in their names alone"
    parser.add_argument("--only", default="", help=only)
    parser.add_argument("--again", action="store_true", help="try once more those that lived")
    parser.add_argument("--ci", action="store_true", help="four planted faults alone, for the gate")
    return parser.parse_args(arguments)


def _all(options: argparse.Namespace, processes: Processes, verdicts: list[Verdict]) -> None:
    """Try the sample; use the recorded verdicts of the same draw."""
    checks = reach(processes, options.jobs)
    known = equivalent()
    record = Record(PLACE / f"seed-{options.seed}.json", options.again)
    unchanged = Tree("unchanged", processes)
    drawn = draw(options.seed, options.only)
    lock = Lock()

    def next_one() -> Mutation | None:
        # A draw that does not count is replaced: as many start as are still missing.
        with lock:
            counted = sum(each.outcome in COUNTED for each in verdicts) + len(running)
            if counted >= options.sample:
                return None
            mutation = next(drawn)
            running.add(mutation.file + mutation.id)
            return mutation

    running: set[str] = set()

    def work(job: int) -> None:
        tree = Tree(f"changed-{job}", processes)
        while (mutation := next_one()) is not None:
            begin = time.perf_counter()
            if (mutation.file, mutation.id) in known:
                found = Verdict(mutation, "equivalent", known[mutation.file, mutation.id])
            else:
                found = record.of(mutation) or attempt(mutation, tree, unchanged, checks)
            if not found.seconds:
                found = replace(found, seconds=round(time.perf_counter() - begin, 1))
            with lock:
                running.discard(mutation.file + mutation.id)
                verdicts.append(found)
                record.write(verdicts)
                print(_line(found, len(verdicts)), flush=True)

    with ThreadPoolExecutor(options.jobs) as pool:
        jobs = [pool.submit(work, job) for job in range(options.jobs)]
        try:
            for each in jobs:
                each.result()
        except BaseException:
            processes.end()
            raise


class Record:
    """The recorded verdicts of a seed, so that an interrupted run continues where it ended."""

    def __init__(self, path: Path, again: bool) -> None:
        self._path = path
        rows = json.loads(path.read_text())["mutations"] if path.exists() else []
        kept = [row for row in rows if not again or row["outcome"] != "lives"]
        self._rows = {(row["file"], row["id"]): row for row in kept}

    def of(self, mutation: Mutation) -> Verdict | None:
        """Return the recorded verdict, or None."""
        row = self._rows.get((mutation.file, mutation.id))
        # A mutation that was equivalent, and is no longer on the list, is tried.
        if row is None or row["outcome"] == "equivalent":
            return None
        return Verdict(mutation, row["outcome"], row["by"], row["seconds"], row["is_fast"])

    def write(self, verdicts: list[Verdict]) -> None:
        """Write these verdicts and the recorded ones."""
        rows = dict(self._rows)
        for each in verdicts:
            mutation = each.mutation
            rows[mutation.file, mutation.id] = {
                "file": mutation.file, "id": mutation.id, "line": mutation.line,
                "language": mutation.language, "operator": mutation.operator,
                "outcome": each.outcome, "by": each.by, "seconds": each.seconds,
                "is_fast": each.is_fast,
                "diff": mutation.diff(),
            }  # fmt: skip
        self._path.write_text(json.dumps({"schema": 1, "mutations": list(rows.values())}, indent=1))


def _line(verdict: Verdict, number: int) -> str:
    mutation = verdict.mutation
    said = f"{number:4} {verdict.outcome:18} {verdict.seconds:6.1f} s  {mutation.file}"
    if verdict.outcome == "lives":
        return f"{said}  {mutation.id}\n{mutation.diff()}"
    return f"{said}:{mutation.line}  {mutation.operator}" + (
        f": {verdict.by}" if verdict.by else ""
    )


def caught_share(verdicts: Sequence[Verdict]) -> float:
    """Return the fraction of caught mutations among those that change something."""
    outcomes = Counter(each.outcome for each in verdicts)
    return outcomes["caught"] / max(1, outcomes["caught"] + outcomes["lives"])


def table(verdicts: Sequence[Verdict]) -> str:
    """Return a table of the outcomes by language and operator."""
    heads = ("caught", "lives", "equivalent", "not counted", "s each")
    lines = [f"{'':46}" + "".join(f"{head:>12}" for head in heads)]
    for name, group in _groups(verdicts):
        outcomes = Counter(each.outcome for each in group)
        same = outcomes["equivalent"] + outcomes["same binary"]
        rest = len(group) - same - outcomes["caught"] - outcomes["lives"]
        numbers = [outcomes["caught"], outcomes["lives"], same, rest]
        mean = sum(each.seconds for each in group) / len(group)
        lines.append(f"{name:46}" + "".join(f"{n:12}" for n in numbers) + f"{mean:12.1f}")
    return "\n".join(lines)


def _groups(verdicts: Sequence[Verdict]) -> Iterator[tuple[str, list[Verdict]]]:
    if verdicts:
        yield "all", list(verdicts)
    for language in sorted({each.mutation.language for each in verdicts}):
        of_language = [each for each in verdicts if each.mutation.language == language]
        yield language, of_language
        for operator in sorted({each.mutation.operator for each in of_language}):
            yield f"  {operator}", [e for e in of_language if e.mutation.operator == operator]


if __name__ == "__main__":
    sys.exit(main())
