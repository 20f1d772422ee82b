"""Scenes as methods integrate them, made once, and kept with the scenes."""

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from pyharness.engine.system.recorded import outputs_at, slopes_of, system_of
from pyharness.model.array_type import Array
from pyharness.model.attitude import IDENTITY, Quaternion, product, quaternion_rates
from pyharness.model.constant_body import integrated, uses_principal_axes, with_constant_body
from pyharness.model.dense_output import DenseOutput
from pyharness.model.inertia import principal_frame
from pyharness.model.principal import (
    PrincipalScene,
    axes_and_turn,
    in_scene_axes,
    principal,
    states_in_scene_axes,
)
from pyharness.model.scene import Scene
from pyharness.model.state_torque import is_opaque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Trajectory
from pyharness.model.waves import with_merged_waves

_KEPT = "_kept"  # an attribute of a scene that is no field


class Problem:
    """A scene with or without attitude, about axes and with a torque that methods take."""

    axes: Array | None = None  # principal axes of an inertia matrix, as columns
    turn: tuple[Array, Quaternion] | None = None  # they, and as a quaternion, if `turned` has them

    def __init__(self, given: Scene, with_attitude: bool, exactly: bool) -> None:
        start = (given.attitude or IDENTITY) if with_attitude else None
        scene = given if start is given.attitude else replace(given, attitude=start)
        self.given, self.with_attitude, self.is_exact = given, with_attitude, exactly
        self.moments: Any = given.changing or given.moments
        if given.inertia is not None:
            frame = principal_frame(given.inertia)
            self.axes, self.moments = frame.axes.copy(), frame.moments
            scene = principal(scene)[0] if exactly else integrated(scene)
            if uses_principal_axes(given):
                self.turn = axes_and_turn(given)
        # The reference must not round amplitudes, as merging does.
        if not exactly and given.changing is None and isinstance(scene.torque, TorqueLaw):
            scene = with_merged_waves(scene)
        self.turned = scene

    @cached_property
    def constant_body(self) -> Scene:
        """The scene with a constant body and a torque about its axes."""
        return with_constant_body(self.turned)

    @property
    def scene(self) -> Scene:
        """The scene that methods integrate."""
        # The reference has equations of its own for an inertia that changes.
        return self.turned if self.given.changing is None or self.is_exact else self.constant_body

    def __reduce__(self) -> tuple[Any, ...]:
        return problem_of, (self.given, self.with_attitude, self.is_exact)

    def check(self, first: float, last: float) -> None:
        """Raise an InputError if a changing moment of inertia reaches 0 between times (s)."""
        if self.given.changing is not None:
            self.given.changing.check((first, last))

    def rates(self, times: Array, states: Array) -> Array:
        """Return the time derivatives of n states, (n, m); not finite where singular."""
        end = states.shape[1] - len(self.given.states)
        omega, attitude, own = states[:, :3], states[:, 3:end], states[:, end:]
        inner = states
        if self.turn is not None:
            turned = product(attitude.T, self.turn[1]) if self.with_attitude else []
            inner = np.column_stack([omega @ self.turn[0], *turned, own])
        if is_opaque(self.constant_body.torque):
            slopes = slopes_of(self.constant_body)
            rows = zip(times.tolist(), inner.tolist(), strict=True)
            found = np.array([slopes(*row)[:3] for row in rows]).reshape(-1, 3)
        else:
            found = outputs_at(self._system, times, inner)
        rates = found[:, :3] if self.turn is None else found[:, :3] @ self.turn[0].T
        if self.with_attitude:
            rates = np.column_stack([rates, *quaternion_rates(omega.T, attitude.T)])
        return np.column_stack([rates, found[:, found.shape[1] - own.shape[1] :]])

    @cached_property
    def _system(self) -> Any:
        return system_of(self.constant_body, self.with_attitude and bool(self.given.states))

    def in_axes_of_scene(self, found: Trajectory) -> Trajectory:
        """Return a trajectory about the body axes, with the principal axes."""
        if self.axes is None:
            return found
        if isinstance(self.turned, PrincipalScene):
            return in_scene_axes(found, self.axes)
        return found.with_values(axes=self.axes.copy())

    def output_in_axes_of_scene(self, sol: DenseOutput | None) -> DenseOutput | None:
        if sol is None:
            return None
        axes, own = self.axes, 7 if self.with_attitude else 3
        if axes is not None and isinstance(self.turned, PrincipalScene):
            sol = sol.transform(lambda states: states_in_scene_axes(states, axes, own))
        return sol and replace(sol, rates=problem_of(self.given, self.with_attitude).rates)


def kept_of(scene: Scene) -> dict[Any, Any]:
    """Return what is kept with a scene, which is immutable."""
    if _KEPT not in scene.__dict__:
        object.__setattr__(scene, _KEPT, {})
    found: dict[Any, Any] = scene.__dict__[_KEPT]
    return found


def problem_of(scene: Scene, with_attitude: bool, exactly: bool = False) -> Problem:
    """Return the scene's problem; `exactly` for the method `reference`."""
    kept = kept_of(scene)
    found: Problem | None = kept.get((with_attitude, exactly))
    if found is None:
        found = kept[with_attitude, exactly] = Problem(scene, with_attitude, exactly)
    return found
