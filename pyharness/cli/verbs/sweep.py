"""The verb `sweep`."""

import argparse
from functools import partial

from pyharness.cli import options as shared
from pyharness.cli import say
from pyharness.history.claims import over_starts
from pyharness.model.errors import InputError
from pyharness.sweep.executors import EXECUTORS, check_dask
from pyharness.sweep.run import Estimate, swept
from pyharness.sweep.store import check_zarr
from pyharness.sweep.sweep_file import read_sweep

# Functions that judge a claim for many initial conditions, by the claim's id.
CLAIMS = over_starts.FUNCTIONS
_MOST_WORKERS = 1024
OPTIONS = {
    "file FILE.toml": "Sweep file (TOML): a scene, the axes of a parameter grid, a solver, and "
    "the quantities to store for each scene (format: docs/how-to/sweeps.md).",
    "--out STORE": "Store the results in this folder, in the Zarr format, and print a summary. "
    "After an interruption, the same command computes only the missing results.",
    "--repair": "Recompute damaged chunks (stored parts of the grid), and rewrite damaged "
    "metadata.",
    "--executor E": "Where to compute: here (in this process, the default), processes (in "
    "several processes of this machine) or dask (in a Dask cluster).",
    "--workers N": "Number of worker processes of --executor processes or dask, 1 to "
    f"{_MOST_WORKERS} (default: one for each processor); not with --scheduler.",
    "--scheduler ADDRESS": "Address of the scheduler of a Dask cluster, as in tcp://host:8786 "
    "(default: start a cluster on this machine); needs --executor dask.",
    "--quantity NAME": "Stored quantity that --plot draws (default: the first numerical one).",
    **{key: help for key, help in shared.outputs().items() if key != "--out FILE"},
}
USAGE = "FILE.toml --out STORE"
EXAMPLE = "sweep docs/tumbling.toml --out store"


def run(options: argparse.Namespace) -> int:
    if options.file is None:
        raise InputError("sweep: give a sweep file, as in 'sweep FILE.toml --out STORE'")
    if options.out is None:
        raise InputError("sweep: give --out STORE, the folder for the results")
    check_zarr()
    executor = options.executor or EXECUTORS[0]
    shared.check_known("executor", executor, EXECUTORS)
    if options.scheduler is not None and executor != "dask":
        raise InputError(f"--scheduler has no meaning with --executor {executor}; allowed: dask")
    if executor == "dask":
        check_dask()
    workers = _workers(options, executor)
    sweep = read_sweep(options.file, CLAIMS)
    quantity = None
    shown = shared.without_out(options)
    if options.plot is not None:
        from pyharness.sweep.report import chosen_quantity

        quantity = chosen_quantity(sweep, options.quantity)
    elif options.quantity is not None:
        raise InputError("--quantity has no meaning without --plot")
    shared.check_outputs(shown)
    from pyharness.sweep.report import sweep_report

    def tell(estimate: Estimate) -> None:
        say(f"pyharness: {estimate.text}\n")

    where = (options.out, executor, workers, options.scheduler)
    with swept(sweep, *where, tell, shared.progress, options.repair) as (store, outcome):
        shared.end_progress()
        report = sweep_report(store, outcome, options.out)
        if quantity is not None:
            from pyharness.sweep.report import sweep_picture

            report = report._replace(pictures={"sweep": partial(sweep_picture, store, quantity)})
        return shared.show(report, shown)


def _workers(options: argparse.Namespace, executor: str) -> int | None:
    if options.workers is None:
        return None
    if executor == "here" or options.scheduler is not None:
        chosen = "--executor here" if executor == "here" else "--scheduler"
        raise InputError(f"--workers has no meaning with {chosen}")
    return shared.whole_up_to(_MOST_WORKERS, options.workers, "--workers", 1)
