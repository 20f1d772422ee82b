"""Self-test with faults planted in an integrator's requests and answers."""

import itertools
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pyharness.checks.integrators.coverage import Tried
from pyharness.checks.integrators.faults import FAULTS, State
from pyharness.checks.integrators.judging import Verdict, judge_problem
from pyharness.checks.integrators.problem import Problem
from pyharness.checks.integrators.protocol import Ask, Motion, asking_of
from pyharness.checks.integrators.recognition import SAYS, recognised
from pyharness.checks.plants.faults import change_at
from pyharness.checks.plants.outcome import Outcome, control
from pyharness.checks.port_process import PATIENCE, PortError, PortProcess
from pyharness.model.attitude import product
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

_STATES = {each.name: each.state for each in FAULTS}
_STEP_AXIS = np.array([0.6, 0.0, 0.8])  # axis of the rotation that a first-order fault adds


# Returns the quaternion after a step, from the one before, omega at both ends, and step size (s).
Advance = Callable[[Any, Array, Array, float], Any]


@dataclass(frozen=True)
class IntegratorPlant:
    """A fault planted in an integrator, to be recognised by its name."""

    name: str
    request: Callable[[dict[str, Any]], object] | None = None  # changes the request
    state: Callable[[State, Scene], State] | None = None  # changes the answered states
    advance: Advance | None = None  # computes the attitude after each step
    # Properties, as in `_possible`, without which the fault has no effect.
    needs: tuple[str, ...] = ()


def _scaled(asked: dict[str, Any], factors: Sequence[float]) -> None:
    law = asked["torque"]
    for field in ("constant", "rate"):
        law[field] = [x * factor for x, factor in zip(law[field], factors, strict=True)]
    for wave in law["sines"] + law["cosines"]:
        pairs = zip(wave["amplitude"], factors, strict=True)
        wave["amplitude"] = [x * factor for x, factor in pairs]


def _no_gyroscopic_term(asked: dict[str, Any]) -> None:
    _scaled(asked, [1.0 / moment for moment in asked["moments"]])
    asked["moments"] = [1.0, 1.0, 1.0]


def _frozen(asked: dict[str, Any]) -> None:
    law = asked["torque"]
    for wave in law["cosines"]:
        law["constant"] = [a + b for a, b in zip(law["constant"], wave["amplitude"], strict=True)]
    asked["torque"] = {**law, "rate": [0.0] * 3, "sines": [], "cosines": []}


def _held(asked: dict[str, Any]) -> None:
    law, delay = asked["torque"], 0.5 * asked["step_size"]
    sines: list[Any] = []
    cosines: list[Any] = []
    for waves, lead, sign, other in (
        (law["sines"], sines, -1.0, cosines),
        (law["cosines"], cosines, 1.0, sines),
    ):
        for wave in waves:
            phase = wave["frequency"] * delay
            for kept, factor in ((lead, math.cos(phase)), (other, sign * math.sin(phase))):
                amplitude = [factor * x for x in wave["amplitude"]]
                kept.append({"amplitude": amplitude, "frequency": wave["frequency"]})
    asked["torque"] = {**law, "sines": sines, "cosines": cosines}


def _turned_start(asked: dict[str, Any]) -> None:
    """Rotate the requested initial angular momentum by h rad, where h is the step size in s."""
    moments, h = np.array(asked["moments"]), asked["step_size"]
    vector = moments * np.array(asked["omega"])
    across = np.cross(_STEP_AXIS, vector)
    along = _STEP_AXIS * (_STEP_AXIS @ vector)
    turned = along + math.cos(h) * (vector - along) + math.sin(h) * across
    asked["omega"] = (turned / moments).tolist()


def _at_times(change: Callable[[float, float], float]) -> Callable[[dict[str, Any]], None]:
    def plant(asked: dict[str, Any]) -> None:
        asked["times"] = [change(t, asked["step_size"]) for t in asked["times"]]

    return plant


def _ordered(order: str) -> Callable[[dict[str, Any]], None]:
    return change_at("moments", lambda moments: [moments[int(axis) - 1] for axis in order])


def _turn(omega: Array, h: float) -> Any:
    spin = float(np.linalg.norm(omega))
    factor = math.sin(0.5 * spin * h) / spin if spin else 0.0
    return math.cos(0.5 * spin * h), *(factor * omega).tolist()


