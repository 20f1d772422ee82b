"""Lines of a report on a scene and a run."""

import itertools
import math
from collections.abc import Iterable, Sequence

from pyharness.model.assumptions import MARK, assumed, legend
from pyharness.model.changing import ChangingMoments
from pyharness.model.inertia_function import InertiaFunction
from pyharness.model.listing import Listing
from pyharness.model.report import counted, short
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import ATTITUDE, N_INPUTS, OMEGA, TIME
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Trajectory, singular_steps

# Most characters of an expression, or of its constants, in a heading.
_LONGEST_TEXT = 60


def scene_title(scene: Scene) -> str:
    return f"Case {scene.case}: {scene.name}" if scene.case else scene.name


def heading(scene: Scene, listings: Iterable[Listing] = ()) -> list[str]:
    """Return lines that describe a scene; marked values are assumed in runs of `listings`."""
    if scene.inertia is not None:
        body = f"I = {', '.join(map(_tuple, scene.inertia))} kg m2"
    elif isinstance(scene.changing, InertiaFunction):
        body = f"I = {scene.changing.phrase}, in kg m2"
    elif isinstance(scene.changing, ChangingMoments):
        body = f"I = {_polynomials(scene.changing.polynomials)} kg m2"
    elif scene.changing is not None:
        body = f"I = {', '.join(map(_polynomials, scene.changing.elements))} kg m2"
    elif scene.moments is not None:
        body = f"I = {_tuple(scene.moments)} kg m2"
    else:
        body = f"A, B, C = {_tuple(scene.euler_coefficients)}"
    unit = "N m" if scene.coefficients is None else "rad/s2"
    if isinstance(scene.torque, StateTorque):
        torque = _state_torque(scene.torque, unit)
    else:
        torque = "no torque" if scene.torque.is_zero else f"N = {_law_phrase(scene.torque, unit)}"
    among = list(listings)
    found = assumed(scene, among)
    on_omega, on_steps = (
        MARK if any(each["on"] == part for each in found) else "" for part in ("omega", "steps")
    )
    number, noun = counted(scene.steps, "step").split()
    lines = [
        scene_title(scene),
        f"{body}; {torque}; omega(0) = {_tuple(scene.omega)}{on_omega} rad/s; "
        f"{number}{on_steps} {noun} of {scene.step_size:g} s",
        *legend([(scene, among)]),
    ]
    if scene.is_impossible:
        lines.append("no rigid body has these moments: the largest exceeds the sum of the others")
    if scene.attitude is not None:
        lines.append(f"attitude(0) = {_tuple(scene.attitude)}")
    rates = scene.torque.expression[3:] if isinstance(scene.torque, StateTorque) else ()
    for state, rate in itertools.zip_longest(scene.states, rates):
        law = "" if rate is None else f", rate {_shortened(rate)}"
        lines.append(f"{state.name}(0) = {state.start:g}{law}")
    return lines


def _polynomials(coefficients: Sequence[Sequence[float]]) -> str:
    return f"({', '.join(map(_polynomial, coefficients))})"


def _polynomial(coefficients: Sequence[float]) -> str:
    text = ""
    for power, coefficient in enumerate(coefficients):
        if coefficient:
            minus, plus = (" - ", " + ") if text else ("-", "")
            factor = ("", " t", f" t^{power}")[min(power, 2)]
            text += f"{minus if coefficient < 0.0 else plus}{abs(coefficient):g}{factor}"
    return text or "0"


def _law_phrase(law: TorqueLaw, unit: str) -> str:
    return f"{_law(law)} {unit}" + (" about the axes of space" if law.in_space else "")


def _state_torque(torque: StateTorque, unit: str) -> str:
    if torque.expression or torque.terms:
        parts = []
        if torque.expression:
            shown = ", ".join(map(_shortened, torque.expression[:3]))
            constants = ", ".join(f"{name} = {value:g}" for name, value in torque.constants)
            parts = [f"({shown}) {unit}" + (f" with {_shortened(constants)}" if constants else "")]
        for part in torque.terms:
            if isinstance(part, TorqueLaw):
                parts.append(_law_phrase(part, unit))
            else:
                parts.append(part[0][1].replace("_", " "))
        return f"N = {' + '.join(parts)}"
    if torque.tape is None:
        names = ["t", "omega", "attitude"] if torque.needs_attitude else ["t", "omega"]
        return f"N is an opaque function of {_joined(names)}, in {unit}"
    inputs: dict[str, Iterable[int]] = {"t": (TIME,), "omega": OMEGA, "attitude": ATTITUDE}
    inputs["states"] = range(N_INPUTS, torque.tape.n_inputs)
    names = [name for name, slots in inputs.items() if not torque.tape.inputs.isdisjoint(slots)]
    return f"N is a recorded function of {_joined(names or ['constants'])}, in {unit}"


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_TEXT else f"{text[: _LONGEST_TEXT - 3]}..."


def _joined(names: Sequence[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


def _law(law: TorqueLaw) -> str:
    if not law.varies:
        return _tuple(law.constant)
    parts = [_tuple(law.constant)] if any(law.constant) else []
    if any(law.rate):
        parts.append(f"{_tuple(law.rate)} t")
    for name, waves in (("sin", law.sines), ("cos", law.cosines)):
        parts += [f"{_tuple(a)} {name} {f:g}t" for a, f in waves]
    return " + ".join(parts)


def _tuple(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{x:g}" for x in values) + ")"


def ending(trajectory: Trajectory) -> str:
    steps = counted(trajectory.steps, "step")
    counts = f"{steps}, {counted(trajectory.evaluations, 'right-hand side')}"
    if trajectory.stop is not None:
        stop = trajectory.stop
        return (
            f"stopped at step {stop.step} by {stop.variable}: "
            f"Lipschitz quotient {short(stop.quotient)} ({counts})"
        )
    endings = {
        "overflow": "overflow: the rows end before the first omega that is not finite",
        "singular": f"singular: {trajectory.reason}",
        "sliding": f"sliding: {trajectory.reason}",
        "stalled": f"stalled: {trajectory.reason}",
        "unchecked": "unchecked: a short change of the torque may have been passed",
        "event": "ended by a terminal event",
        "sensitive": (
            f"sensitive: {trajectory.reason}"
            if trajectory.growth is None and trajectory.reason
            else sensitive(trajectory.growth, trajectory.digits)
        ),
    }
    told = singular_steps(trajectory.ier)
    return f"{endings.get(trajectory.ended, 'complete')} ({counts}){told and f'; {told}'}"


def sensitive(growth: float | None, digits: float | None) -> str:
    left = counted(math.floor(digits or 0.0), "digit")
    return f"sensitive: rounding errors are amplified by {short(growth)}; {left} left"


def estimates(trajectory: Trajectory) -> list[str]:
    told = []
    if trajectory.error is not None and trajectory.digits is not None:
        of = "of the largest |omega|" + (" or of a state" if trajectory.states else "")
        told.append(f"estimated error {short(trajectory.error)} {of}")
        told.append(f"digits left {trajectory.digits:.1f}")
    if trajectory.growth is not None:
        told.append(f"error amplification {short(trajectory.growth)}")
    return ["; ".join(told)] if told else []
