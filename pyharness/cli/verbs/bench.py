"""`bench`: run time against error, every method of ours against programs and peers."""

import argparse
from collections.abc import Sequence

from pyharness.bench.contenders import Contender, own
from pyharness.bench.measure import Finding, Refusal, measure, workloads
from pyharness.bench.peers import installed, peers
from pyharness.cli import options as shared
from pyharness.model.errors import InputError, unknown
from pyharness.model.scene_file import case_numbers

# Beyond it the reference, in decimal arithmetic, takes longer than anyone waits for.
_LONGEST = 1e3


def declare(parser: shared.Parser) -> None:
    """Declare the options."""
    parser.add_argument("--case", metavar="N", help="one case of Table 1 (default: 2 to 7)")
    parser.add_argument(
        "--horizon", metavar="T", help="go to this time, s (default: 3; Cases 3 and 4 also 100)"
    )
    parser.add_argument("--methods", metavar="A,B", help="these of ours only, or none")
    parser.add_argument("--peers", metavar="X,Y", help="these peers or packages only, or none")
    parser.add_argument(
        "--plan", action="store_true", help="what each skip of the plan saves, with and without"
    )
    parser.add_argument(
        "--growth", action="store_true", help="error of the Taylor method up to 1e5 s (Cases 3, 4)"
    )
    shared.add_output_options(parser)


def run(options: argparse.Namespace) -> int:
    """Measure and show."""
    form = shared.chosen_format(options, shared.FORMATS)
    if options.plan or options.growth:
        meaningless = ["case", "horizon", "methods", "peers"]
        meaningless += ["plot", "growth"] if options.plan else []
        shared.refuse(options, "--plan" if options.plan else "--growth", meaningless)
        shared.check_outputs(options)
        return _plan(options, form) if options.plan else _growth(options, form)
    known = [str(each) for each in case_numbers()]
    if options.case is not None and options.case not in known:
        raise unknown("case", options.case, known, "--case")
    horizon = None
    if options.horizon is not None:
        horizon = shared.positive(options.horizon, "--horizon", 0.0)
        if horizon > _LONGEST:
            raise InputError(f"--horizon: {horizon:g}; allowed: above 0, up to {_LONGEST:g}")
    methods = chosen(own(), options.methods, "method", "--methods")
    others = chosen(peers(), options.peers, "peer", "--peers")
    missing = [each for each in others if not installed(each)]
    if missing and options.peers is not None:
        raise InputError(
            f"--peers: {missing[0].name} needs {missing[0].package}, which is not installed: "
            "pip install 'pyharness[peers]'"
        )
    contenders = methods + [each for each in others if each not in missing]
    if not contenders:
        raise InputError("bench: no method and no peer is left; name one")
    shared.check_outputs(options)
    loads = workloads(None if options.case is None else int(options.case), horizon)
    found = measure(loads, contenders, shared.progress)
    shared.progress("")
    if not found.rows:
        from pyharness.bench.report import not_measured

        raise InputError(f"bench: nothing could be measured: {'; '.join(not_measured(found))}")
    absent = "not installed: pip install 'pyharness[peers]'"
    found.refused.extend(
        Refusal(load, each.name, None, absent) for each in missing for load in loads
    )

    if options.plot is not None:
        from pyharness.bench.pictures import bench_picture

        shared.write(bench_picture(found, options.plot), "--plot")
    shared.emit(_text(form, options, found), options.out)
    return 0


def chosen(
    contenders: Sequence[Contender], text: str | None, what: str, where: str
) -> list[Contender]:
    """Return the contenders named, by their own name or their package; all where none are."""
    if text is None:
        return list(contenders)
    names = shared.names(text)
    if names == ["none"]:
        return []
    allowed = [each.name for each in contenders]
    packages = sorted({each.package for each in contenders} - {""})
    for name in names:
        if name not in allowed and name not in packages:
            raise unknown(what, name, [*allowed, *packages, "none"], where)
    return [each for each in contenders if each.name in names or each.package in names]


def _text(form: str, options: argparse.Namespace, found: Finding) -> str:
    from pyharness.bench import report as views
    from pyharness.model.build import build, machine

    if form == "table":
        return views.bench_table(found)
    if form == "csv":
        from pyharness.views.text import csv_text

        return csv_text(*views.bench_rows(found))
    packages = sorted({each.package for each in peers()} - {"", "scipy"})
    if form == "json":
        from pyharness.views.records import json_text

        return json_text(views.bench_record(found, machine(packages), build()))
    command = "pyharness bench"
    for name in ("case", "horizon", "methods", "peers"):
        value = getattr(options, name)
        command += f" --{name} {value}" if value is not None else ""
    command += " --format markdown"
    return views.bench_markdown(found, machine(packages), build(), command)


def _plan(options: argparse.Namespace, form: str) -> int:
    from dataclasses import asdict

    from pyharness.bench.savings import savings
    from pyharness.views.records import SCHEMA, json_text
    from pyharness.views.text import aligned, csv_text, markdown_text

    found = savings()
    head = ("skipped", "where", "us with it", "us without", "ratio")
    rows = [
        [
            each.part,
            each.where,
            f"{1e6 * each.with_it:.3g}",
            f"{1e6 * each.without:.3g}",
            f"{each.ratio:.2f}",
        ]
        for each in found
    ]
    if form == "json":
        text = json_text({"schema": SCHEMA, "savings": [asdict(each) for each in found]})
    elif form == "table":
        text = "\n".join(aligned(head, rows, left=2)) + "\n"
    else:
        text = (csv_text if form == "csv" else markdown_text)(head, rows)
    shared.emit(text, options.out)
    return 0


def _growth(options: argparse.Namespace, form: str) -> int:
    from dataclasses import asdict

    from pyharness.bench.growth import growth
    from pyharness.model.scene_file import case_scene
    from pyharness.views.records import SCHEMA, json_text
    from pyharness.views.text import aligned, csv_text, markdown_text

    found = {case: growth(case_scene(case)) for case in (3, 4)}
    head = ("case", "time", "error", "one rounding of time", "ratio", "steps")
    rows = [
        [
            str(case),
            f"{each.time:.3g}",
            f"{each.error:.2g}",
            f"{each.conditioning:.2g}",
            f"{each.error / each.conditioning:.2f}",
            str(each.steps),
        ]
        for case, rows in found.items()
        for each in rows
    ]
    if form == "json":
        record = {str(case): [asdict(each) for each in rows] for case, rows in found.items()}
        text = json_text({"schema": SCHEMA, "growth": record})
    elif form == "table":
        text = "\n".join(aligned(head, rows, left=1)) + "\n"
    else:
        text = (csv_text if form == "csv" else markdown_text)(head, rows)
    if options.plot is not None:
        from pyharness.bench.pictures import growth_picture

        shared.write(growth_picture(found, options.plot), "--plot")
    shared.emit(text, options.out)
    return 0
