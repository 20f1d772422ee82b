"""The verb `rotations`."""

import argparse

from pyharness.checks.theory.rotations import steady_rotations
from pyharness.checks.theory.rotations_report import rotations_report
from pyharness.cli import options as shared
from pyharness.model.errors import InputError

OPTIONS = {
    **shared.BODY,
    "--disturbance D": "Initial perturbation of each steady rotation, relative to its angular "
    "velocity, above 0 and below 1 (default 0.001); affects the time between flips (reversals "
    "of the rotation about the middle axis).",
    **shared.outputs(
        plot="the polhodes (curves of omega without torque) and the growth rates of perturbations"
    ),
}
USAGE = shared.ONE_SCENE
EXAMPLE = "rotations --case 4 --disturbance 1e-3"


def run(options: argparse.Namespace) -> int:
    scene = shared.chosen_scene(options)
    disturbance = shared.positive(options.disturbance, "--disturbance", 1e-3)
    if disturbance >= 1.0:
        raise InputError(f"--disturbance: {disturbance:g}; allowed: above 0 and below 1")
    if options.plot is not None and scene.moments is None:
        raise InputError("--plot draws the momentum of a body; give a scene with moments")
    shared.check_outputs(options)
    return shared.show(rotations_report(scene, steady_rotations(scene, disturbance)), options)
