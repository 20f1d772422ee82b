"""Dictionaries for JSON output."""

from dataclasses import asdict
from typing import Any

from pyharness.model.build import build
from pyharness.model.changing import Changing
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.scene_file import as_lists, body_of, law_table
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Trajectory


def scene_record(scene: Scene) -> dict[str, Any]:
    """Return a scene for JSON, with the keys of a scene file and "case".

    Python functions appear only as "recorded" or "opaque".
    """
    body, values = body_of(scene)
    return {
        "name": scene.name,
        "case": scene.case,
        "body": {body: "recorded" if values is None else values},
        "initial": {
            "omega": list(scene.omega),
            **({} if scene.attitude is None else {"attitude": list(scene.attitude)}),
            **({"t0": scene.t0} if scene.t0 else {}),
        },
        "torque": _torque(scene.torque),
        "run": {"step_size": scene.step_size, "steps": scene.steps},
        **({"states": _states(scene)} if scene.states else {}),
    }


def _states(scene: Scene) -> dict[str, Any]:
    assert isinstance(scene.torque, StateTorque)
    rates = scene.torque.expression[3:] or (None,) * len(scene.states)
    return {
        each.name: {"start": each.start, "scale": each.scale, "rate": rate}
        for each, rate in zip(scene.states, rates, strict=True)
    }


def _torque(torque: TorqueLaw | StateTorque) -> dict[str, Any]:
    if isinstance(torque, TorqueLaw):
        frame = {} if torque.frame == "body" else {"frame": torque.frame}
        return {**law_table(torque), **frame}
    if torque.tape is None:
        return {"opaque": True}
    if not (torque.expression or torque.terms):
        return {"recorded": len(torque.tape.operations)}
    record: dict[str, Any] = {}
    if torque.expression:
        record = {"expression": list(torque.expression[:3]), "constants": dict(torque.constants)}
    for part in torque.terms:
        if isinstance(part, TorqueLaw):
            record |= _torque(part)
        else:
            term = {k: "recorded" if isinstance(x, Changing) else as_lists(x) for k, x in part}
            record["terms"] = [*record.get("terms", []), term]
    return record


def listing_record(listing: Listing) -> dict[str, Any]:
    return {
        "label": listing.label,
        "defects": sorted(listing.defects),
        "readings": sorted(listing.readings),
        "conjectures": sorted(listing.conjectures),
    }


def ending_record(trajectory: Trajectory) -> dict[str, Any]:
    stop = trajectory.stop
    return {
        "steps": trajectory.steps,
        "evaluations": trajectory.evaluations,
        "stop": None if stop is None else asdict(stop),
        "ended": trajectory.ended,
    }


def estimate_record(trajectory: Trajectory) -> dict[str, float | None]:
    return {name: getattr(trajectory, name) for name in ("error", "growth", "digits")}


def build_record() -> dict[str, Any]:
    return asdict(build())
