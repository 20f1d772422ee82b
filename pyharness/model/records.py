"""Dictionaries for JSON output: of a scene, a listing, the end of a run and the installation."""

from dataclasses import asdict
from typing import Any

from pyharness.model.build import build
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene, Wave
from pyharness.model.scene_file import body_of
from pyharness.model.trajectory import Trajectory


def scene_record(scene: Scene) -> dict[str, Any]:
    """Return a scene as a dictionary for JSON.

    It has the tables and keys of a scene file, and in addition the number of the case in Table 1.
    """
    body, values = body_of(scene)
    return {
        "name": scene.name,
        "case": scene.case,
        "body": {body: values},
        "initial": {
            "omega": list(scene.omega),
            **({} if scene.attitude is None else {"attitude": list(scene.attitude)}),
        },
        "torque": {
            "constant": list(scene.torque.constant),
            "rate": list(scene.torque.rate),
            "sines": [_wave(wave) for wave in scene.torque.sines],
            "cosines": [_wave(wave) for wave in scene.torque.cosines],
            **({} if scene.torque.frame == "body" else {"frame": scene.torque.frame}),
        },
        "run": {"step_size": scene.step_size, "steps": scene.steps},
    }


def _wave(wave: Wave) -> dict[str, Any]:
    amplitude, frequency = wave
    return {"amplitude": list(amplitude), "frequency": frequency}


def listing_record(listing: Listing) -> dict[str, Any]:
    """Return a listing as a dictionary for JSON.

    It has the label of the listing and its active defects, readings and conjectures.
    """
    return {
        "label": listing.label,
        "defects": sorted(listing.defects),
        "readings": sorted(listing.readings),
        "conjectures": sorted(listing.conjectures),
    }


def ending_record(trajectory: Trajectory) -> dict[str, Any]:
    """Return how a run ended, as a dictionary for JSON.

    It has the number of steps, the number of evaluated right-hand sides, the point at which the
    Lipschitz test stopped the run (or None), and the status, as in "complete".
    """
    stop = trajectory.stop
    return {
        "steps": trajectory.steps,
        "evaluations": trajectory.evaluations,
        "stop": None if stop is None else asdict(stop),
        "ended": trajectory.ended,
    }


def estimate_record(trajectory: Trajectory) -> dict[str, float | None]:
    """Return a method's own estimates of its accuracy, as a dictionary for JSON.

    It has the relative error, the error amplification ("growth") and the number of correct decimal
    digits. A value that is not known is None.
    """
    return {name: getattr(trajectory, name) for name in ("error", "growth", "digits")}


def build_record() -> dict[str, Any]:
    """Return the versions, compiler and flags of this installation, as a dictionary for JSON."""
    return asdict(build())
