"""Reading and checking of sweep files in TOML."""

import hashlib
import itertools
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from pyharness.checks.compare.batch import Batch, Solver
from pyharness.engine.plan.registry import (
    METHODS,
    PREPARED_WITH_ATTITUDE,
    REGISTRY,
    requested_tolerance,
)
from pyharness.engine.torques.scene_reader import scene_of, scene_of_file
from pyharness.model.errors import InputError, kind_of, kind_or_empty, unknown
from pyharness.model.listing import PROGRAMS
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.scene_file import (
    body_of,
    case_scene,
    check_keys,
    check_written_schema,
    read_file,
    toml_of,
)
from pyharness.model.values import boolean, finite, integer, number, three
from pyharness.sweep.axes import ATTITUDE, CHOICES, RIVALS, Axis, axis_of, check_name
from pyharness.sweep.batches import check_state_axis, check_state_solver, listing_of
from pyharness.sweep.reductions import RANKS, REDUCTIONS, needs_attitudes
from pyharness.sweep.sweep import ReductionSpec, Sweep

# Returns a code for each scene: 1 if the claim holds, 0 if not, 2 if it does not apply, 3 in part.
Claim = Callable[[Batch], NDArray[Any]]
_KEYS = ("schema", "name", "scene", "axis", "solve", "reductions", "chunk")
_OF_METHODS = ("method", "tolerance", "t_end", "compiled")
_OF_PROGRAMS = ("listing", "reading", "lipschitz", "may_stop")
CHUNK = 100_000
_MOST_IN_CHUNK = 1_000_000
_MOST_AXES = 12
_MOST_SAMPLES = 10_000
_LONGEST_NAME = 240  # bytes; most file systems take 255


def read_sweep(path: str | os.PathLike[str], claims: Mapping[str, Claim] | None = None) -> Sweep:
    """Return the sweep that a TOML file describes; `claims` has a function for each claim."""
    path = os.fsdecode(path)
    where = f"sweep file '{path}'"
    content = read_file(path, where)
    data = toml_of(content, where)
    try:
        return _sweep(data, Path(path), content.decode("utf-8-sig"), claims or {})
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _sweep(data: dict[str, Any], path: Path, text: str, claims: Mapping[str, Claim]) -> Sweep:
    check_written_schema(data, "sweep file")
    check_keys(data, _KEYS, "top level")
    name = data.get("name", path.stem)
    if not isinstance(name, str):
        raise InputError(f"name is {kind_of(name)}; it must be text")
    scene, own, more = _scene(data.get("scene", {}), path)
    tables = data.get("axis", [])
    if not isinstance(tables, list) or not tables:
        raise InputError("axis is missing; give at least one table [[axis]]")
    if len(tables) > _MOST_AXES:
        raise InputError(f"axis: {len(tables)} of them; allowed: up to {_MOST_AXES}")
    axes = tuple(axis_of(table, number) for number, table in enumerate(tables, 1))
    solver = _solver(data.get("solve", {}), axes)
    _check_axes(axes, scene)
    entries = data.get("reductions", ["end", "status"])
    if not isinstance(entries, list) or not entries:
        raise InputError(f"reductions is {kind_or_empty(entries)}; allowed: a list, not empty")
    reductions = tuple(_reduction(each, claims) for each in entries)
    chunk = integer("chunk", data.get("chunk", CHUNK))
    if not 1 <= chunk <= _MOST_IN_CHUNK:
        raise InputError(f"chunk is {chunk}; allowed: 1 to {_MOST_IN_CHUNK} scenes")
    digest = hashlib.sha256(text.encode() + more).hexdigest()
    sweep = Sweep(name, scene, own, axes, solver, reductions, chunk, text, digest)
    _check_names(sweep)
    _check_reductions(sweep)
    _check_solvers(sweep)
    return sweep


