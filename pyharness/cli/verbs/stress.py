"""`stress`: numerical stability tried to breaking, each trial with a bound derived beforehand."""

import argparse

from pyharness.checks.stress import TRIALS, Outcome, stress, trial, worst
from pyharness.checks.stress_report import stress_report
from pyharness.cli import options as shared
from pyharness.model.errors import InputError, unknown

FORMATS = ("table", "json", "junit")
_FOLDER = "worst"
OPTIONS = {
    "--only ID,...": f"trials, or checks by name: {', '.join(TRIALS)}",
    "--save DIR": "save each method's worst input there, as a scene file (else: failures, worst/)",
    **shared.outputs(FORMATS, plot="draw one trial"),
}


def run(options: argparse.Namespace) -> int:
    """Try and show; 1 where a bound does not hold."""
    only = shared.chosen_names(options.only, "trial", tuple(TRIALS))
    if options.plot is not None and len(_chosen(only)) != 1:
        raise InputError("--plot draws one trial: choose it by --only, as in --only separatrix")
    shared.check_outputs(options)
    if options.save is not None:
        from pyharness.cli.output import check_folder

        check_folder(options.save, (), "--save")

    outcomes: list[Outcome] = []
    for outcome in stress(only):
        shared.progress(f"{len(outcomes) + 1}: {outcome.check.id}")
        outcomes.append(outcome)
    shared.progress("")
    if not outcomes:
        raise unknown("check", ",".join(only), TRIALS, "--only")
    checks = [outcome.check for outcome in outcomes]
    failed = [outcome for outcome in outcomes if not outcome.check.passed]
    if options.save is not None:
        _save(options.save, outcomes)
    # One check alone is a replay: its input has been saved before.
    elif not any("/" in each for each in only):
        try:
            _save(_FOLDER, failed)
        except InputError as error:
            shared.warn(f"the inputs of what failed are not saved: {error}")
    shared.show(stress_report([trial(name) for name in _chosen(only)], checks), options)
    return 1 if failed else 0


def _chosen(only: list[str]) -> list[str]:
    names = {each.partition("/")[0] for each in only} or set(TRIALS)
    return [name for name in TRIALS if name in names]


def _save(folder: str, outcomes: list[Outcome]) -> None:
    from pyharness.cli.output import write_folder
    from pyharness.model.scene_file import scene_text

    files = {}
    for name, outcome in worst(outcomes).items():
        assert outcome.scene is not None
        check = outcome.check
        comments = [f"worst of {name}: {check.value}, limit {check.limit}", check.replay]
        files[name.replace("/", "-") + ".toml"] = scene_text(outcome.scene, comments).encode()
    if files:
        write_folder(folder, files, "--save")
