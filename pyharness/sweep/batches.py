"""Batches: scenes of a sweep that are solved in one call with the same settings.

In this module, `own` has the n values of each field in which the n scenes of a batch differ.
"""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.checks.compare.batch import OF_PROGRAMS, Batch
from pyharness.engine.plan.registry import check_torque
from pyharness.engine.torques.scene_reader import scene_of
from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError, unknown
from pyharness.model.listing import Listing, subset
from pyharness.model.scene import SPACE_TORQUE, STATE_TORQUE, Scene
from pyharness.model.scene_file import body_of
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array
from pyharness.sweep.axes import CHOICES, CONSTANTS, ELEMENTS, INERTIA, number_field
from pyharness.sweep.reductions import empty, needs_attitudes, reduced
from pyharness.sweep.sweep import Arrays, Indices, Sweep, groups, points, value_columns

Columns = dict[str, Array]


def solve_chunk(sweep: Sweep, chunk: int) -> Arrays:
    """Return an array for each reduction (stored quantity), in the shape of the chunk.

    Components of a quantity, if any, are a last dimension.
    """
    box = sweep.box(chunk)
    shape = tuple(part.stop - part.start for part in box)
    found = solve_points(sweep, points(box))
    return {name: each.reshape(*shape, *each.shape[1:]) for name, each in found.items()}


def solve_points(sweep: Sweep, where: list[Indices]) -> Arrays:
    """Return n values, or rows, of each reduction (stored quantity).

    `where` has, for each dimension of the grid, the indices of the n scenes.
    """
    n = len(where[0])
    found = {asked.name: empty(asked, n) for asked in sweep.reductions}
    for members, batch in batches(sweep, where):
        for asked in sweep.reductions:
            found[asked.name][members] = reduced(asked, batch)
    return found


def leaves_of_sweep(sweep: Sweep) -> str | None:
    return first_batch(sweep).leaves


def first_batch(sweep: Sweep) -> Batch:
    ((_, batch),) = batches(sweep, [np.zeros(1, dtype=np.intp) for _ in sweep.shape])
    return batch


def listing_of(program: str, listing: str, reading: str) -> Listing:
    """Return the version of a program that `listing` and `reading` describe.

    `listing` is ``original``, ``corrected``, or ``fix:`` or ``keep:`` with defects joined by ``+``.
    """
    how, _, names = listing.partition(":")
    readings = [] if reading == "adopted" else reading.split("+")
    if names and how == "fix":
        return subset(program, fix=names.split("+"), readings=readings)
    if names and how == "keep":
        return subset(program, keep=names.split("+"), readings=readings)
    return subset(program, listing, readings=readings)


def looped_fields(sweep: Sweep) -> list[str]:
    """Return the varied fields whose values all scenes of a batch (one call) share."""
    of_arrays = () if sweep.solver.program is None else OF_PROGRAMS
    own = ("body.",) if follows_body(sweep) else ()
    names = [axis.field for axis in sweep.axes if axis.field not in of_arrays]
    return [x for x in names if x in CHOICES or number_field(x).looped or x.startswith(own)]


def batches(sweep: Sweep, where: list[Indices]) -> Iterator[tuple[Indices, Batch]]:
    """Yield the positions in `where` of each batch's scenes, and the batch."""
    columns = value_columns(sweep, where)
    looped = looped_fields(sweep)
    for members, values in groups([columns[name] for name in looped], len(where[0])):
        own = {name: c[members] for name, c in columns.items() if name not in looped}
        shared: dict[str, Any] = dict(zip(looped, values, strict=True))
        yield members, _batch(sweep, shared, own, len(members))


def _batch(sweep: Sweep, shared: dict[str, Any], own: Columns, n: int) -> Batch:
    scene = sweep.scene
    bodies = {name: shared.pop(name) for name in list(shared) if name.startswith("body.")}
    own = {**own, **{name: np.full(n, value) for name, value in bodies.items()}}
    body, values = _body(scene, own, n)
    names = [name for name in shared if name.startswith(CONSTANTS)]
    constants = {name.removeprefix(CONSTANTS): float(shared.pop(name)) for name in names}
    if constants or bodies:
        changed = values[0].tolist() if bodies and values is not None else None
        try:
            scene = with_numbers(sweep, constants, changed)
        except InputError:
            # With the end time NaN, every method fails, and each scene reports the failure.
            own["t_end"] = np.full(n, np.nan)
    if "step_size" in shared or "steps" in shared:
        step_size = float(shared.pop("step_size", scene.step_size))
        scene = replace(scene, step_size=step_size, steps=int(shared.pop("steps", scene.steps)))
    solver = replace(sweep.solver, **shared)
    listing = None
    if solver.program is not None:
        listing = listing_of(solver.program, solver.listing, solver.reading)
    sizes = own.get("step_size", np.full(n, scene.step_size))
    with np.errstate(over="ignore"):
        whole = sizes * scene.steps
    t_end = whole if solver.t_end is None else np.full(n, solver.t_end)
    t_end = own.get("t_end", t_end)
    omega = _omega(scene, own, values if body == "moments" else None, n)
    # Axes replace components of the file's quaternion, before it is normalised.
    length = min(sweep.scene.attitude_length, sys.float_info.max)
    given = tuple(length * each for each in sweep.scene.attitude or IDENTITY)
    attitude = _components("attitude", given, own, n, first=0)
    if attitude is not None:
        # A scene with the quaternion 0 fails, as above.
        t_end = np.where(attitude.any(axis=1), t_end, np.nan)
    found = {"omega": omega, "attitude": attitude}
    found |= {name: own.get(name) for name in OF_PROGRAMS} | {body: values}
    if not isinstance(scene.torque, StateTorque):
        found["torque_constant"] = _components("torque.constant", scene.law.constant, own, n)
        found["torque_rate"] = _components("torque.rate", scene.law.rate, own, n)
    arrays = {name: array for name, array in found.items() if array is not None}
    return Batch(scene, solver, listing, t_end, arrays, needs_attitudes(sweep.reductions))


