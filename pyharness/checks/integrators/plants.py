"""Faults planted in an integrator's requests and answers, and the self-test that uses them."""

import itertools
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pyharness.checks.integrators.faults import FAULTS, State, as_output, space_omega
from pyharness.checks.integrators.judging import Ask, Verdict, judge_problem
from pyharness.checks.integrators.problem import Problem
from pyharness.checks.integrators.protocol import Motion, read_motion
from pyharness.checks.integrators.recognition import FIRST_ORDER, recognised
from pyharness.checks.plants.outcome import Outcome, control
from pyharness.checks.port_process import PATIENCE, PortError, PortProcess
from pyharness.model.attitude import product
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

_SAYS = {each.name: each.says for each in FAULTS} | FIRST_ORDER
_STEP_AXIS = np.array([0.6, 0.0, 0.8])  # of the rotation that a first-order fault adds


@dataclass(frozen=True)
class IntegratorPlant:
    """A fault planted in an integrator, and the name by which it must be recognised."""

    name: str
    request: Callable[[dict[str, Any]], None] | None = None
    motion: Callable[[Scene, Motion], Motion] | None = None
    advance: Callable[[Any, Array, Array, float], Any] | None = None
    needs_step: bool = False  # whether an integrator with a tolerance can't have the fault


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
    """Rotate the initial angular momentum about a body axis by h rad; h is the step size in s."""
    moments, h = np.array(asked["moments"]), asked["step_size"]
    vector = moments * np.array(asked["omega"])
    across = np.cross(_STEP_AXIS, vector)
    along = _STEP_AXIS * (_STEP_AXIS @ vector)
    turned = along + math.cos(h) * (vector - along) + math.sin(h) * across
    asked["omega"] = (turned / moments).tolist()


def _set(field: str, change: Callable[[Any], Any]) -> Callable[[dict[str, Any]], None]:
    def plant(asked: dict[str, Any]) -> None:
        asked[field] = change(asked[field])

    return plant


def _times(change: Callable[[float, float], float]) -> Callable[[dict[str, Any]], None]:
    def plant(asked: dict[str, Any]) -> None:
        asked["times"] = [change(t, asked["step_size"]) for t in asked["times"]]

    return plant


def _ordered(order: str) -> Callable[[dict[str, Any]], None]:
    return _set("moments", lambda moments: [moments[int(axis) - 1] for axis in order])


def _output(name: str) -> Callable[[Scene, Motion], Motion]:
    def plant(scene: Scene, motion: Motion) -> Motion:
        if motion.attitude is None:
            return motion
        return replace(motion, attitude=as_output(name, motion.attitude, scene))

    return plant


def _in_space(scene: Scene, motion: Motion) -> Motion:
    if motion.attitude is None:
        return motion
    return replace(motion, omega=space_omega(State(motion.omega, motion.attitude), scene).omega)


def _turn(omega: Array, h: float) -> Any:
    spin = float(np.linalg.norm(omega))
    factor = math.sin(0.5 * spin * h) / spin if spin else 0.0
    return math.cos(0.5 * spin * h), *(factor * omega).tolist()


def _set_part_of_torque(field: str, value: Any) -> Callable[[dict[str, Any]], None]:
    return _set("torque", lambda law: {**law, field: value})


PLANTS = (
    IntegratorPlant("gyroscopic-missing", _no_gyroscopic_term),
    *(IntegratorPlant(f"moments-{order}", _ordered(order))
      for order in ("132", "213", "231", "312", "321")),
    IntegratorPlant("torque-missing", lambda asked: _scaled(asked, (0.0, 0.0, 0.0))),
    IntegratorPlant("torque-frozen", _frozen),
    IntegratorPlant("torque-rate-missing", _set_part_of_torque("rate", [0.0] * 3)),
    IntegratorPlant("torque-sines-missing", _set_part_of_torque("sines", [])),
    IntegratorPlant("torque-cosines-missing", _set_part_of_torque("cosines", [])),
    IntegratorPlant("torque-sign", lambda asked: _scaled(asked, (-1.0, -1.0, -1.0))),
    IntegratorPlant("torque-undivided", lambda asked: _scaled(asked, asked["moments"])),
    IntegratorPlant("torque-held", _held, needs_step=True),
    IntegratorPlant("half-speed", _times(lambda t, h: 0.5 * t)),
    IntegratorPlant("double-speed", _times(lambda t, h: 2.0 * t)),
    IntegratorPlant("step-late", _times(lambda t, h: t - h)),
    IntegratorPlant("step-early", _times(lambda t, h: t + h)),
    IntegratorPlant("first-order", needs_step=True, motion=None,
                    request=lambda asked: _set(
                        "omega", lambda w: [(1.0 + asked["step_size"]) * x for x in w])(asked)),
    IntegratorPlant("first-order-splitting", _turned_start, needs_step=True),
    IntegratorPlant("omega-in-space", motion=_in_space),
    IntegratorPlant("omega-in-degrees",
                    motion=lambda scene, motion: replace(
                        motion, omega=180.0 / math.pi * motion.omega)),
    IntegratorPlant("quaternion-transposed", motion=_output("quaternion-transposed")),
    IntegratorPlant("scalar-last", motion=_output("scalar-last")),
    IntegratorPlant("attitude-from-identity",
                    _set("attitude", lambda attitude: [1.0, 0.0, 0.0, 0.0])),
    IntegratorPlant("attitude-frame",
                    advance=lambda q, a, b, h: product(_turn(0.5 * (a + b), h), q)),
    IntegratorPlant("attitude-rate",
                    advance=lambda q, a, b, h: product(q, _turn(a + b, h))),
    IntegratorPlant("first-order-attitude", needs_step=True,
                    advance=lambda q, a, b, h: product(q, _turn(a, h))),
)  # fmt: skip
"""The planted faults."""


