"""Comparison of the bodies of a batch with their single runs, bit for bit."""

from dataclasses import replace
from typing import Any

import numpy as np

from pyharness import Listing, ProgramEnsemble, Scene
from pyharness.model.extension import ENDS
from pyharness.model.trajectory import STOP_VARIABLES
from pyharness.thesis import compiled

Options = dict[str, Any]


def same_bits(found: object, wanted: object) -> bool:
    """Whether numbers agree to the last bit; all NaN are equal."""
    one, other = (np.asarray(each, dtype=np.float64) for each in (found, wanted))
    if one.shape != other.shape:
        return False
    alike = np.ascontiguousarray(one).view(np.int64) == np.ascontiguousarray(other).view(np.int64)
    return bool((alike | (np.isnan(one) & np.isnan(other))).all())


def single_scene(scene: Scene, options: Options, row: int) -> Scene:
    """Return the scene of one body."""
    given: Options = {
        name: options[name] if np.ndim(options[name]) < 2 else options[name][row]
        for name in ("omega", "moments", "coefficients", "torque_constant")
        if name in options
    }
    if "torque_constant" in given:
        given["torque"] = replace(scene.law, constant=given.pop("torque_constant"))
    if {"moments", "coefficients"} & given.keys():
        given = {"moments": None, "coefficients": None, "inertia": None} | given
    if "omega" in given:
        given["omega"] = given.pop("omega")
    step_size = options.get("step_size", scene.step_size)
    return replace(scene, **given, step_size=step_size[row] if np.ndim(step_size) else step_size)


def assert_alike(found: ProgramEnsemble, scene: Scene, listing: Listing, options: Options) -> None:
    """Compare every body with its single run."""
    lipschitz = np.broadcast_to(options.get("lipschitz", 500.0), len(found.n_rows))
    at = found.at - 1
    for row in range(len(found.n_rows)):
        wanted = compiled.run(
            single_scene(scene, options, row), listing, float(lipschitz[row]),
            options.get("may_stop", True), options.get("velocity", False),
        )  # fmt: skip
        where = (listing, scene, options, row)
        assert found.n_rows[row] == wanted.steps, where
        assert ENDS[found.status[row]] == wanted.ended, where
        stop = wanted.stop
        variable = STOP_VARIABLES.index(stop.variable) + 1 if stop else 0
        assert found.stop_variable[row] == variable, where
        assert same_bits(found.stop_quotient[row], stop.quotient if stop else np.nan), where
        there = at < wanted.steps
        rows = at[there]
        assert same_bits(found.omega[row, there], wanted.omega[rows]), where
        assert np.isnan(found.omega[row, ~there]).all(), where
        assert (found.velocity is None) == (wanted.velocity is None)
        if found.velocity is not None and wanted.velocity is not None:
            assert same_bits(found.velocity[row, there], wanted.velocity[rows]), where
            assert np.isnan(found.velocity[row, ~there]).all(), where
        assert (found.ier is None) == (wanted.ier is None)
        if found.ier is not None and wanted.ier is not None:
            np.testing.assert_array_equal(found.ier[row, there], wanted.ier[rows])
            assert (found.ier[row, ~there] == -1).all()
        time = found.recorded_time if found.recorded_time.ndim == 1 else found.recorded_time[row]
        assert same_bits(time[there], wanted.recorded_time[rows]), where
        if found.recorded_time.ndim == 2:
            assert np.isnan(time[~there]).all()
    if found.recorded_time.ndim == 1:
        reached = found.at <= found.n_rows.max(initial=0)
        np.testing.assert_array_equal(np.isnan(found.recorded_time), ~reached)


def assert_same(one: ProgramEnsemble, other: ProgramEnsemble) -> None:
    for name, value in vars(one).items():
        if value is None:
            assert getattr(other, name) is None
        else:
            assert same_bits(value, getattr(other, name)), name
            assert value.dtype == getattr(other, name).dtype
