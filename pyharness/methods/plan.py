"""What a scene needs, and what is therefore not computed: decided before anything is computed."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from pyharness.methods.registry import REGISTRY
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene

FINEST = REGISTRY["auto"].finest
# For few digits Runge-Kutta takes fewer operations than a series; which, the kernel decides.
EITHER = "quick or taylor"
FEW_DIGITS = 1e-7  # below it never, so that it is not asked
_WAVES_DIGITS = 1e-9


@dataclass(frozen=True)
class Decision:
    """One thing that could be computed.

    Attributes
    ----------
    part : str
        What it is.
    kept : bool
        Whether it is computed.
    why : str
        On what grounds.
    """

    part: str
    kept: bool
    why: str


@dataclass(frozen=True)
class Plan:
    """What will be computed for a scene.

    Attributes
    ----------
    scene : Scene
        What is to be solved.
    method : str
        The method that was chosen, or asked for.
    closed_form : {"sphere", "symmetric", "elliptic"} or None
        Which closed form solves the scene, where one does.
    fallback : str or None
        The method that takes over where the one chosen finds, at run time, that it can't.
    velocity, rows : bool
        What is asked for.
    """

    scene: Scene
    method: str
    closed_form: str | None
    fallback: str | None
    velocity: bool
    rows: bool

    @cached_property
    def decisions(self) -> tuple[Decision, ...]:
        """Part by part."""
        return tuple(_decisions(self))

    @property
    def skipped(self) -> frozenset[str]:
        """The parts that are not computed."""
        return frozenset(each.part for each in self.decisions if not each.kept)


def plan(
    scene: Scene,
    method: str = "auto",
    tolerance: float = 1e-12,
    velocity: bool = False,
    rows: bool = False,
) -> Plan:
    """Decide what a scene needs.

    Parameters
    ----------
    scene : Scene
        What is to be solved.
    method : str
        `auto` for the fastest that meets the tolerance, or a name.
    tolerance : float
        Relative, from 1e-15 to 1.
    velocity : bool
        Whether the translational velocity is asked for.
    rows : bool
        Whether results are asked for between the beginning and the end.

    Raises
    ------
    InputError
        Where the method can't take the scene, or the tolerance is out of range.
    """
    finest = REGISTRY["quick"].finest if method == "quick" else FINEST
    if not finest <= tolerance <= 1.0:
        place = " for quick" if method == "quick" else ""
        raise InputError(f"tolerance is {tolerance:g}; allowed{place}: {finest:g} to 1")
    form = closed_form(scene)
    fallback = None
    if method == "auto":
        few_digits = tolerance >= (_WAVES_DIGITS if scene.torque.varies else FEW_DIGITS)
        # Runge-Kutta gives the end alone.
        method = "closed-form" if form else EITHER if few_digits and not rows else "taylor"
        # A disturbance of the middle axis may be too faint for a closed form, not for a series.
        fallback = "taylor" if form else None
    elif method == "closed-form" and form is None:
        raise InputError(f"closed-form can't take this scene: {_why_no_form(scene)}")
    form = form if method == "closed-form" else None
    return Plan(scene, method, form, fallback, velocity, rows)


def _decisions(chosen: Plan) -> Iterator[Decision]:
    scene, law = chosen.scene, chosen.scene.torque
    closed = chosen.method == "closed-form"
    if closed:
        yield Decision("integration", False, f"closed form: {chosen.closed_form}")
    else:
        why = "asked for" if closed_form(scene) else _why_no_form(scene)
        yield Decision("integration", True, why)
    for name, value, product in zip(
        ("A w2 w3", "B w1 w3", "C w1 w2"),
        scene.euler_coefficients,
        ("I2 = I3", "I3 = I1", "I1 = I2"),
        strict=True,
    ):
        if value != 0.0:
            yield Decision(name, True, f"coefficient {value:g}")
        elif closed:
            yield Decision(name, False, product)
        else:
            # The kernels sum three products side by side in one register.
            yield Decision(name, True, f"{product}: zero, beside the others for nothing")
    yield Decision("torque", not law.is_zero, "zero" if law.is_zero else "acts")
    for name, waves in (("sines", law.sines), ("cosines", law.cosines)):
        acts = any(any(amplitude) for amplitude, _ in waves)
        yield Decision(name, acts, f"{len(waves)} in the law" if acts else "none act")
    varies = "the law varies" if law.varies else "constant: read once"
    yield Decision("torque of time", law.varies, varies)
    for part, wanted in (
        ("velocity", chosen.velocity),
        ("dense output", chosen.rows),
        ("reference", chosen.method == "reference"),
    ):
        why = "asked for" if wanted else "not asked for"
        if part == "dense output":
            why = "rows asked for" if wanted else "only the end"
            if wanted and closed:
                wanted, why = False, "closed form"
        yield Decision(part, wanted, why)
    scipy = chosen.method in REGISTRY and bool(REGISTRY[chosen.method].scipy)
    yield Decision("SciPy", scipy, "the method is SciPy's" if scipy else "ours")


def closed_form(scene: Scene) -> str | None:
    """Name the closed form that solves a scene, None where there is none."""
    a, b, c = scene.euler_coefficients
    if a == b == c == 0.0:
        return "sphere"
    if not scene.torque.is_zero:
        return None
    if 0.0 in (a, b, c):
        # Two coefficients of opposite sign turn; of one sign, or one alone, they run away.
        rest = [x for x in (a, b, c) if x != 0.0]
        return "symmetric" if len(rest) == 2 and rest[0] * rest[1] < 0.0 else None
    return None if min(a, b, c) > 0.0 or max(a, b, c) < 0.0 else "elliptic"


def _why_no_form(scene: Scene) -> str:
    if not scene.torque.is_zero:
        return "it has torque and is no sphere"
    return "its coefficients let it grow without bound"
