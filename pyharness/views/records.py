"""JSON: findings in, strict JSON out; a number that is not finite is null."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pyharness.compare.agreement import Accuracy
from pyharness.compare.comparison import Comparison
from pyharness.model.build import Build
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene, Wave
from pyharness.model.trajectory import Trajectory

if TYPE_CHECKING:
    from pyharness.history.ablation import CaseEffects, Effect

SCHEMA = 1


def run_record(
    scene: Scene, method: str, listing: Listing | None, trajectory: Trajectory, build: Build
) -> dict[str, Any]:
    """Return one trajectory; `listing` is None for a method that is no program."""
    return {
        "schema": SCHEMA,
        "scene": scene_record(scene),
        "method": method,
        "listing": None if listing is None else listing_record(listing),
        "trajectory": {
            "time": trajectory.time.tolist(),
            "recorded_time": trajectory.recorded_time.tolist(),
            "omega": trajectory.omega.tolist(),
            "velocity": None if trajectory.velocity is None else trajectory.velocity.tolist(),
        },
        **_ending(trajectory),
        "build": asdict(build),
    }


def comparison_record(comparison: Comparison, build: Build) -> dict[str, Any]:
    """Return what `compare` found."""
    return {
        "schema": SCHEMA,
        "scene": scene_record(comparison.scene),
        "lipschitz": comparison.lipschitz,
        "reference": {
            "source": comparison.reference.source,
            "estimate": comparison.reference.estimate,
            "error": comparison.reference.error,
        },
        "programs": [
            {
                "program": each.listing.program,
                "listing": listing_record(each.listing),
                **_ending(each.trajectory),
                **_accuracy(each.accuracy),
                "ulps": each.ulps,
                "differences": list(each.differences),
                "order": each.order.value if each.order else None,
                "order_state": each.order.state if each.order else None,
                "seconds_per_step": each.seconds_per_step,
            }
            for each in comparison.programs
        ],
        "methods": [
            {
                "method": each.method,
                "tolerance": each.tolerance,
                "failure": each.failure or None,
                **({} if each.trajectory is None else _ending(each.trajectory)),
                **({} if each.accuracy is None else _accuracy(each.accuracy)),
                "seconds": each.seconds,
            }
            for each in comparison.methods
        ],
        "unexpected": list(comparison.unexpected),
        "not_judged": list(comparison.not_judged),
        "build": asdict(build),
    }


def effects_record(effects: Sequence["CaseEffects"]) -> list[dict[str, Any]]:
    """Return what a defect does, by program and case."""
    return [
        {
            "program": each.program,
            "case": each.case,
            "punched": effect_record(each.punched),
            "mended_alone": effect_record(each.mended_alone),
            "kept_alone": effect_record(each.kept_alone),
            "mended": effect_record(each.mended),
        }
        for each in effects
    ]


def effect_record(effect: "Effect") -> dict[str, Any]:
    """Return what one listing makes of a scene."""
    return {
        "listing": listing_record(effect.listing),
        "error": effect.omega,
        "velocity_error": effect.velocity,
        "steps": effect.steps,
        "ended": effect.ended,
        "stop": None if effect.stop is None else asdict(effect.stop),
    }


def doctor_record(build: Build, missing: list[str]) -> dict[str, Any]:
    """Return what is built and what is missing."""
    return {"schema": SCHEMA, "missing": missing, "build": asdict(build)}


def scene_record(scene: Scene) -> dict[str, Any]:
    """Return a scene in the form of the scene file, with the number of its case."""
    body = "moments" if scene.moments is not None else "coefficients"
    return {
        "name": scene.name,
        "case": scene.case,
        "body": {body: list(scene.moments or scene.coefficients or ())},
        "initial": {"omega": list(scene.omega)},
        "torque": {
            "constant": list(scene.torque.constant),
            "rate": list(scene.torque.rate),
            "sines": [_wave(wave) for wave in scene.torque.sines],
            "cosines": [_wave(wave) for wave in scene.torque.cosines],
        },
        "run": {"step_size": scene.step_size, "steps": scene.steps},
    }


def listing_record(listing: Listing) -> dict[str, Any]:
    """Return a listing: its label, its active defects and its readings."""
    return {
        "label": listing.label,
        "defects": sorted(listing.defects),
        "readings": sorted(listing.readings),
    }


def json_text(record: dict[str, Any]) -> str:
    """Return strict JSON in one line; floats round-trip, a non-finite number is null."""
    try:
        return json.dumps(record, allow_nan=False) + "\n"
    except ValueError:
        return json.dumps(_finite(record), allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return value


def _wave(wave: Wave) -> dict[str, Any]:
    amplitude, frequency = wave
    return {"amplitude": list(amplitude), "frequency": frequency}


def _ending(trajectory: Trajectory) -> dict[str, Any]:
    stop = trajectory.stop
    return {
        "steps": trajectory.steps,
        "evaluations": trajectory.evaluations,
        "stop": None if stop is None else asdict(stop),
        "ended": trajectory.ended,
    }


def _accuracy(accuracy: Accuracy) -> dict[str, Any]:
    return {
        "error": list(accuracy.omega),
        "velocity_error": accuracy.velocity,
        "energy_drift": accuracy.energy,
        "momentum_drift": accuracy.momentum,
    }