def _components(
    name: str, base: tuple[float, ...], own: Columns, n: int, first: int = 1
) -> Array | None:
    """Return the values of fields ``name.1`` and so on, shape (n, fields); None if none varies."""
    fields = {f"{name}.{number}": value for number, value in enumerate(base, first)}
    if not any(field in own for field in fields):
        return None
    columns = [own.get(field, np.full(n, value)) for field, value in fields.items()]
    return np.stack(columns, axis=1)


def _body(scene: Scene, own: Columns, n: int) -> tuple[str, Array | None]:
    """Return "moments", "inertia" or "coefficients", and n of them, or None if none varies."""
    if scene.coefficients is not None:
        return "coefficients", _components("body.coefficients", scene.coefficients, own, n)
    if scene.inertia is not None:
        return "inertia", _inertia(np.array(scene.inertia), own, n)
    assert scene.moments is not None
    first, second, third = scene.moments
    if "body.ratio.1" in own or "body.ratio.2" in own:
        ratio1 = own.get("body.ratio.1", np.full(n, first / third))
        ratio2 = own.get("body.ratio.2", np.full(n, second / third))
        return "moments", np.stack([ratio1 * third, ratio2 * third, np.full(n, third)], axis=1)
    if "body.square.1" in own or "body.square.2" in own:
        middle = own.get("body.square.1", np.ones(n))
        least = own.get("body.square.2", np.ones(n))
        # The moments of a real body are sums of two of the integrals of x^2, y^2 and z^2 over
        # its mass, here in units of the largest integral.
        x2, y2, z2 = np.ones(n), middle, middle * least
        size = max(scene.moments) / (x2 + y2)
        return "moments", np.stack([(y2 + z2) * size, (x2 + z2) * size, (x2 + y2) * size], axis=1)
    return "moments", _components("body.moments", scene.moments, own, n)


def _inertia(base: Array, own: Columns, n: int) -> Array | None:
    names = {place: f"{INERTIA}{x}" for x, place in ELEMENTS.items()}
    varied = {place: own[name] for place, name in names.items() if name in own}
    if not varied:
        return None
    found = np.tile(base, (n, 1, 1))
    for (i, j), values in varied.items():
        found[:, i, j] = found[:, j, i] = values
    return found


def _omega(scene: Scene, own: Columns, moments: Array | None, n: int) -> Array:
    cartesian = _components("omega", scene.omega, own, n)
    if cartesian is not None:
        return cartesian
    start = np.array(scene.omega)
    length = math.hypot(*scene.omega)  # without squares, which may underflow
    magnitude = own.get("omega.magnitude", np.full(n, length))
    zero = np.zeros(n)
    if "tilt" in own or "azimuth" in own:
        unit = _tilted(scene, moments, own.get("tilt", zero), own.get("azimuth", zero))
    elif "height" in own or "longitude" in own:
        height, longitude = own.get("height", zero), own.get("longitude", zero)
        across = np.sqrt(1.0 - height * height)
        unit = np.stack([across * np.cos(longitude), across * np.sin(longitude), height], axis=1)
    elif "omega.magnitude" in own:
        unit = start / length
    else:
        return np.tile(start, (n, 1))
    return magnitude[:, None] * unit


def _tilted(scene: Scene, moments: Array | None, tilt: Array, azimuth: Array) -> Array:
    """Return unit vectors at angles (rad) `tilt` from the middle axis and `azimuth` about it."""
    bodies = np.array([scene.moments]) if moments is None else moments
    order = np.broadcast_to(np.argsort(bodies, axis=1, kind="stable"), (len(tilt), 3))
    sine = np.sin(tilt)
    found = np.empty((len(tilt), 3))
    for rank, column in enumerate((sine * np.cos(azimuth), np.cos(tilt), sine * np.sin(azimuth))):
        np.put_along_axis(found, order[:, rank : rank + 1], column[:, None], axis=1)
    return found


def check_state_axis(scene: Scene, field: str) -> None:
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
    torque = scene.torque
    if isinstance(torque, TorqueLaw):
        if torque.frame != "space":
            return
        # An axis may vary a torque that is 0 in the scene.
        scene = replace(scene, torque=replace(torque, constant=(1.0, 0.0, 0.0)))
    if has_program:
        raise InputError(SPACE_TORQUE if scene.torque.in_space else STATE_TORQUE)
    if scene.torque.needs_attitude and scene.attitude is None:
        raise InputError(
            "the torque depends on the attitude, and the scene has none; give [initial] attitude"
        )
    for method in methods:
        check_torque(scene, method, attitude=True)


def follows_body(sweep: Sweep) -> bool:
    """Return whether a term of the torque uses the inertia of the scene's body by default."""
    return any(
        term["kind"] == "gravity_gradient" and "inertia" not in term
        for term in sweep.tables.get("torque", {}).get("terms", ())
    )


def with_numbers(
    sweep: Sweep, constants: Mapping[str, float], values: Sequence[Any] | None
) -> Scene:
    """Return the scene with other `constants` of the torque, and other `values` of the body."""
    tables = dict(sweep.tables)
    if constants:
        torque = tables["torque"]
        tables["torque"] = {**torque, "constants": {**torque["constants"], **constants}}
    if values is not None:
        tables["body"] = {body_of(sweep.scene)[0]: values}
    return scene_of(tables, sweep.scene.name)
