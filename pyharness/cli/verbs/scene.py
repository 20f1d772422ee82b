"""The verb `scene`."""

import argparse
import os
from pathlib import Path

from pyharness.cli import options as shared
from pyharness.engine.torques.scene_reader import read_scene
from pyharness.model.errors import InputError, unknown
from pyharness.model.facts import facts_folder
from pyharness.model.records import scene_record
from pyharness.model.report import Report
from pyharness.model.scene_file import case_scene, scene_text
from pyharness.model.scene_report import heading

FORMATS = ("table", "json")
_ACTIONS = ("new", "check", "schema")
_NEW = Path(__file__).with_name("brick.toml")
OPTIONS = {
    "action ACTION": "One of new (write a sample scene file), check (a scene FILE) or schema "
    "(print the JSON Schema of scene files).",
    "file FILE": "Scene file to check (only with check, which requires it).",
    "--case N": "With new, write the scene of this case of the thesis, 1 to 7 (default: a brick, "
    "with every section of a scene file).",
    **shared.outputs(FORMATS, plot=""),
    "--format F": "With check, the output format: table (default) or json.",
}
USAGE = "ACTION [FILE]"
EXAMPLE = "scene new --out brick.toml"


def run(options: argparse.Namespace) -> int:
    action = options.action
    if action is None:
        raise InputError(f"give an action; allowed: {', '.join(_ACTIONS)}")
    if action not in _ACTIONS:
        raise unknown("action", action, _ACTIONS)
    if action == "check" and options.file is None:
        raise InputError("scene check: give a scene file")
    if action != "check" and options.file is not None:
        raise InputError(f"scene {action} takes no file; allowed: scene check FILE")
    if action != "check":
        shared.refuse(options, f"scene {action}", ("format",))
    if action != "new":
        shared.refuse(options, f"scene {action}", ("case",))
    shared.check_outputs(options)
    if action == "new" and options.out is not None and os.path.isfile(options.out):
        raise InputError(f"scene new: '{options.out}' exists; give another name, or delete it")
    if action == "check":
        scene = read_scene(options.file)
        shared.warn_of_attitude(scene)
        record = scene_record(scene)
        shared.show(Report("scene", [heading(scene)], record=lambda: {"scene": record}), options)
    elif action == "schema":
        shared.emit((facts_folder() / "scene.schema.json").read_bytes(), options.out)
    elif (case := shared.chosen_case(options)) is None:
        shared.emit(_NEW.read_bytes(), options.out)
    else:
        shared.emit(scene_text(case_scene(case), [f"Case {case} of Table 1"]), options.out)
    return 0