def with_plant(ask: Ask, plant: IntegratorPlant, scene: Scene) -> Ask:
    """Return a function that requests states in a scene from an integrator with a planted fault."""

    def asked_with_fault(line: bytes, rows: int) -> Motion:
        asked = json.loads(line)
        if plant.advance is not None:
            return _advanced(ask, plant.advance, asked)
        if plant.request is not None:
            plant.request(asked)
        motion = ask(json.dumps(asked).encode(), rows)
        return motion if plant.motion is None else plant.motion(scene, motion)

    return asked_with_fault


def _advanced(
    ask: Ask, advance: Callable[[Any, Array, Array, float], Any], asked: dict[str, Any]
) -> Motion:
    h, times = asked["step_size"], asked["times"]
    count = round(times[-1] / h)
    every = [h * (n + 1) for n in range(count)]
    motion = ask(json.dumps({**asked, "times": every}).encode(), count)
    if motion.refusal or motion.attitude is None:
        return motion
    omega = np.vstack([asked["omega"], motion.omega])
    q, rows = tuple(asked["attitude"]), []
    for a, b in itertools.pairwise(omega):
        q = advance(q, a, b, h)
        rows.append(q)
    chosen = [round(t / h) - 1 for t in times]
    attitude = np.array(rows)[chosen]
    return replace(motion, omega=motion.omega[chosen], attitude=attitude)


def self_test(
    command: str, chosen: Sequence[Problem], due: float = 1.0, patience: float = PATIENCE
) -> Iterator[Outcome]:
    """Yield the outcomes without a fault, then with each planted fault.

    Without valid answers, only a failed control is yielded.
    """
    try:
        with PortProcess(command, patience, "--integrator") as process:

            def ask(line: bytes, rows: int) -> Motion:
                return read_motion(process.ask(line), rows)

            right = Verdict(command)
            for problem in chosen:
                judge_problem(ask, problem, due, right, lambda name: "")
            if not right.judged:
                raise PortError("the integrator refused every scene")
            names, failed = _recognise(right)
            yield control(failed + len(names), _note(names))
            for plant in PLANTS:
                found = Verdict(command)
                for problem in chosen:
                    faulty = with_plant(ask, plant, problem.scene)
                    judge_problem(faulty, problem, due, found, lambda name: "")
                yield _outcome(plant, found, _can_have(plant, right))
    except PortError as error:
        yield control(1, str(error))


def _recognise(verdict: Verdict) -> tuple[list[str], int]:
    failed = sum(not check.passed for check in verdict.checks)
    return [each.name for each in recognised(verdict.judged)], failed


def _note(names: Sequence[str]) -> str:
    return f"recognised: {', '.join(names) or 'no fault'}"


def _outcome(plant: IntegratorPlant, found: Verdict, has_effect: bool) -> Outcome:
    names, failed = _recognise(found)
    note = _note(names) if has_effect else "the integrator can't have this fault"
    is_named = plant.name in names or not has_effect
    return Outcome(plant.name, _SAYS[plant.name], is_named, failed, note, has_effect)


def _can_have(plant: IntegratorPlant, right: Verdict) -> bool:
    if plant.needs_step and right.control == "tolerance":
        return False
    kinds = {each.problem.kind for each in right.judged}
    if plant.name.startswith("torque"):
        return bool(kinds & ({"wave"} if plant.name in _OF_WAVES else {"constant", "wave"}))
    needs_attitude = plant.advance or plant.name in _OF_ATTITUDE
    return not needs_attitude or right.judged[0].finest.attitude is not None


_OF_WAVES = (
    "torque-frozen", "torque-held", "torque-rate-missing", "torque-sines-missing",
    "torque-cosines-missing",
)  # fmt: skip
_OF_ATTITUDE = (
    "omega-in-space", "quaternion-transposed", "scalar-last", "attitude-from-identity",
)  # fmt: skip