def _scene(table: object, path: Path) -> tuple[Scene, dict[str, Any], bytes]:
    """Return the scene, its tables, and bytes for the digest: a null byte and the scene file."""
    if not isinstance(table, dict):
        raise InputError(f"scene is {kind_of(table)}; it must be a table [scene]")
    given = [key for key in ("case", "file") if key in table]
    if given and len(table) > 1:
        raise InputError("[scene]: allowed: case, or file, or the tables of a scene file")
    if given == ["case"]:
        return case_scene(table["case"]), {}, b""
    more = b""
    if given == ["file"]:
        if not isinstance(table["file"], str):
            raise InputError(f"[scene] file is {kind_of(table['file'])}; it must be text")
        beside = path.parent / table["file"]
        named = f"scene file '{beside}'"
        content = read_file(beside, named)
        scene, more = scene_of_file(content, beside.stem, named), b"\0" + content
        table = toml_of(content, named)
    elif table:
        scene = scene_of(table, path.stem)
    else:
        raise InputError("scene is missing; give [scene] with case, file, or a scene's own tables")
    return checked_scene(scene, any_axes=True, any_torque=True, any_state=True), table, more


def _solver(table: object, axes: tuple[Axis, ...]) -> Solver:
    if not isinstance(table, dict):
        raise InputError(f"solve is {kind_of(table)}; it must be a table [solve]")
    check_keys(table, (*_OF_METHODS, "program", *_OF_PROGRAMS), "[solve]")
    fields = {axis.field for axis in axes}
    for field in table:
        if field in fields:
            raise InputError(f"[solve] {field}: it is given here and on an axis; give it once")
    given = {**table, **{axis.field: axis.values[0] for axis in axes if axis.is_choice}}
    for key in CHOICES:
        if not isinstance(given.get(key, ""), str):
            raise InputError(f"[solve] {key} is {kind_of(given[key])}; it must be text")
    program = given.get("program")
    for key in _OF_METHODS if program is not None else _OF_PROGRAMS:
        if key in given or key in fields:
            if program is None:
                raise InputError(f"{key} has no meaning without a program; give [solve] program")
            raise InputError(
                f"{key} has no meaning with a program, which advances with the step size of "
                "the scene; leave it out"
            )
    lipschitz = number("[solve] lipschitz", given.get("lipschitz", 500.0))
    if not lipschitz >= 0.0:
        raise InputError(f"[solve] lipschitz is {lipschitz:g}; allowed: a number from 0")
    method = given.get("method", "auto") if program is None else None
    tolerance, t_end = given.get("tolerance"), given.get("t_end")
    tolerance = None if tolerance is None else number("[solve] tolerance", tolerance)
    t_end = None if t_end is None else finite("[solve] t_end", t_end)
    listing, reading = given.get("listing", "original"), given.get("reading", "adopted")
    may_stop = boolean("[solve] may_stop", given.get("may_stop", True))
    compiled = boolean("[solve] compiled", given.get("compiled", False))
    return Solver(
        method, program, tolerance, t_end, listing, reading, lipschitz, may_stop, compiled
    )


