"""Random combinations of what differs in a batch of `solve_many`, compared with `solve`.

The command is ``python -m tests.campaigns.combination_campaign COUNT SEED [FIRST]``. Each batch
has a torque of `TORQUES`, a body of `BODIES`, parameters or none, own states or none, attitudes or
none, and one time or several. Errors of some bodies are judged; the run time of a body, relative to
the same torque with constant moments and one time, is only printed.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from random import Random
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from pyharness import Ensemble, Scene, TorqueLaw, solve, solve_many
from pyharness.engine.prepared.many_scenes import checked_copies, scene_of_row
from pyharness.model.trajectory import Array
from pyharness.torques import gravity_gradient
from tests.campaigns import driver

MODULE = "tests.campaigns.combination_campaign"
_TIMED, _REPEATS = 400, 2  # bodies; calls, of which the fastest counts
_JUDGED = 3  # bodies
_TOLERANCES = 1e-6, 1e-9, 1e-11
_LAST = 3.0  # s
MOMENTS = (4.0, 3.0, 2.0)
MATRIX = np.array([[4.0, 0.3, 0.1], [0.3, 3.0, 0.2], [0.1, 0.2, 2.0]])


def linear(t: Any, omega: Any, c: float = 0.1) -> Any:
    return -c * omega


def clipped(t: Any, omega: Any, c: float = 0.1) -> Any:
    return np.clip(-c * omega, -0.05, 0.05)


def _with_state(torque: Callable[..., Any]) -> Callable[..., Any]:
    def with_state(t: Any, omega: Any, states: Any, c: float = 0.1) -> Any:
        x = states["x"]
        push = np.array([-0.02 * x, 0.0, 0.0])
        return torque(t, omega, c) + push, {"x": omega[0] - 0.1 * x}

    return with_state


_WAVES = [((0.1, 0.2, 0.3), 2.0)]
TORQUES: dict[str, Any] = {
    "none": TorqueLaw(), "law": TorqueLaw((0.1, 0.2, -0.1), sines=_WAVES),
    "law in space": TorqueLaw((0.1, 0.2, -0.1), frame="space"), "linear": linear,
    "ready": gravity_gradient(MOMENTS, 0.3), "clipped": clipped,
}  # fmt: skip
BODIES = "moments", "arrays of moments", "matrix", "arrays of matrices"


class Batch(NamedTuple):
    name: str  # of the combination
    scene: Scene
    arguments: dict[str, Any]
    bare: dict[str, Any]  # arguments of the torque's plain case


def draw(random: Random, torque: str, n: int) -> Batch:
    """Draw a batch of n bodies."""
    rng = np.random.default_rng(random.getrandbits(32))
    body = random.choice(BODIES)
    has_parameters = random.random() < 0.5 and callable(TORQUES[torque])
    has_states = random.random() < 0.4 and callable(TORQUES[torque])
    has_attitude = random.random() < 0.3 or torque in ("law in space", "ready")
    count = random.choice((1, 1, 10))
    law = _with_state(TORQUES[torque]) if has_states else TORQUES[torque]
    given: Any = {"inertia": MATRIX.tolist()} if body == "matrix" else {"moments": MOMENTS}
    if has_states:
        given["states"] = {"x": (random.choice((0.0, 0.5)), random.choice((0.0, 1.0)))}
    scene = Scene("", (1.0, 1.0, 1.0), torque=law, **given)
    bare: dict[str, Any] = {"omega": rng.standard_normal((n, 3)), "t_end": _LAST}
    bare["tolerance"] = random.choice(_TOLERANCES)
    if has_attitude:
        bare["attitude"] = rng.standard_normal((n, 4))
    found = dict(bare)
    if body == "arrays of moments":
        found["moments"] = np.add(MOMENTS, rng.uniform(0.0, 0.5, (n, 3)))
    elif body == "arrays of matrices":
        found["inertia"] = MATRIX + rng.uniform(0.0, 0.5, (n, 3))[:, :, None] * np.eye(3)
    if has_parameters:
        found["parameters"] = {"c": rng.uniform(0.05, 0.15, n)}
    if has_states and random.random() < 0.5:
        found["states"] = {"x": rng.uniform(0.2, 0.5, n)}
    if count > 1:
        del found["t_end"]
        first = -_LAST if random.random() < 0.3 else 0.3
        found["times"] = np.linspace(first, _LAST, count)
    parts = {
        torque: True, body: True, "parameters": has_parameters, "states": has_states,
        "attitudes": has_attitude, f"{count} times": count > 1,
    }  # fmt: skip
    return Batch(", ".join(name for name, there in parts.items() if there), scene, found, bare)


def alone(batch: Batch, i: int) -> Scene:
    """Return the scene of body i."""
    arrays: dict[str, Any] = dict.fromkeys(("omega", "attitude", "moments", "inertia"))
    arrays |= {name: batch.arguments.get(name) for name in arrays}
    parameters = batch.arguments.get("parameters") or {}
    rows = {f"parameters: {name}": values for name, values in parameters.items()}
    scene = scene_of_row(batch.scene, checked_copies({**arrays, **rows}), i)
    starts = batch.arguments.get("states") or {}
    states = tuple(
        each._replace(start=float(starts[each.name][i])) if each.name in starts else each
        for each in scene.states
    )
    return replace(scene, states=states)


def judge(tally: driver.Tally, batch: Batch, found: Ensemble) -> None:
    """Compare some bodies with `solve`, by the tolerance and by the stated errors."""
    times, tolerance = batch.arguments.get("times"), batch.arguments["tolerance"]
    if not found.has_result.all():
        tally.fault(f"{batch.name}: ended {set(found.ended.flat)}")
        return
    assert found.error is not None
    for i in range(min(_JUDGED, len(found.omega))):
        ends = np.atleast_1d(_LAST if times is None else times)
        one = solve(alone(batch, i), ends, tolerance=1e-13)
        assert one.error is not None
        pairs: list[Any] = [(found.omega[i], one.omega, np.abs(one.omega).max())]
        if found.attitude is not None:
            pairs.append((found.attitude[i], one.attitude, 0.5))
        if found.own is not None:
            pairs.append((found.own[i], one.own, np.abs(np.array(one.own)).max()))
        apart = max(_largest(ours, theirs) / scale for ours, theirs, scale in pairs)
        tally.judge(f"error, tolerances: {batch.name.partition(',')[0]}", apart, tolerance)
        # A size of an own state is the largest so far, which may be smaller than that of `one`.
        stated = float(np.max(found.error[i])) + one.error + 4e-15
        tally.record(f"error, stated errors: {batch.name.partition(',')[0]}", apart / stated)


def _largest(ours: Array, theirs: Any) -> float:
    return float(np.abs(ours - theirs).max())


def try_batch(tally: driver.Tally) -> None:
    """Judge a random batch, and record its run time."""
    torque = list(TORQUES)[tally.number % len(TORQUES)]
    batch = draw(Random(f"combination {tally.seed} {tally.number}"), torque, _TIMED)
    judge(tally, batch, solve_many(batch.scene, **batch.arguments, estimates=True))
    plain = Scene("", (1.0, 1.0, 1.0), moments=MOMENTS, torque=TORQUES[torque])
    ratio = _seconds(batch.scene, batch.arguments) / _seconds(plain, batch.bare)
    tally.record(f"run time: {torque}", ratio)
    print(f"{ratio:8.2f}  {batch.name}", flush=True)


def _seconds(scene: Scene, arguments: dict[str, Any]) -> float:
    found = []
    for _ in range(_REPEATS + 1):  # the first call records
        begin = process_time()
        solve_many(scene, **arguments)
        found.append(process_time() - begin)
    return min(found[1:])


if __name__ == "__main__":
    sys.exit(driver.run(MODULE, try_batch, sys.argv[1:]))
