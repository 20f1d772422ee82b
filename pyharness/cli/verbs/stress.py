"""The verb `stress`."""

import argparse
import shlex

from pyharness.checks.check import Check, requested_suites, without_check
from pyharness.checks.stress import SCENE_TRIALS, TRIALS, Trial, stress, trial, worst
from pyharness.checks.stress_report import stress_report
from pyharness.cli import options as shared
from pyharness.model.errors import InputError, unknown

FORMATS = ("table", "json", "junit")
_FOLDER = "worst"
OPTIONS = {
    "--only ID,...": f"Run only these trials: {', '.join(TRIALS)}; or only the checks whose ids "
    "begin with ID, as in shapes/auto.",
    "--scene FILE": f"Run only the trials {', '.join(SCENE_TRIALS[:-1])} and {SCENE_TRIALS[-1]}, "
    "with the scene in this TOML file instead of the built-in one. Its torque may depend on omega "
    "or attitude.",
    "--save DIR": "In this folder, save each method's scene with the worst result in each trial, "
    "as TOML (default: only scenes of failed checks, in the folder worst).",
    **shared.outputs(FORMATS, plot="the trial of --only"),
}
EXAMPLE = "stress --only separatrix --plot separatrix.png"


def run(options: argparse.Namespace) -> int:
    """Test every method against bounds from theory; return 1 if a check fails."""
    trials = None if options.scene is None else _of_scene(options)
    only = shared.chosen_names(options.only, "trial", tuple(trials or TRIALS))
    if options.plot is not None and len(_chosen(only)) != 1:
        raise InputError("--plot draws one trial; choose it with --only, as in --only separatrix")
    shared.check_outputs(options)
    if options.save is not None:
        from pyharness.cli.output import check_folder

        check_folder(options.save, (), "--save")

    checks: list[Check] = []
    names = requested_suites(trials or TRIALS, only)
    for check in stress(only) if trials is None else stress(only, trials):
        shared.progress(names.index(check.suite), len(names), check.id)
        checks.append(check)
    shared.end_progress()
    if missing := without_check(only, checks):
        raise unknown("check", ",".join(missing), trials or TRIALS, "--only")
    failed = [check for check in checks if not check.passed]
    if options.save is not None:
        _save(options.save, checks)
    # For checks requested by id, an earlier failed run has saved the scenes.
    elif trials is None and not any("/" in each for each in only):
        try:
            _save(_FOLDER, failed)
        except InputError as error:
            shared.warn(f"the inputs of what failed are not saved: {error}")
    shown = list(trials.values()) if trials else [trial(name) for name in _chosen(only)]
    return shared.show(stress_report(shown, checks), options, failed=failed)


def _of_scene(options: argparse.Namespace) -> dict[str, Trial]:
    from pyharness.checks.scene_trials import scene_trials
    from pyharness.engine.torques.scene_reader import read_scene
    from pyharness.model.scene import checked_scene

    shared.refuse(options, "--scene", ("plot", "save"))
    for each in shared.names(options.only):
        name = each.partition("/")[0]
        if name in TRIALS and name not in SCENE_TRIALS:
            raise InputError(
                f"--only {name}: the trial has scenes of its own; allowed with --scene: "
                f"{', '.join(SCENE_TRIALS)}"
            )
    scene = checked_scene(read_scene(options.scene), any_state=True)
    return scene_trials(scene, f" --scene {shlex.quote(options.scene)}")


def _chosen(only: list[str]) -> list[str]:
    names = {each.partition("/")[0] for each in only} or set(TRIALS)
    return [name for name in TRIALS if name in names]


def _save(folder: str, checks: list[Check]) -> None:
    from pyharness.cli.output import write_folder
    from pyharness.model.scene_file import scene_text

    files = {}
    for name, check in worst(checks).items():
        scene = check.name.scene
        assert scene is not None
        comments = [f"worst of {name}: {check.value}, limit {check.limit}", check.replay]
        files[name.replace("/", "-") + ".toml"] = scene_text(scene, comments).encode()
    if files:
        write_folder(folder, files, "--save")
