"""The values of the article: every number and table of its text, computed by the package.

The template `article.md.in` names each value, as in ``{{ stop.step }}``. The values are texts, with
as many digits as the article shows.
"""

from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import cache
from typing import Any

import numpy as np

from pyharness.checks.compare.comparison import compare_programs
from pyharness.checks.compare.findings import Comparison, ProgramFinding
from pyharness.edition import ledger, story
from pyharness.edition.data_package import FAULTS_CASE
from pyharness.edition.decks import TITLES
from pyharness.engine.methods.linearised import jacobians
from pyharness.history.ablation import CaseEffects, effects_of, entries, entry
from pyharness.history.cards_report import scan_report
from pyharness.history.claims.laboratory import Assumptions, Laboratory, largest
from pyharness.history.claims.ledger import judgement, judgements, kinds_table
from pyharness.history.claims.rules import COLLOCATION
from pyharness.history.claims.stories import prose
from pyharness.history.identifiers import text_digest
from pyharness.history.limits import limit
from pyharness.history.words import WordRun
from pyharness.history.words import cells as word_cells
from pyharness.model.assumptions import open_starts
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.report import Column, Report, Table, words
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.model.scene_report import heading
from pyharness.model.trajectory import Stop
from pyharness.thesis.cells import all_cells
from pyharness.thesis.programs import run_program
from pyharness.thesis.word import WORDS
from pyharness.truth import reference
from pyharness.views.render import render

_LONG = 300  # steps of the printed collocation decks
_FINER = 10  # the step size of the thesis, divided by its small step size


def values() -> dict[str, Any]:
    """Return the values of the article by the names that its template uses."""
    told = story.context()
    cases = facts("cases")
    return {
        "run": {
            "steps": str(cases["deck"]["steps"]),
            "step_size": prose(cases["deck"]["step_size"]),
            "small_step": prose(cases["deck"]["step_size"] / _FINER),
            "constant": prose(cases["deck"]["lipschitz"]),
            "product": prose(cases["deck"]["step_size"] * max(_norms(range(2, 6))), 2),
        },
        "cards": _cards(),
        "entries": _certainties(),
        "faults": _faults(),
        "claims": _claims(),
        "reference": {
            "digits": str(reference.DIGITS),
            "error": prose(max(found.reference.error for found in _compared().values()), 2),
        },
        "cells": {
            "count": f"{len(list(all_cells())):,}",
            "runs": str(len(_programs())),
            "ulps": prose(max(each.ulps or 0.0 for each in _programs())),
        },
        "orders": _orders(),
        "stop": {
            "step": str(told["stopped"].stop.step),
            "quotient": prose(told["stopped"].stop.quotient, 4),
            "before": prose(told["peak"], 4),
            "after": prose(told["after"], 4),
            "subsets": _number("v2-case-2-stopped", "original", "of * subsets of *", "of"),
            "there": _number("v2-case-2-stopped", "original", "of * subsets of *"),
        },
        "limits": _limits(),
        "small": _gains(),
        "amplitude": {
            "error": _number("v2-case-2-error", "original", "two-term: *", "%"),
            "growth": _number("v2-case-2-constant", "original", "two-term: *"),
        },
        "superior": _superior(told),
        "sphere": {"least": _number("v2-case-1-agree", "original", "*: steps that it ran", "min")},
        "classical": {f"case_{case}": _share_of_largest(case) for case in (3, 4)},
        "family": {
            "ratio": _number("vi-successful-technique", "corrected", "*"),
            "rounding": _number("iv2-computer-error", "corrected", "*rounding error*", digits=2),
            "words": _number("iv2-computer-error", "corrected", "*apart from*", digits=2),
            "finest": prose(cases["deck"]["step_size"] / 100.0),
        },
        "test": _stop_test(),
        "fast": {
            "blow_up": prose(limit("two-term", case_scene(6), 1).blow_up or 0.0),
            "overflow": str(_one(6, "two-term original").trajectory.steps + 1),
            "long_steps": str(_LONG),
            "long": prose(_long_error(), 2),
            "least": _number("v2-case-6-too-fast", "corrected", "*", "min", 4),
            "most": _number("v2-case-6-too-fast", "corrected", "*", "max", 4),
            "moment": _number("v1-rigid-bodies", "corrected", "case 6: *"),
        },
        "operations": {
            f"{_name(program)}{key}": _number(
                "v3-twice-the-time", "original", f"{program}: {ratio} *, as written"
            )
            for program in COLLOCATION
            for key, ratio in (("", "over"), ("_time", "time over"))
        },
        "machine": _machine(),
        "tables": {
            "cases": _cases_table(),
            "faults": _faults_table(),
            "errors": _errors_table(),
            "verdicts": _markdown(kinds_table(judgements())),
        },
    }  # fmt: skip


