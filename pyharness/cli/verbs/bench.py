"""The verb `bench`."""

import argparse
import shlex
from collections.abc import Iterator, Sequence
from time import process_time
from typing import TypeVar

from pyharness.bench import report as reports
from pyharness.bench.contenders import Contender, SceneContender, list_own_contenders
from pyharness.bench.measure import Refusal, Workload, measure, workloads
from pyharness.bench.peers import peers
from pyharness.bench.random_loads import random_load
from pyharness.checks.scenes.random_scenes import weekly_seed
from pyharness.cli import options as shared
from pyharness.model.distribution import install_command
from pyharness.model.errors import InputError, unknown
from pyharness.model.scene_file import case_scene

_Named = TypeVar("_Named", bound=Contender)
# Longest horizon (s) for which the reference, in decimal arithmetic, does not take too long.
_LONGEST = 1e3
_BODIES, _MOST_BODIES, _MOST_GROWN = 100_000, 1_000_000, 10_000_000
_TERM_BODIES = 1000
_OPTION_OF = {"method": "--method", "peer": "--peers"}
OPTIONS = {
    "--case N": "Only this case of the thesis, 1 to 7 (default: 2 to 7; with --attitude, all).",
    "--horizon T": "End time of each integration in s, up to 1000 (default 3, in Cases 3 and "
    "4 also 100; with --attitude also 100, except in Case 6).",
    "--draws N": "Instead of the cases, measure N random scenes, 1 to 10000.",
    "--ensemble": "Measure run times and memory of calls that solve many bodies.",
    "--terms": "Measure scenes whose torques depend on angular velocity, time and attitude, with "
    "one body and with many.",
    "--bodies N": f"Number of bodies, 1 to {_MOST_BODIES} (default {_BODIES} with --ensemble, "
    f"{_TERM_BODIES} with --terms).",
    "--seed S": "Seed of random scenes or bodies, any text (default: this week, as 2026-W47).",
    "--attitude": "Measure the attitude (orientation) too.",
    "--method M,...": "Only these of our methods and programs (names: first column of the result; "
    "`none` for no method; default: all).",
    "--peers NAME,...": "Only these third-party solvers (names: first column of the result; "
    "heyoka, numba, scipy: all of this package; `none` for no solver; default: all installed).",
    "--compiled": "With --terms, compile all torques with the C compiler first.",
    "--plan": "Measure the time saved by each omitted computation (see `pyharness plan`).",
    "--growth": "Measure how the error of the Taylor method grows up to 1e5 s, in Cases 3 and 4.",
    **shared.outputs(),
}
GROUPS = {
    "measurements": "case horizon attitude draws ensemble terms bodies seed plan growth",
    "solvers": "method peers compiled",
}
EXAMPLE = "bench --case 5 --peers none"


def run(options: argparse.Namespace) -> int:
    if options.ensemble:
        return _ensemble(options)
    if options.terms:
        return _terms(options)
    if options.bodies is not None:
        raise InputError("--bodies has no meaning without --ensemble or --terms")
    if options.compiled:
        raise InputError("--compiled has no meaning without --terms")
    if options.plan or options.growth:
        return _plan_or_growth(options)
    count = _count(options)
    case = shared.chosen_case(options)
    horizon = None
    if options.horizon is not None:
        horizon = shared.positive(options.horizon, "--horizon", 0.0)
        if horizon > _LONGEST:
            raise InputError(f"--horizon: {horizon:g}; allowed: above 0, up to {_LONGEST:g}")
    methods = chosen(list_own_contenders(), options.method, "method", options.attitude)
    others = chosen(peers(), options.peers, "peer", options.attitude)
    contenders, missing = _present(methods, others, options.peers is not None)
    if count and len(contenders) < 2 and options.format != "json":
        raise InputError("bench: --draws compares solvers; give at least two, or --format json")
    shared.check_outputs(options)
    if count:
        loads = []
        for number in range(1, count + 1):
            shared.progress(number - 1, count, "drawing scenes")
            loads.append(random_load(options.seed, number, options.attitude))
    else:
        loads = workloads(case, horizon, options.attitude)
    found = measure(loads, contenders, shared.progress)
    shared.end_progress()
    if not found.rows:
        told = "; ".join(reports.not_measured(found))
        raise InputError(f"bench: nothing could be measured: {told}")
    found.refused.extend(_not_measured(missing, loads))
    packages = sorted({each.package for each in peers()} - {"", "scipy"})
    return shared.show(reports.bench_report(found, packages, _again(options)), options)


def _present(
    methods: Sequence[_Named], others: Sequence[_Named], named: bool
) -> tuple[list[_Named], list[_Named]]:
    missing = [each for each in others if not each.is_installed]
    if missing and named:
        raise InputError(
            f"--peers: {missing[0].name} needs {missing[0].package}, which is {_absent()}"
        )
    contenders = [*methods, *(each for each in others if each.is_installed)]
    if not contenders:
        raise InputError("bench: no solver is chosen; give at least one, with --method or --peers")
    return contenders, missing


def _not_measured(missing: Sequence[Contender], loads: Sequence[Workload]) -> Iterator[Refusal]:
    return (Refusal(load, each.name, None, _absent()) for each in missing for load in loads)


def _absent() -> str:
    return f"not installed: {install_command('peers')}"


def _count(options: argparse.Namespace) -> int:
    """Return the number of draws or 0, and set the seed, by default the present year and week."""
    if options.draws is None:
        if options.seed is not None:
            raise InputError("--seed has no meaning without --draws, --ensemble or --terms")
        return 0
    shared.refuse(options, "--draws", ["case", "horizon", "plot"])
    count = shared.chosen_count(options.draws, "--draws", 0, 1, shared.SCENES)
    seed = shared.chosen_seed(options)
    options.seed = weekly_seed() if seed is None else seed
    return count


