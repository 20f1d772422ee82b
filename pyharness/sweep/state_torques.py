"""Torques of a sweep that depend on the state.

To change their numbers, the scene is read again from its text.
"""

import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from pyharness.engine.registry import check_torque
from pyharness.engine.scene_reader import scene_of
from pyharness.model.errors import InputError, unknown
from pyharness.model.scene import STATE_TORQUE, Scene
from pyharness.model.scene_file import body_of, scene_text
from pyharness.model.state_torque import StateTorque
from pyharness.sweep.axes import CONSTANTS


def check_state_axis(scene: Scene, field: str) -> None:
    """Raise InputError if the scene's torque lacks the field of an axis.

    A torque that depends on the state has neither constant nor linear term; only expressions have
    named constants.
    """
    torque = scene.torque
    if isinstance(torque, StateTorque):
        names = [name for name, _ in torque.constants]
        if field.startswith(("torque.constant.", "torque.rate.")):
            own = [f"{CONSTANTS}{name}" for name in names]
            raise InputError(
                f"axis {field}: the torque depends on the state and is no TorqueLaw; allowed: "
                + (", ".join(own) or "other fields")
            )
        if field.startswith(CONSTANTS) and field.removeprefix(CONSTANTS) not in names:
            name = field.removeprefix(CONSTANTS)
            raise unknown("constant", name, names or ["none"], f"axis {field}")
    elif field.startswith(CONSTANTS):
        raise InputError(
            f"axis {field}: the torque is a TorqueLaw, which has no constants with names; allowed: "
            "torque.constant.1 to .3, torque.rate.1 to .3"
        )


def check_state_solver(scene: Scene, methods: Sequence[str], has_program: bool) -> None:
    """Raise InputError if a method, or a program, can't solve the scene's torque."""
    if not isinstance(scene.torque, StateTorque):
        return
    if has_program:
        raise InputError(STATE_TORQUE)
    if scene.torque.needs_attitude and scene.attitude is None:
        raise InputError(
            "the torque depends on the attitude, and the scene has none; give [initial] attitude"
        )
    for method in methods:
        check_torque(scene, method, attitude=True)


def follows_body(scene: Scene) -> bool:
    """Return whether the torque has a ready term with the inertia of the scene's body."""
    return isinstance(scene.torque, StateTorque) and any(
        _is_of_body(dict(term), scene) for term in _terms(scene.torque)
    )


def with_numbers(
    scene: Scene, constants: Mapping[str, float], values: Sequence[Any] | None
) -> Scene:
    """Return the scene with other constants of expressions, or other values of its body."""
    data: dict[str, Any] = tomllib.loads(scene_text(scene))
    if constants:
        data["torque"]["constants"].update(constants)
    if values is not None:
        assert isinstance(scene.torque, StateTorque)
        data["body"] = {body_of(scene)[0]: list(values)}
        for table, term in zip(data["torque"]["terms"], _terms(scene.torque), strict=True):
            if _is_of_body(dict(term), scene):
                # Without it, the reader takes the inertia of the table [body].
                del table["inertia"]
    return scene_of(data, scene.name)


def _terms(torque: StateTorque) -> list[tuple[tuple[str, Any], ...]]:
    return [each for each in torque.terms if isinstance(each, tuple)]


def _is_of_body(term: Mapping[str, Any], scene: Scene) -> bool:
    own = scene.moments or scene.inertia
    return bool(term["kind"] == "gravity_gradient" and term["inertia"] == own)