def _number(claim: str, programs: str, pattern: str, form: str = "max", digits: int = 3) -> str:
    """Return a number of our verdict on a claim, with `digits` significant digits, as text.

    `programs` is ``original`` or ``corrected``. Of the numbers whose names fit `pattern`, `form`
    selects the ``min`` or ``max``. ``%`` gives the largest in percent, and ``of`` the number within
    the first name, as in "of 64 subsets".
    """
    judged = getattr(judgement(claim), programs)
    fitting = {name: x for name, x in judged.numbers.items() if fnmatchcase(name, pattern)}
    if not fitting:
        raise ValueError(f"claim {claim} has no number {pattern!r}")
    if form == "of":
        return str(next(iter(fitting)).split()[1])
    x = min(fitting.values()) if form == "min" else max(fitting.values())
    return f"{prose(100.0 * x, 2)} %" if form == "%" else prose(x, digits)


def _cards() -> dict[str, str]:
    record = scan_report((), (), 0, "").record()
    found = {name: str(record[name]) for name in ("cards", "lost", "deviating", "differences")}
    return {**found, "digest": text_digest()}


def _certainties() -> dict[str, str]:
    every = [each["certainty"] for each in entries()]
    return {"all": str(len(every)), "certain": str(every.count("certain"))}


def _switched() -> list[dict[str, Any]]:
    return [each for each in entries("defect") if "flag" in each]


def _faults() -> dict[str, Any]:
    named = {
        each["id"].replace("-", "_"): {
            "numbers": "; ".join(each["cards"].values()),
            "original": each["original"],
            "corrected": each["corrected"],
        }
        for each in (*_switched(), entry("c1-for-c"))
    }
    count = {"all": str(len(entries("defect"))), "switched": str(len(_switched()))}
    return {**count, **named}


def _claims() -> dict[str, str]:
    judged = judgements()
    results = [each for each in judged if each.claim["kind"] == "result"]
    first, second = ledger.counts(judged)["reproduced"]
    resting = [each for each in results if all(other.survives for other in each.survivals)]
    return {
        "all": str(len(judged)),
        "results": str(len(results)),
        "original": str(first),
        "corrected": str(second),
        "firm": str(len(resting)),
    }


@cache
def _compared() -> dict[int, Comparison]:
    return {case: compare_programs(case_scene(case)) for case in case_numbers()}


def _programs() -> list[ProgramFinding]:
    return [each for found in _compared().values() for each in found.programs]


def _one(case: int, who: str) -> ProgramFinding:
    (found,) = (each for each in _compared()[case].programs if each.who == who)
    return found


def _orders() -> dict[str, str]:
    found = {}
    for program in PROGRAMS:
        order = _one(3, f"{program} corrected").order
        assert order is not None
        assert order.value is not None
        found[_name(program)] = f"{order.value:.1f}"
    return found


def _limits() -> dict[str, dict[str, str]]:
    """Return the original programs' orders, and distances (rad/s) from limit and true solution."""
    found = {}
    chosen = {
        "runge_kutta": ("runge-kutta", 2), "runge_kutta_7": ("runge-kutta", 7),
        "two_term": ("two-term", 5), "four_term": ("four-term", 5),
    }  # fmt: skip
    for name, (program, case) in chosen.items():
        measured = limit(program, case_scene(case))
        assert measured.order is not None
        last = measured.halvings[-1]
        found[name] = {
            "order": f"{measured.order:.2f}",
            "step_size": prose(last.step_size),
            "from_limit": prose(last.from_limit, 2),
            "from_truth": prose(last.from_truth, 2),
        }
    run = run_program(case_scene(2), Listing.original("runge-kutta"))
    away = np.abs(run.omega[:, 0] - 2.0 * np.sin(2.5 * run.time)).max()
    found["runge_kutta"]["until_stop"] = prose(away, 2)
    return found


def _long_error() -> float:
    """Return the larger error (rad/s) of the corrected collocation programs in a long Case 6."""
    lab = Laboratory(False, Assumptions(steps=_LONG))
    return max(lab.error(program, 6) for program in COLLOCATION)


def _gains() -> dict[str, str]:
    """Return the factors by which the small step reduces the Runge-Kutta program's error."""
    claim = "v3-small-step-runge-kutta"
    return {
        f"{programs}_{form}": _number(claim, programs, "case *: gain", form)
        for programs in ("original", "corrected")
        for form in ("min", "max")
    }


def _superior(told: Mapping[str, Any]) -> dict[str, str]:
    """Return the numbers of the conclusion; `told` has the ratios of the corrected errors."""
    changed = [each for each in judgement("vi-superior").survivals if not each.survives]
    (start,) = (each.assumption for each in changed)
    return {
        "least": prose(told["ratios"][0]),
        "most": prose(told["ratios"][1]),
        "two_term_7": prose(told["case_7"]["two-term"]),
        "four_term_7": prose(told["case_7"]["four-term"]),
        "start": start.partition(" = ")[2].partition(" where")[0],
        "changed": changed[0].original,
        "verdict": judgement("vi-superior").corrected.verdict,
    }


def _share_of_largest(case: int) -> str:
    """Return the error of the printed two-term program in percent of the largest omega."""
    lab = Laboratory(True)
    return f"{100.0 * lab.error('two-term', case) / largest(lab.truth(case)):.2f} %"


