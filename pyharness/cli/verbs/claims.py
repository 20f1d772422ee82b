"""The verb `claims`."""

import argparse

from pyharness.cli import options as shared
from pyharness.history.claims.ledger import (
    assignments,
    assignments_report,
    claim,
    claims,
    claims_report,
    explanation,
    judgement,
)
from pyharness.model.errors import InputError
from pyharness.thesis.programs import BINARY64, WORD_NAMES

OPTIONS = {
    "--explain ID": "Explain the verdict on one claim (statement of the thesis), with the numbers "
    "behind it. `pyharness claims` lists the IDs.",
    "--assignments": "For each case whose initial angular velocity the thesis omits, show for "
    "which assumed values the claims hold (only with --format table or json).",
    "--word W": f"Arithmetic of the programs: {', '.join(WORD_NAMES)} (default "
    f"{WORD_NAMES[0]}). cdc48 truncates results, as CDC computers did; cdc48-rounded rounds "
    "them. Not with --assignments, --evidence or --atlas.",
    "--evidence": "Count the claims that hold for each combination of initial angular velocity, "
    "interpretation of doubtful program lines, assumptions about missing lines, and number of "
    "steps.",
    "--atlas STORE": "Show for which initial angular velocities the claims hold. STORE is the "
    "folder in which `pyharness sweep` stored the results; needs --sweep.",
    "--sweep FILE.toml": "Sweep file from which STORE was computed; needs --atlas.",
    **shared.outputs(plot="the counts of --evidence or the map of --atlas"),
}
FORMATS_WITH = {"assignments": ("table", "json")}
GROUPS = {"instead of all verdicts": "explain assignments evidence atlas sweep"}
EXAMPLE = "claims --explain abstract-superior"


def run(options: argparse.Namespace) -> int:
    if options.assignments:
        shared.refuse(options, "--assignments", ("explain", "evidence", "word"))
    if options.atlas is not None:
        return _atlas(options)
    shared.refuse(options, "the verdicts; give --atlas", ("sweep",))
    if options.evidence:
        return _evidence(options)
    shared.refuse(options, "the verdicts; give --evidence", ("plot",))
    shared.check_known("word", options.word, WORD_NAMES)
    chosen = claims() if options.explain is None else [claim(options.explain)]
    shared.check_outputs(options)
    if options.assignments:
        return shared.show(assignments_report(assignments()), options)

    judgements = []
    for number, entry in enumerate(chosen, 1):
        shared.progress(number - 1, len(chosen), entry["id"])
        judgements.append(judgement(entry["id"], options.word or BINARY64))
    one = options.explain is not None
    return shared.show(explanation(judgements[0]) if one else claims_report(judgements), options)


def _evidence(options: argparse.Namespace) -> int:
    from pyharness.history.claims.evidence import combinations, evidence, evidence_report

    shared.refuse(options, "--evidence", ("explain", "word"))
    shared.check_outputs(options)
    found, every = [], len(combinations())
    for combination in evidence():
        found.append(combination)
        shared.progress(len(found), every, "combinations")
    return shared.show(evidence_report(found), options)


def _atlas(options: argparse.Namespace) -> int:
    from pyharness.history.claims import over_starts
    from pyharness.history.claims.atlas import atlas_of, atlas_report
    from pyharness.sweep.batches import first_batch
    from pyharness.sweep.store import check_store, opened
    from pyharness.sweep.sweep_file import read_sweep

    shared.refuse(options, "--atlas", ("explain", "assignments", "evidence", "word"))
    if options.sweep is None:
        raise InputError("--atlas: give --sweep FILE.toml, the sweep file of the store")
    shared.check_outputs(options)
    sweep = read_sweep(options.sweep, over_starts.FUNCTIONS)
    if not check_store(sweep, options.atlas):
        raise InputError(f"--atlas '{options.atlas}': does not exist; 'pyharness sweep' writes it")
    # Other fields may vary along the dimension of an axis.
    fields = {axis.field: axis.coordinates() for axis in sweep.axes}
    axes = {each: fields.get(each, ()) for each in sweep.dimensions}
    with opened(sweep, options.atlas) as store:
        if not all(store.done()):
            raise InputError(
                f"--atlas '{options.atlas}': is not finished; 'pyharness sweep' continues it"
            )
        judged = (asked for asked in sweep.reductions if asked.reduction == "claim")
        codes = {dict(x.parameters)["id"]: store.array(x.name)[...] for x in judged}
    return shared.show(atlas_report(atlas_of(codes, axes, first_batch(sweep))), options)
