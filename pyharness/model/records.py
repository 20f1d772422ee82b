"""Records for JSON of a scene, a listing, the end of a run and the installation."""

from dataclasses import asdict
from typing import Any

from pyharness.model.build import build
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene, Wave
from pyharness.model.scene_file import body_of
from pyharness.model.trajectory import Trajectory


def scene_record(scene: Scene) -> dict[str, Any]:
    """Return the record of a scene: the form of the scene file, with the number of its case."""
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
    """Return the record of a listing: its label, active defects, readings and conjectures."""
    return {
        "label": listing.label,
        "defects": sorted(listing.defects),
        "readings": sorted(listing.readings),
        "conjectures": sorted(listing.conjectures),
    }


def ending_record(trajectory: Trajectory) -> dict[str, Any]:
    """Return the record of how a run ended: steps, evaluations, stop and ending."""
    stop = trajectory.stop
    return {
        "steps": trajectory.steps,
        "evaluations": trajectory.evaluations,
        "stop": None if stop is None else asdict(stop),
        "ended": trajectory.ended,
    }


def estimate_record(trajectory: Trajectory) -> dict[str, float | None]:
    """Return a method's own estimates of error, growth and digits; null where unknown."""
    return {name: getattr(trajectory, name) for name in ("error", "growth", "digits")}


def build_record() -> dict[str, Any]:
    """Return the record of how this installation was built."""
    return asdict(build())
