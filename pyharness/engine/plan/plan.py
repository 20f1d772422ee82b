"""The choice of a scene's method, and of the quantities to compute."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from pyharness.engine.plan.registry import REGISTRY, check_torque, requested_tolerance
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.effort import waves
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Trajectory

FINEST = REGISTRY["auto"].finest
# Runge-Kutta averages fast waves of a torque, and may be faster than the Taylor series, or the only
# method that succeeds. The kernel chooses between them down to the smallest tolerance at which
# Runge-Kutta was better in tests.
RK4_OR_TAYLOR = "quick or taylor"
_FEW_DIGITS = 1e-9


class Decision(NamedTuple):
    """The decision whether a part, such as ``torque``, is computed."""

    part: str
    kept: bool
    why: str


@dataclass(frozen=True)
class Plan:
    scene: Scene
    method: str  # chosen or requested
    closed_form: str | None  # sphere, symmetric or elliptic, if a closed form is used
    fallback: str | None  # method to use if `method` refuses the scene
    velocity: bool  # whether the translational velocity is requested
    rows: bool  # whether intermediate output is requested

    @cached_property
    def decisions(self) -> tuple[Decision, ...]:
        return tuple(_decisions(self))

    @property
    def skipped(self) -> frozenset[str]:
        return frozenset(each.part for each in self.decisions if not each.kept)


def plan(
    scene: Scene,
    method: str = "auto",
    tolerance: float | None = None,
    velocity: bool = False,
    rows: bool = False,
) -> Plan:
    tolerance = requested_tolerance(method, tolerance)
    finest = REGISTRY["quick"].finest if method == "quick" else FINEST
    if not finest <= tolerance <= 1.0:
        place = " for quick" if method == "quick" else ""
        raise InputError(f"tolerance is {tolerance:g}; allowed{place}: {finest:g} to 1")
    form = closed_form(
        checked_scene(scene, any_torque=True, any_state=True, changing=True, states=True)
    )
    check_torque(scene, method, attitude=True)
    fallback = None
    if method == "auto":
        method, fallback = chosen_method(scene, form, tolerance, rows)
    elif method == "closed-form" and form is None:
        raise InputError(f"closed-form can't take this scene: {_why_no_form(scene)}")
    form = form if method == "closed-form" else None
    return Plan(scene, method, form, fallback, velocity, rows)


def chosen_method(
    scene: Scene, form: str | None, tolerance: float, rows: bool
) -> tuple[str, str | None]:
    # A perturbation of a rotation about the middle axis may be so small that its square, which
    # the closed form needs, underflows. The Taylor series can propagate it.
    if form:
        return "closed-form", "taylor"
    few_digits = (
        not rows  # Runge-Kutta has no intermediate output
        and isinstance(scene.torque, TorqueLaw)
        and scene.changing is None
        and not scene.torque.in_space
        and waves(scene) > 0
        and tolerance >= _FEW_DIGITS
    )
    return RK4_OR_TAYLOR if few_digits else "taylor", None


def by_plan(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0, *more: bool
) -> Trajectory:
    name, fallback = chosen_method(scene, closed_form(scene), tolerance, rows=True)
    method = REGISTRY[name]
    more = more if method.gives_steps else ()
    try:
        # A closed form, which has only rounding errors, is used below its smallest tolerance too.
        return method.solve(scene, times, tolerance, effort, *more)
    except InputError as refusal:
        if not fallback:
            raise
        try:
            return REGISTRY[fallback].solve(scene, times, tolerance, effort)
        except InputError:
            raise refusal from None


def _decisions(chosen: Plan) -> Iterator[Decision]:
    scene, torque = chosen.scene, chosen.scene.torque
    closed = chosen.method == "closed-form"
    if closed:
        yield Decision("integration", kept=False, why=f"closed form: {chosen.closed_form}")
    else:
        why = "requested" if closed_form(scene) else _why_no_form(scene)
        yield Decision("integration", kept=True, why=why)
    names = ("A w2 w3", "B w1 w3", "C w1 w2")
    equal = ("I2 = I3", "I3 = I1", "I1 = I2")
    values = (1.0, 1.0, 1.0) if scene.changing is not None else scene.euler_coefficients
    for name, value, product in zip(names, values, equal, strict=True):
        if scene.changing is not None:
            yield Decision(name, kept=True, why="its inertia changes with time")
        elif value != 0.0:
            yield Decision(name, kept=True, why=f"coefficient {value:g}")
        elif closed:
            yield Decision(name, kept=False, why=product)
        else:
            # The kernels sum three products side by side in one register.
            yield Decision(name, kept=True, why=f"{product}: zero; costs no time beside the others")
    if isinstance(torque, StateTorque):
        count = "opaque" if torque.tape is None else f"{len(torque.tape.operations)} operations"
        yield Decision("torque", kept=True, why=f"depends on the state: {count}")
    else:
        yield Decision("torque", not torque.is_zero, "zero" if torque.is_zero else "acts")
        for name, terms in (("sines", torque.sines), ("cosines", torque.cosines)):
            acts = any(any(amplitude) for amplitude, _ in terms)
            yield Decision(name, acts, f"{len(terms)} in the law" if acts else "none act")
        varies = "the law varies" if torque.varies else "constant: read once"
        yield Decision("torque of time", torque.varies, varies)
    for part, wanted in (("velocity", chosen.velocity), ("attitude", scene.attitude is not None)):
        if part == "attitude" and torque.needs_attitude:
            why = "the torque is fixed in space" if torque.in_space else "the torque depends on it"
            yield Decision(part, kept=True, why=why)
        else:
            yield Decision(part, wanted, "requested" if wanted else "not requested")
    why = "intermediate output requested" if chosen.rows else "only the end"
    is_kept = chosen.rows and not closed
    yield Decision("dense output", is_kept, "closed form" if chosen.rows and closed else why)
    # No prepared solver uses the reference solution or SciPy.
    yield Decision("reference", kept=False, why="not requested")
    yield Decision("SciPy", kept=False, why="our own kernels solve it")


def _why_no_form(scene: Scene) -> str:
    if scene.changing is not None:
        return "its inertia changes with time"
    if isinstance(scene.torque, StateTorque):
        return "its torque depends on the state"
    if scene.torque.is_zero:
        return "its coefficients let it grow without bound"
    if scene.torque.in_space:
        return "its torque is fixed in space"
    return "it has a torque and is not a sphere"