def _stop_test() -> dict[str, str]:
    bound = "case *: largest quotient over *"
    *most, last = map(prose, _norms(range(2, 7)))
    return {
        "original": _number("ii5-divergence", "original", bound),
        "corrected": _number("ii5-divergence", "corrected", bound),
        "norms": f"{', '.join(most)} and {last}",
        "stopped": _number("iv3-guard", "original", "bounded runs stopped"),
        "needed": _number("iv3-constant-500", "corrected", "case *: constant needed (1/s)"),
    }


def _norms(cases: Iterable[int]) -> list[float]:
    """Return the largest norm (1/s) of the Jacobian along the solution of each case."""
    lab = Laboratory(True)
    found = (jacobians(lab.scene(n), lab.truth(n).omega) for n in cases)
    return [float(np.linalg.norm(each, 2, axis=(1, 2)).max()) for each in found]


def _machine() -> dict[str, str]:
    """Return how many printed numbers and stops change in the CDC's words of 48 bits."""
    bits = WORDS["cdc48"].p
    found = list(word_cells(case_numbers(), lengths=(bits,)))

    def runs(rule: str) -> list[WordRun]:
        return [run for run in (cell.find_run(bits, rule) for cell in found) if run is not None]

    rules = [WORDS[name].rule for name in ("cdc48", "cdc48-rounded")]
    stops = sum(
        run.stop != cell.double.stop
        for rule in rules
        for run, cell in zip(runs(rule), found, strict=True)
    )
    truncated, rounded = (runs(rule) for rule in rules)
    return {
        "bits": str(bits),
        "fields": f"{sum(run.fields for run in truncated):,}",
        "truncated": str(sum(run.different for run in truncated)),
        "rounded": str(sum(run.different for run in rounded)),
        "runs": str(len(truncated) + len(rounded)),
        "stops": str(stops),
    }


def _name(program: str) -> str:
    return program.replace("-", "_")


def _tuple(numbers: Iterable[float]) -> str:
    return f"({', '.join(f'{x:g}' for x in numbers)})"


def _cases_table() -> str:
    assumed = open_starts()
    rows = []
    for each in facts("cases")["case"]:
        start = _tuple(each["omega"])
        torque = heading(case_scene(each["number"]))[1].split("; ")[1].removeprefix("N = ")
        given = "assumed" if each["number"] in assumed else "thesis"
        rows.append([each["number"], each["title"], _tuple(each["moments"]), torque, start, given])
    heads = (
        "case", "body and torque", "moments of inertia (kg m2)", "torque", "initial omega (rad/s)",
        "source",
    )  # fmt: skip
    return _table(heads, rows)


def _faults_table() -> str:
    """Return a table of the effects of each fault, kept alone in the corrected program."""
    rows = []
    for each in _switched():
        found = list(effects_of(each["id"]))
        for program in each["programs"]:
            of_program = [effects for effects in found if effects.program == program]
            rows.append(
                _effects_row(f"`{each['id']}`", program, of_program, each["cards"][program])
            )
    every = list(effects_of("three-masses"))  # a fault that all programs have
    for program in PROGRAMS:
        of_program = [effects for effects in every if effects.program == program]
        rows.append(_effects_row("none", program, of_program))
    heads = (
        "fault", "program", "cards", f"omega, Case {FAULTS_CASE} (rad/s)",
        f"velocity, Case {FAULTS_CASE} (m/s)", "cases that stop",
    )  # fmt: skip
    return _table(heads, rows)


def _effects_row(
    fault: str, program: str, found: Sequence[CaseEffects], cards: str = ""
) -> list[Any]:
    outcomes = {each.case: each.kept_alone if cards else each.corrected for each in found}
    shown = outcomes[FAULTS_CASE]
    stopped = sum(each.stop is not None for each in outcomes.values())
    can_stop = program == "runge-kutta"
    count = f"{stopped} of {len(outcomes)}" if can_stop else "-"
    return [
        fault,
        TITLES[program],
        cards or "-",
        prose(shown.omega, 2),
        prose(shown.velocity, 2),
        count,
    ]


def _errors_table() -> str:
    """Return a table of each run's largest error of omega (rad/s) and stop."""
    rows = []
    for case, found in _compared().items():
        by_listing: dict[str, list[str]] = {}
        for each in found.programs:
            by_listing.setdefault(each.listing.label, []).append(_error(each))
        rows.append([case, *by_listing["original"], *by_listing["corrected"]])
    short = {"two-term": "two-term", "four-term": "four-term", "runge-kutta": "R-K"}
    heads = [f"{short[name]}, {form}" for form in ("printed", "corrected") for name in PROGRAMS]
    return _table(("case", *heads), rows)


def _error(found: ProgramFinding) -> str:
    run = found.trajectory
    if run.ended == "overflow":
        return f"overflow in step {run.steps + 1}"
    error = prose(max(found.accuracy.omega), 2)
    return error if run.stop is None else f"{error} ({_stop(run.stop)})"


def _stop(stop: Stop) -> str:
    return f"step {stop.step}, {stop.variable}"


def _table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    return _markdown(Table([*words(""), *map(Column, heads)], rows))


def _markdown(table: Table) -> str:
    return render(Report("article", [], dict, page=[[table]]), "markdown").strip()
