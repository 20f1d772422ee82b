"""What a scene needs, and what is therefore not computed: decided before anything is computed."""

from dataclasses import dataclass

from pyharness.model.errors import InputError
from pyharness.model.scene import Scene

FINEST = 1e-15  # relative; below it a tolerance asks for more digits than binary64 has
FINEST_QUICK = 1e-12  # below it the rounding of its many steps would count, which it does not see
# For few digits Runge-Kutta takes fewer operations than a series; which, the kernel decides.
EITHER = "quick or taylor"
_FEW_DIGITS = 1e-7  # below it never, so that it is not asked
_WAVES_DIGITS = 1e-9
_SCIPY = ("dop853", "rk45", "lsoda", "radau")


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
    method : str
        The method that was chosen, or asked for.
    closed_form : {"sphere", "symmetric", "elliptic"} or None
        Which closed form solves the scene, where one does.
    decisions : tuple of Decision
        Part by part.
    """

    method: str
    closed_form: str | None
    decisions: tuple[Decision, ...]

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
    finest = FINEST_QUICK if method == "quick" else FINEST
    if not finest <= tolerance <= 1.0:
        place = " for quick" if method == "quick" else ""
        raise InputError(f"tolerance is {tolerance:g}; allowed{place}: {finest:g} to 1")
    form = closed_form(scene)
    if method == "auto":
        few_digits = tolerance >= (_WAVES_DIGITS if scene.torque.varies else _FEW_DIGITS)
        # Runge-Kutta gives the end alone.
        method = "closed-form" if form else EITHER if few_digits and not rows else "taylor"
    elif method == "closed-form" and form is None:
        raise InputError(f"closed-form can't take this scene: {_why_no_form(scene)}")
    closed = method == "closed-form"
    law = scene.torque
    a, b, c = scene.euler_coefficients
    decisions = [
        Decision(
            "integration",
            not closed,
            f"closed form: {form}" if closed else _why_no_form(scene) if not form else "asked for",
        )
    ]
    for name, value, product in (
        ("A w2 w3", a, "I2 = I3"),
        ("B w1 w3", b, "I3 = I1"),
        ("C w1 w2", c, "I1 = I2"),
    ):
        if value != 0.0:
            decisions.append(Decision(name, True, f"coefficient {value:g}"))
        elif closed:
            decisions.append(Decision(name, False, product))
        else:
            # The kernels sum three products side by side in one register.
            decisions.append(
                Decision(name, True, f"{product}: zero, beside the others for nothing")
            )
    decisions.append(Decision("torque", not law.is_zero, "zero" if law.is_zero else "acts"))
    for name, waves in (("sines", law.sines), ("cosines", law.cosines)):
        acts = any(any(amplitude) for amplitude, _ in waves)
        decisions.append(Decision(name, acts, f"{len(waves)} in the law" if acts else "none act"))
    decisions += [
        Decision(
            "torque of time",
            law.varies,
            "the law varies" if law.varies else "constant: read once",
        ),
        Decision("velocity", velocity, "asked for" if velocity else "not asked for"),
        Decision(
            "dense output",
            rows and not closed,
            "rows asked for"
            if rows and not closed
            else "only the end"
            if not rows
            else "closed form",
        ),
        Decision(
            "reference",
            method == "reference",
            "asked for" if method == "reference" else "not asked for",
        ),
        Decision(
            "SciPy", method in _SCIPY, "the method is SciPy's" if method in _SCIPY else "ours"
        ),
    ]
    return Plan(method, form if closed else None, tuple(decisions))


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
