"""Compute Tables B, C and D of the article from the data package, with Python alone.

``python article_tables.py``, beside the folder `package`, prints a line for each row. Errors are
against the reference solution.
"""

import collections
import csv
import json
import pathlib

package = pathlib.Path("package")
programs = ["two-term", "four-term", "runge-kutta"]


def table(path: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of the package."""
    with open(package / path, newline="") as file:
        return list(csv.DictReader(file))


def errors(case: object, quantity: str) -> dict[tuple[str, str], float]:
    """Return the largest error of omega or velocity in each run of a case."""
    truth, largest = {}, collections.defaultdict(float)
    for row in table(f"runs/case-{case}.csv"):
        values = [float(row[f"{quantity}{axis}"]) for axis in (1, 2, 3)]
        if row["program"] == "reference":
            truth[row["step"]] = values
        else:
            error = max(abs(x - y) for x, y in zip(values, truth[row["step"]], strict=True))
            run = row["program"], row["listing"]
            largest[run] = max(largest[run], error)
    return largest


runs = {(row["case"], row["program"], row["listing"]): row for row in table("runs/runs.csv")}

entries = json.loads((package / "apparatus.json").read_bytes())["entries"]
cards_of = {entry["id"]: entry["cards"] for entry in entries}
omega, velocity = errors(5, "omega"), errors(5, "velocity")
listings = [run for run in omega if run[1] not in ("original", "corrected")]
for program, listing in listings + [(program, "corrected") for program in programs]:
    ends = [
        row["ended"]
        for row in runs.values()
        if (row["program"], row["listing"]) == (program, listing)
    ]
    stops = f"{ends.count('stopped')} of {len(ends)}" if program == "runge-kutta" else "-"
    fault = "none" if listing == "corrected" else listing
    cards = cards_of[listing][program] if listing in cards_of else "-"
    errors_5 = f"{omega[program, listing]:.2g} | {velocity[program, listing]:.2g}"
    print(f"B | {fault} | {program} | {cards} | {errors_5} | {stops}")

for case in "1234567":
    omega, cells = errors(case, "omega"), []
    for listing in ("original", "corrected"):
        for program in programs:
            run = runs[case, program, listing]
            if run["ended"] == "overflow":
                cells.append(f"overflow in step {int(run['steps']) + 1}")
                continue
            stop = f" (step {run['stop_step']}, {run['stop_variable']})" if run["stop_step"] else ""
            cells.append(f"{omega[program, listing]:.2g}{stop}")
    print(f"C | {case} | " + " | ".join(cells))

claims = json.loads((package / "claims.json").read_bytes())["claims"]
verdicts = [
    "reproduced",
    "reproduced in part",
    "not reproduced",
    "false",
    "not testable",
    "undecided",
]
for kind in ("result", "theory", "design", "history", "recommendation"):
    of_kind = [claim for claim in claims if claim["kind"] == kind]
    counts = [
        collections.Counter(claim[state] for claim in of_kind)
        for state in ("original", "corrected")
    ]
    pairs = [[count[verdict] for count in counts] for verdict in verdicts]
    cells = [f"{first} / {second}" if first or second else "-" for first, second in pairs]
    print(f"D | {kind} | {len(of_kind)} | " + " | ".join(cells))