def _reduction(entry: object, claims: Mapping[str, Claim]) -> ReductionSpec:
    table = {"name": entry} if isinstance(entry, str) else entry
    if not isinstance(table, dict) or "name" not in table:
        raise InputError("reductions: allowed: names, and tables with name and parameters")
    name = check_name("reduction", table["name"], REDUCTIONS, "reductions")
    where, defaults = f"reductions: {name}", REDUCTIONS[name].parameters
    for key in table:
        if key not in ("name", "as", *defaults):
            raise unknown("parameter", key, ("as", *defaults), where)
    given = {key: table.get(key, default) for key, default in defaults.items()}
    samples = integer(f"{where} samples", given.get("samples", 1))
    if not 1 <= samples <= _MOST_SAMPLES:
        raise InputError(f"{where} samples {samples}; allowed: 1 to {_MOST_SAMPLES}")
    # The rounding errors of two trajectories would hide a smaller offset.
    if "offset" in given and not 1e-12 <= number(f"{where} offset", given["offset"]) <= 1.0:
        raise InputError(f"{where} offset {given['offset']:g}; allowed: 1e-12 to 1")
    if "of" in given:
        check_name("axis", given["of"], RANKS, f"{where} of")
    if "above" in given and not 0.0 <= number(f"{where} above", given["above"]) <= math.pi:
        raise InputError(f"{where} above {given['above']:g}; allowed: 0 to pi, rad")
    if "towards" in table:
        given["towards"] = three(f"{where} towards", table["towards"])
        if not any(given["towards"]):
            raise InputError(f"{where} towards: allowed: three finite numbers, not all 0")
    if "against" in given:
        check_name("method", given["against"], METHODS, f"{where} against")
        if not 0.0 < number(f"{where} tolerance", given["tolerance"]) <= 1.0:
            raise InputError(f"{where} tolerance {given['tolerance']:g}; allowed: above 0, to 1")
    function, title = None, name
    if "id" in given:
        if not isinstance(given["id"], str) or given["id"] not in claims:
            raise unknown("claim", given["id"], claims or ["none"], f"{where} id")
        function, title = claims[given["id"]], f"claim-{given['id']}"
    title = table.get("as", title)
    if not isinstance(title, str) or not title.replace("-", "").replace("_", "").isalnum():
        raise InputError(f"{where} as: allowed: a name of letters, digits and '-'")
    return ReductionSpec(title, name, tuple(given.items()), function)


def _check_axes(axes: tuple[Axis, ...], scene: Scene) -> None:
    fields = [axis.field for axis in axes]
    lengths: dict[str, Axis] = {}
    for axis in axes:
        if fields.count(axis.field) > 1:
            raise InputError(f"{axis.field}: two axes vary this field; give one axis")
        other = lengths.setdefault(axis.dimension, axis)
        if other.count != axis.count:
            raise InputError(
                f"dimension {axis.dimension}: {other.field} has {other.count} values and "
                f"{axis.field} has {axis.count}; allowed: equal numbers of values"
            )
        along = [each.field for each in axes if each.dimension == axis.dimension]
        if axis.dimension in fields and axis.dimension not in along:
            raise InputError(
                f"dimension {axis.dimension}: a field on another axis has this name; give "
                "another name"
            )
    for ours, theirs in RIVALS:
        one = [each for each in fields if each.startswith(ours)]
        two = [each for each in fields if each.startswith(theirs)]
        if one and two:
            raise InputError(f"{one[0]} and {two[0]} are both given; give one of them")
    for field in fields:
        check_state_axis(scene, field)
        has = body_of(scene)[0]
        needs = next((x for x in ("coefficients", "inertia") if x in field), "moments")
        if field.startswith("body.") and needs != has:
            raise InputError(f"axis {field}: the scene's body is given by {has}")
        if field in ("tilt", "azimuth") and scene.moments is None:
            raise InputError(f"axis {field}: the body is given by {has}; give moments")
        has_direction = any(name in fields for name in ("tilt", "height", "longitude"))
        if field == "omega.magnitude" and not any(scene.omega) and not has_direction:
            raise InputError(
                f"axis {field}: the omega of the scene is 0 and has no direction; give "
                "another omega"
            )


def _check_names(sweep: Sweep) -> None:
    for name in (*(axis.field for axis in sweep.axes), *(each.name for each in sweep.reductions)):
        if len(name.encode()) > _LONGEST_NAME:
            raise InputError(
                f"{name:.40}... has {len(name.encode())} bytes; allowed: {_LONGEST_NAME}, because "
                "a folder of the store has this name"
            )