def chosen(
    contenders: Sequence[SceneContender], text: str | None, what: str, attitude: bool = False
) -> list[SceneContender]:
    """Return the solvers named in `text`, by default all.

    With `attitude`, the named solvers must compute attitudes.
    """
    found = named(contenders, text, what)
    lacking = [each.name for each in found if not each.attitude]
    if attitude and lacking and text is not None:
        able = ", ".join(each.name for each in contenders if each.attitude)
        option = _OPTION_OF[what]
        raise InputError(f"{option}: {lacking[0]} does not compute attitudes; allowed: {able}")
    return found


def _again(options: argparse.Namespace) -> str:
    command = "pyharness bench" + (" --ensemble" if options.ensemble else "")
    command += " --terms" if options.terms else ""
    for name in ("case", "horizon", "draws", "bodies", "seed", "method", "peers"):
        value = getattr(options, name)
        command += f" --{name} {shlex.quote(value)}" if value is not None else ""
    command += " --attitude" if options.attitude else ""
    command += " --compiled" if options.compiled else ""
    return command + " --format markdown"


def _plan_or_growth(options: argparse.Namespace) -> int:
    from pyharness.bench.growth import growth
    from pyharness.bench.savings import savings

    meaningless = ["case", "horizon", "draws", "seed", "attitude", "method", "peers"]
    meaningless += ["plot", "growth"] if options.plan else []
    shared.refuse(options, "--plan" if options.plan else "--growth", meaningless)
    shared.check_outputs(options)
    if options.plan:
        report = reports.savings_report(savings())
    else:
        report = reports.growth_report({case: growth(case_scene(case)) for case in (3, 4)})
    return shared.show(report, options)


def _ensemble(options: argparse.Namespace) -> int:
    from pyharness.bench import ensemble_report as ensembles
    from pyharness.bench.ensemble_contenders import draw, own_ensembles, with_attitudes
    from pyharness.bench.ensemble_measure import measure_ensembles, memory, sizes
    from pyharness.bench.ensemble_peers import ensemble_peers

    shared.refuse(
        options,
        "--ensemble",
        ["case", "horizon", "draws", "attitude", "compiled", "plan", "growth", "terms"],
    )
    n = _choose_bodies(options, _BODIES)
    those = ensemble_peers()
    methods = named(own_ensembles(), options.method, "method")
    others = named(those, options.peers, "peer")
    contenders, missing = _present(methods, others, options.peers is not None)
    shared.check_outputs(options)
    loads = draw(options.seed, n)
    loads = [*with_attitudes(loads, options.seed), *loads]
    rates = measure_ensembles(loads, contenders, options.seed, shared.progress)
    rates.refused.extend(("", each.name, _absent()) for each in missing)
    growth = sizes(options.seed, min(100 * n, _MOST_GROWN), shared.progress)
    found = ensembles.Ensembles(rates, growth, memory(min(10 * n, _MOST_BODIES)))
    shared.end_progress()
    packages = sorted({each.package for each in those} - {"", "numpy"})
    return shared.show(ensembles.ensemble_report(found, packages, _again(options)), options)


def _terms(options: argparse.Namespace) -> int:
    from pyharness.bench import term_loads, term_report
    from pyharness.bench.ensemble_measure import measure_ensembles

    meaningless = ["case", "horizon", "draws", "attitude", "method", "plan", "growth", "plot"]
    shared.refuse(options, "--terms", meaningless)
    n = _choose_bodies(options, _TERM_BODIES)
    scenes = term_loads.term_scenes()
    those = term_loads.term_peers(scenes)
    others = named(those, options.peers, "peer")
    methods = term_loads.term_methods(options.compiled)
    contenders, missing = _present(methods, others, bool(options.peers))
    shared.check_outputs(options)
    shared.progress(0, 1, "references")
    loads = term_loads.term_loads(scenes)
    # Run once to import modules, whose time must not count as preparation.
    methods[0].prepare(scenes[0].scene)(1.0, 1e-9).run()
    # All solvers run on one core, in processor time, which other load hardly affects.
    single = measure(loads, contenders, shared.progress, process_time)
    packages = {each.package for each in contenders}
    bodies = term_loads.term_bodies(scenes, options.seed, n)
    rivals = term_loads.body_contenders(options.compiled)
    both = [each for each in rivals if each.package in packages]
    many = measure_ensembles(bodies, both, options.seed, shared.progress, least=n)
    shared.end_progress()
    single.refused.extend(_not_measured(missing, loads))
    leaves = term_loads.term_leaves(scenes, options.compiled)
    found = term_report.Terms(single, many, leaves)
    return shared.show(term_report.term_report(found, ["heyoka"], _again(options)), options)


def _choose_bodies(options: argparse.Namespace, default: int) -> int:
    n = shared.whole_up_to(_MOST_BODIES, options.bodies, "--bodies", default)
    options.bodies, options.seed = str(n), shared.chosen_seed(options) or weekly_seed()
    return n


def named(contenders: Sequence[_Named], text: str | None, what: str) -> list[_Named]:
    """Return the solvers whose names or packages are in `text`, the value of the option `what`.

    None selects all, "none" no solver.
    """
    names: list[str] = shared.names(text)
    if names == ["none"]:
        return []
    packages = sorted({each.package for each in contenders} - {""})
    allowed = [*(each.name for each in contenders), *packages]
    for name in names:
        if name not in allowed:
            raise unknown(what, name, [*allowed, "none"], _OPTION_OF[what])
    return [each for each in contenders if not names or {each.name, each.package} & {*names}]
