"""The results of a comparison."""

from dataclasses import dataclass

import numpy as np

from pyharness.checks.compare.agreement import Accuracy
from pyharness.checks.compare.orders import Order
from pyharness.checks.theory.conditioning import LIVELY
from pyharness.engine.methods.sensitivity import is_sensitive
from pyharness.model.listing import Listing
from pyharness.model.report import short
from pyharness.model.scene import Scene
from pyharness.model.trajectory import ROUNDING, Trajectory, digits_left, short_repr
from pyharness.thesis.programs import BINARY64
from pyharness.truth.bounded import ErrorBound
from pyharness.truth.reference import Reference

# Relative error of any method that rounding causes if the error amplification is 1.
_ROUNDING = 4e-15


@dataclass(frozen=True, eq=False)
class ProgramFinding:
    """The results of one listing, against the reference and the Python version."""

    listing: Listing
    trajectory: Trajectory
    accuracy: Accuracy
    ulps: float | None  # largest difference between Fortran and Python; None if only Python ran
    differences: tuple[str, ...]  # results in which Fortran and Python differ
    order: Order | None  # measured for a corrected program in binary64 only
    seconds_per_step: float

    __repr__ = short_repr

    @property
    def who(self) -> str:
        return f"{self.listing.program} {self.listing.label}"


@dataclass(frozen=True, eq=False)
class MethodFinding:
    method: str
    tolerance: float | None  # None for a fixed step
    trajectory: Trajectory | None
    accuracy: Accuracy | None
    seconds: float
    failure: str = ""

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Comparison:
    """The results of `compare_programs` or `compare_methods` for one scene.

    Attributes
    ----------
    scene : Scene
        The scene, with the initial attitude if attitudes were requested.
    lipschitz : float or None
        The constant of the Runge-Kutta program's stop test, 1/s; None without programs.
    reference : Reference
        The reference solution.
    bound : ErrorBound
        The error of the reference solution, proved or estimated.
    programs : tuple of ProgramFinding
        One for each listing.
    methods : tuple of MethodFinding
        One for each of SciPy's methods, or of the requested methods.
    growth : float or None
        The error amplification, if known: the largest norm of the state-transition matrix of omega
        from any time to the last.
    word : str
        The arithmetic of the programs, as in ``binary64``.
    """

    scene: Scene
    lipschitz: float | None
    reference: Reference
    bound: ErrorBound
    programs: tuple[ProgramFinding, ...]
    methods: tuple[MethodFinding, ...]
    growth: float | None
    word: str = BINARY64

    __repr__ = short_repr

    @property
    def digits(self) -> float | None:
        """Return the number of decimal digits that amplified binary64 rounding leaves, or None."""
        return None if self.growth is None else digits_left(ROUNDING * self.growth)

    @property
    def tolerance(self) -> float:
        """Return the smallest relative tolerance of the methods, or 1 if none has one."""
        found = (each.tolerance for each in self.methods)
        return min((each for each in found if each is not None), default=1.0)

    @property
    def is_sensitive(self) -> bool:
        """Return whether the amplified rounding error exceeds 0.3 times `tolerance`."""
        return is_sensitive(self.growth, self.tolerance)

    @property
    def is_complete(self) -> bool:
        """Return whether every method reached all times; True if programs were compared."""
        found = [] if self.programs else [each.trajectory for each in self.methods]
        return all(each is not None and each.has_all_rows for each in found)

    @property
    def unexpected(self) -> tuple[str, ...]:
        """Return a sentence for each unexpected result.

        For programs: differences between Fortran and Python, and missed orders of convergence.
        Without programs: the methods' missed tolerances or times.
        """
        found = [] if self.programs else [*filter(None, map(self._excess, self.methods))]
        if not self.programs and all(each.trajectory is None for each in self.methods):
            found.append("no method has a result")
        for each in self.programs:
            if each.differences:
                told = ", ".join(each.differences)
                found.append(f"{each.who}: Fortran and twin differ in {told}")
            if each.order is not None and each.order.state == "misses":
                told = "does not converge to the reference as the step is halved"
                found.append(f"{each.who}: {told}: {each.order}, due {each.order.due}")
        return tuple(found)

    def _excess(self, one: MethodFinding) -> str:
        if one.trajectory is None or one.accuracy is None:
            return ""
        rows, due = len(one.trajectory.time), len(self.reference.time)
        if rows < due:
            return f"{one.method}: ends after {rows} of {due} times, {one.trajectory.ended}"
        if one.tolerance is None or self.growth is None:
            return ""
        largest = float(np.abs(np.vstack([self.scene.omega, self.reference.omega])).max())
        made = one.tolerance * (self.growth if self.growth > LIVELY else 1.0)
        made += _ROUNDING * self.growth
        errors = {"omega": (max(one.accuracy.omega), made * largest + self.reference.error)}
        if one.accuracy.angle is not None:
            errors["attitude"] = one.accuracy.angle, made + self.reference.angle_error
        excess = {name: pair for name, pair in errors.items() if not pair[0] <= pair[1]}
        told = [f"error of {x} {short(y)}, limit {short(z)}" for x, (y, z) in excess.items()]
        return f"{one.method}: {'; '.join(told)}" if told else ""

    @property
    def not_judged(self) -> tuple[str, ...]:
        """Return a sentence for each corrected program whose order of convergence is undecided."""
        orders = [(each.who, each.order) for each in self.programs if each.order is not None]
        return tuple(f"{who}: {order}" for who, order in orders if not order.is_judged)
