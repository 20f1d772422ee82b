"""Planted faults in requests to an integrator and in its answers, and the self-test with them."""

import itertools
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pyharness.checks.check import Check, Name
from pyharness.checks.integrators.faults import FAULTS, State, as_output, space_omega
from pyharness.checks.integrators.judging import Ask, Verdict, judge_problem
from pyharness.checks.integrators.problem import Problem
from pyharness.checks.integrators.protocol import Motion, read_motion
from pyharness.checks.integrators.recognition import recognised
from pyharness.checks.port_process import PATIENCE, PortError, PortProcess
from pyharness.checks.report import checks_report, summary_page
from pyharness.model.attitude import product
from pyharness.model.report import Report, counted
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

_STEP_AXIS = np.array([0.6, 0.0, 0.8])  # of the rotation that a first-order fault adds


@dataclass(frozen=True)
class IntegratorPlant:
    """A fault that is planted in an integrator; its name is that by which it must be recognised."""

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
    """Rotate the initial angular momentum about a body axis by a step's size, in rad."""
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


def _part(field: str, value: Any) -> Callable[[dict[str, Any]], None]:
    return _set("torque", lambda law: {**law, field: value})


PLANTS = (
    IntegratorPlant("gyroscopic-missing", _no_gyroscopic_term),
    *(IntegratorPlant(f"moments-{order}", _ordered(order))
      for order in ("132", "213", "231", "312", "321")),
    IntegratorPlant("torque-missing", lambda asked: _scaled(asked, (0.0, 0.0, 0.0))),
    IntegratorPlant("torque-frozen", _frozen),
    IntegratorPlant("torque-rate-missing", _part("rate", [0.0] * 3)),
    IntegratorPlant("torque-sines-missing", _part("sines", [])),
    IntegratorPlant("torque-cosines-missing", _part("cosines", [])),
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
"""The planted faults: first those in requests, then those in answers."""


def with_plant(ask: Ask, plant: IntegratorPlant, scene: Scene) -> Ask:
    """Return a function that asks an integrator with a planted fault, in one scene."""

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


@dataclass(frozen=True)
class Recognised:
    """A planted fault (None: the control), and the names of the faults that were recognised."""

    plant: IntegratorPlant | None
    names: tuple[str, ...]
    failed: int
    has_effect: bool = True
    note: str = ""

    @property
    def passed(self) -> bool:
        """Return whether the fault was named; for the control, whether nothing was found."""
        if self.note or not self.has_effect:
            return not self.note
        return self.plant.name in self.names if self.plant else not (self.names or self.failed)


def self_test(
    command: str, chosen: Sequence[Problem], due: float = 1.0, patience: float = PATIENCE
) -> Iterator[Recognised]:
    """Yield the faults that are recognised, first without a planted fault, then with each of them.

    Without valid answers, only a failed control is yielded.
    """
    try:
        with PortProcess(command, patience, "--integrator") as process:

            def ask(line: bytes, rows: int) -> Motion:
                return read_motion(process.ask(line), rows)

            control = Verdict(command)
            for problem in chosen:
                judge_problem(ask, problem, due, control, lambda name: "")
            if not control.judged:
                raise PortError("the integrator refused every scene")
            yield _seen(None, control)
            for plant in PLANTS:
                found = Verdict(command)
                for problem in chosen:
                    faulty = with_plant(ask, plant, problem.scene)
                    judge_problem(faulty, problem, due, found, lambda name: "")
                yield replace(_seen(plant, found), has_effect=_can_have(plant, control))
    except PortError as error:
        yield Recognised(None, (), 1, note=str(error))


def _seen(plant: IntegratorPlant | None, verdict: Verdict) -> Recognised:
    failed = sum(not check.passed for check in verdict.checks)
    return Recognised(plant, tuple(each.name for each in recognised(verdict.judged)), failed)


def _can_have(plant: IntegratorPlant, control: Verdict) -> bool:
    if plant.needs_step and control.control == "tolerance":
        return False
    kinds = {each.problem.kind for each in control.judged}
    if plant.name.startswith("torque"):
        return bool(kinds & ({"wave"} if plant.name in _OF_WAVES else {"constant", "wave"}))
    needs_attitude = plant.advance or plant.name in _OF_ATTITUDE
    return not needs_attitude or control.judged[0].finest.attitude is not None


_OF_WAVES = (
    "torque-frozen", "torque-held", "torque-rate-missing", "torque-sines-missing",
    "torque-cosines-missing",
)  # fmt: skip
_OF_ATTITUDE = (
    "omega-in-space", "quaternion-transposed", "scalar-last", "attitude-from-identity",
)  # fmt: skip


def as_check(found: Recognised) -> Check:
    """Return the result for a planted fault as a check, which passes if it was named."""
    name = Name("self-test", found.plant.name if found.plant else "control")
    if found.note:
        return name.judged(False, found.note)
    if not found.has_effect:
        return name.judged(True, "the integrator can't have this fault")
    seen = ", ".join(found.names) or "no fault"
    return name.judged(found.passed, f"recognised: {seen}", float(found.failed))


def self_test_report(command: str, found: Sequence[Recognised], again: str) -> Report:
    """Return the report of the self-test, which the command `again` repeats."""
    checks = [replace(as_check(each), again=again) for each in found]
    planted = [each for each in found if each.plant and each.has_effect]
    named = sum(each.passed for each in planted)
    head = f"{command}: {counted(len(planted), 'planted fault')}, {named} named"
    says = {each.name: each.says for each in FAULTS}
    lines = [
        f"{'FAILED ' if not check.passed else ''}{check.name.subject}: {check.note}"
        for check in checks
    ]
    told = [f"{each.plant.name}: {says[each.plant.name]}" for each in found
            if each.plant and not each.passed and each.plant.name in says]  # fmt: skip
    text = [[head], lines, *([told] if told else [])]
    page = summary_page("verify --integrator --self-test", checks, [head])
    return checks_report("verify", checks, text, page, integrator=command)