def _check_reductions(sweep: Sweep) -> None:
    has_attitudes = sweep.scene.torque.needs_attitude or needs_attitudes(sweep.reductions)
    for axis in sweep.axes:
        if axis.field in ATTITUDE and not has_attitudes:
            raise InputError(
                f"axis {axis.field}: neither the torque nor a reduction depends on the attitude; "
                "leave the axis out"
            )
    kind = "method" if sweep.solver.program is None else "program"
    names = [asked.name for asked in sweep.reductions]
    taken = {*sweep.dimensions, *(axis.field for axis in sweep.axes)}
    for asked in sweep.reductions:
        if names.count(asked.name) > 1:
            raise InputError(
                f"reductions: two have the name {asked.name}; give one of them another name "
                "with 'as'"
            )
        reduction = REDUCTIONS[asked.reduction]
        if asked.name in taken or asked.name in ("component", "invariant", "checksums"):
            raise InputError(
                f"reductions: {asked.name} is the name of an axis; give another name with 'as'"
            )
        if reduction.dimension in taken:
            raise InputError(
                f"dimension {reduction.dimension}: {asked.name} has a dimension with this "
                "name; give another name"
            )
        if reduction.only not in ("", kind):
            allowed = [name for name, each in REDUCTIONS.items() if each.only in ("", kind)]
            raise InputError(
                f"reductions: {asked.reduction} can't be computed from a {kind}; allowed with "
                f"a {kind}: {', '.join(allowed)}"
            )
        for method in _choices(sweep, "method", sweep.solver.method):
            if "attitude" in reduction.needs and method not in PREPARED_WITH_ATTITUDE:
                raise InputError(
                    f"reductions: {asked.reduction} can't be computed with {method}; allowed: "
                    f"{', '.join(PREPARED_WITH_ATTITUDE)}"
                )
        if "moments" in reduction.needs and sweep.scene.moments is None:
            raise InputError(
                f"reductions: {asked.reduction} needs the moments of the body; give moments"
            )
        torque = any(axis.field.startswith("torque") for axis in sweep.axes)
        if "no torque" in reduction.needs and (torque or not sweep.scene.torque.is_zero):
            raise InputError(
                f"reductions: {asked.reduction} needs a scene without torque, because a "
                "torque changes energy and momentum; leave it out"
            )


def _choices(sweep: Sweep, field: str, default: str | None) -> Iterable[str]:
    for axis in sweep.axes:
        if axis.field == field:
            return [str(each) for each in axis.values]
    return [] if default is None else [default]


def _chosen_together(axes: tuple[Axis, ...]) -> Iterator[dict[str, Any]]:
    words = [axis for axis in axes if axis.is_choice]
    counts = {axis.dimension: axis.count for axis in words}
    for at in itertools.product(*map(range, counts.values())):
        place = dict(zip(counts, at, strict=True))
        yield {axis.field: axis.values[place[axis.dimension]] for axis in words}


def _check_solvers(sweep: Sweep) -> None:
    solver = sweep.solver
    programs = list(_choices(sweep, "program", solver.program))
    own = [] if programs else _choices(sweep, "method", solver.method)
    against = [dict(each.parameters).get("against") for each in sweep.reductions]
    named = [name for name in (*own, *filter(None, against)) if name in REGISTRY]
    check_state_solver(sweep.scene, named, bool(programs))
    if any(programs):
        checked_scene(sweep.scene, any_state=True)
    for program in programs:
        check_name("program", program, PROGRAMS)
    for chosen in _chosen_together(sweep.axes):
        one = replace(solver, **chosen)
        if one.program is not None:
            listing_of(one.program, one.listing, one.reading)
    varied = [axis for axis in sweep.axes if axis.field == "tolerance"]
    methods = list(_choices(sweep, "method", solver.method))
    for method in methods:
        check_name("method", method, REGISTRY)
        finest = REGISTRY[method].finest
        least = float(varied[0].coordinates().min()) if varied else solver.tolerance
        asked = requested_tolerance(method, least)
        if not REGISTRY[method].is_fixed_step and not finest <= asked <= 1.0:
            raise InputError(f"tolerance is {asked:g}; allowed for {method}: {finest:.2g} to 1")
    is_fixed = bool(methods) and all(REGISTRY[method].is_fixed_step for method in methods)
    if is_fixed and (varied or solver.tolerance is not None):
        raise InputError(f"{methods[0]} has a fixed step and no tolerance; give none")
    ends = [axis.coordinates() for axis in sweep.axes if axis.field == "t_end"]
    if solver.t_end == 0.0 or not all(each.all() for each in ends):
        raise InputError("t_end is 0; allowed: positive and negative times")