PLANTS = (
    IntegratorPlant("gyroscopic-missing", _no_gyroscopic_term),
    *(IntegratorPlant(f"moments-{order}", _ordered(order))
      for order in ("132", "213", "231", "312", "321")),
    IntegratorPlant("torque-missing", lambda asked: _scaled(asked, (0.0, 0.0, 0.0)),
                    needs=("torque",)),
    IntegratorPlant("torque-frozen", _frozen, needs=("waves",)),
    IntegratorPlant("torque-rate-missing", change_at("torque.rate", lambda rate: [0.0] * 3),
                    needs=("waves",)),
    *(IntegratorPlant(f"torque-{name}-missing", change_at(f"torque.{name}", lambda waves: []),
                      needs=("waves",)) for name in ("sines", "cosines")),
    IntegratorPlant("torque-sign", lambda asked: _scaled(asked, (-1.0, -1.0, -1.0)),
                    needs=("torque",)),
    IntegratorPlant("torque-undivided", lambda asked: _scaled(asked, asked["moments"]),
                    needs=("torque",)),
    IntegratorPlant("torque-held", _held, needs=("steps", "waves")),
    IntegratorPlant("half-speed", _at_times(lambda t, h: 0.5 * t)),
    IntegratorPlant("double-speed", _at_times(lambda t, h: 2.0 * t)),
    IntegratorPlant("step-late", _at_times(lambda t, h: t - h)),
    IntegratorPlant("step-early", _at_times(lambda t, h: t + h)),
    IntegratorPlant("first-order", needs=("steps",), request=lambda asked: asked.update(
        omega=[(1.0 + asked["step_size"]) * x for x in asked["omega"]])),
    IntegratorPlant("first-order-splitting", _turned_start, needs=("steps",)),
    IntegratorPlant("omega-in-space", state=_STATES["omega-in-space"], needs=("attitude",)),
    IntegratorPlant("omega-in-degrees", state=_STATES["omega-in-degrees"]),
    *(IntegratorPlant(name, state=_STATES[name], needs=("attitude",))
      for name in ("quaternion-transposed", "scalar-last")),
    IntegratorPlant("attitude-from-identity", needs=("attitude",),
                    request=change_at("attitude", lambda attitude: [1.0, 0.0, 0.0, 0.0])),
    IntegratorPlant("attitude-frame", needs=("attitude",),
                    advance=lambda q, a, b, h: product(_turn(0.5 * (a + b), h), q)),
    IntegratorPlant("attitude-rate", needs=("attitude",),
                    advance=lambda q, a, b, h: product(q, _turn(a + b, h))),
    IntegratorPlant("first-order-attitude", needs=("steps", "attitude"),
                    advance=lambda q, a, b, h: product(q, _turn(a, h))),
)  # fmt: skip
"""The planted faults."""


def with_plant(ask: Ask, plant: IntegratorPlant, scene: Scene) -> Ask:
    def advanced(advance: Advance, asked: dict[str, Any]) -> Motion:
        h, times = asked["step_size"], asked["times"]
        count = round(times[-1] / h)
        every = [h * (n + 1) for n in range(count)]
        motion = ask(json.dumps({**asked, "times": every}).encode(), count)
        if motion.refusal or motion.attitude is None:
            return motion
        q, rows = tuple(asked["attitude"]), []
        for a, b in itertools.pairwise(np.vstack([asked["omega"], motion.omega])):
            q = advance(q, a, b, h)
            rows.append(q)
        chosen = [round(t / h) - 1 for t in times]
        return replace(motion, omega=motion.omega[chosen], attitude=np.array(rows)[chosen])

    def asked_with_fault(line: bytes, rows: int) -> Motion:
        asked = json.loads(line)
        if plant.advance is not None:
            return advanced(plant.advance, asked)
        if plant.request is not None:
            plant.request(asked)
        motion = ask(json.dumps(asked).encode(), rows)
        if plant.state is None or (motion.attitude is None and "attitude" in plant.needs):
            return motion
        # Without attitudes, `state` changes only omega.
        state: Any = State(motion.omega, motion.attitude)  # type: ignore[arg-type]
        return replace(motion, **plant.state(state, scene)._asdict())

    return asked_with_fault


def self_test(
    command: str, chosen: Sequence[Problem], tried: list[Tried], due: float = 1.0
) -> Iterator[Outcome]:
    """Yield the outcome without a fault (the control), then with each planted fault.

    The control's motions are appended to `tried`. After an invalid answer the control fails.
    """

    def judge(plant: IntegratorPlant | None = None) -> tuple[Verdict, list[str], int]:
        """Return the results, the names of recognised faults, and the number of failed checks."""
        found = Verdict(command)
        for problem in chosen:
            asking = with_plant(ask, plant, problem.scene) if plant else ask
            judge_problem(asking, problem, due, found)
        failed = sum(not check.passed for check in found.checks)
        return found, [each.name for each in recognised(found.judged)], failed

    try:
        with PortProcess(command, PATIENCE, "--integrator") as process:
            ask = asking_of(process)
            right, names, failed = judge()
            tried += right.tried
            if not right.judged:
                raise PortError("the integrator refused every scene")
            yield control(failed + len(names), _note(names))
            possible = _possible(right)
            for plant in PLANTS:
                _, names, failed = judge(plant)
                has_effect = {*plant.needs} <= possible
                note = _note(names) if has_effect else "the integrator can't have this fault"
                is_named = plant.name in names or not has_effect
                yield Outcome(plant.name, SAYS[plant.name], is_named, failed, note, has_effect)
    except PortError as error:
        yield control(1, str(error))


def _note(names: Sequence[str]) -> str:
    return f"recognised: {', '.join(names) or 'no fault'}"


def _possible(right: Verdict) -> set[str]:
    """Return the properties in `IntegratorPlant.needs` that the integrator and the scenes have."""
    kinds = {each.problem.kind for each in right.judged}
    found = {
        "steps": right.control != "tolerance",
        "torque": bool(kinds - {"free"}),
        "waves": any(each.problem.has_waves for each in right.judged),
        "attitude": right.judged[0].finest.attitude is not None,
    }
    return {name for name, has in found.items() if has}
