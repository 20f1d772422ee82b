"""The verb `scene`: write a scene file to begin with, check one, or print the schema of all."""

import argparse
import os

from pyharness.cli import options as shared
from pyharness.engine.scene_reader import read_scene
from pyharness.model.errors import InputError, unknown
from pyharness.model.facts import facts_folder
from pyharness.model.records import scene_record
from pyharness.model.report import Report
from pyharness.model.scene_file import case_scene, scene_text
from pyharness.model.scene_report import heading

FORMATS = ("table", "json")
_ACTIONS = ("new", "check", "schema")
_NEW = """\
#:schema scene.schema.json
# A scene: a rigid body, its initial state, a torque, and a number of steps.
# `pyharness scene schema --out scene.schema.json` writes the schema for your editor,
# `pyharness scene check FILE` checks this file, and docs/reference/scene-files.md has every key.
name = "brick"

[body]
moments = [40.0, 30.0, 20.0]        # kg m2; or: coefficients, or: inertia, a 3 x 3 matrix

[initial]
omega = [0.0, 1.0, 1.0]             # rad/s, about the axes of the body
attitude = [1.0, 0.0, 0.0, 0.0]     # quaternion from body to space, scalar first; may be left out

[torque]                            # N m, about the axes of the body; may be left out
constant = [1.0, 0.0, 0.0]
sines = [{ amplitude = [0.0, 0.5, 0.0], frequency = 2.0 }]    # frequency in rad/s
# expression = ["-0.1*w1", "-0.1*w2", "2*sin(3*t)*q0"]        # in place of constant and sines

[run]
step_size = 0.01                    # s
steps = 100
"""
OPTIONS = {
    "action ACTION": "What to do: new (write a sample scene file), check (check a file) or "
    "schema (print the JSON Schema of scene files, for an editor).",
    "file FILE": "The scene file to check.",
    "--case N": "With new, write this case of Table 1 of the thesis, 1 to 7 (default: a brick, "
    "with every section of a scene file).",
    **shared.outputs(FORMATS, plot=""),
}
EXAMPLE = "scene new --out brick.toml"


def run(options: argparse.Namespace) -> int:
    """Write, check or describe scene files; raise InputError for an invalid file or option."""
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
        shared.emit(_NEW, options.out)
    else:
        shared.emit(scene_text(case_scene(case), [f"Case {case} of Table 1"]), options.out)
    return 0
