"""Taylor series as a method of `scipy.integrate.solve_ivp`, for any differential equation.

The order is constant; the last terms determine the step (Jorba and Zou 2005, Experimental
Mathematics 14, section 3).
"""

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from scipy.integrate import DenseOutput, OdeSolver

from pyharness.engine.system.recorded import LONGEST_TRIAL, Step, kernel_tape, taylor_step
from pyharness.model.arrays import numbers_of
from pyharness.model.called_function import called_once
from pyharness.model.errors import SLIDING, InputError, TimedError
from pyharness.model.numpy_protocol import symbol_array
from pyharness.model.symbols import Recorder, recorded_twice
from pyharness.model.tape import Tape
from pyharness.model.trajectory import Array
from pyharness.model.values import number

_MOST_OPERATIONS = 20_000
# The least relative tolerance of SciPy's methods.
_LEAST_RTOL = 100.0 * np.finfo(float).eps
# The least allowed error that counts, whose reciprocal is finite.
_LEAST_SCALE = 2.0**-1000
# `solve_ivp` misses pairs of roots in a step, and in the first step roots of an event function that
# is 0 at the start. Therefore the first step changes the state at most by the fraction
# _FIRST_CHANGE, and steps grow at most by the factor _MOST_GROWTH, as in SciPy's methods.
_FIRST_CHANGE = 0.01
_MOST_GROWTH = 10.0
# An event at a switch is 0 there, but for rounding, which hides its sign until a short step later.
_AFTER_SWITCH = 0.01  # times the step that ended at the switch
# After this many steps to switches, among successive steps of at most _SHORT units in the last
# place of the time, the switch changes back and forth without end. If a motion loses a share c of
# its speed between two switches, rounded times keep its steps near 2/c units.
_MOST_SWITCHES, _SHORT = 100, 128
_FIRST_PARTS = 1e-12, 1e-2  # least and largest first step, in steps that the tolerances allow


class Taylor(OdeSolver):  # type: ignore[misc]
    """Integrate an ordinary differential equation y' = fun(t, y) by its Taylor series.

    Pass it to `scipy.integrate.solve_ivp` by ``method=Taylor``. `fun` is called twice, with symbols
    that record its arithmetic. The order of the series, 8 to 28, depends on the tolerances. The
    dense output is the series.

    Parameters
    ----------
    fun : callable
        The right-hand side ``fun(t, y)``, with `y` of shape (n,), which returns n numbers. It may
        use up to 20,000 arithmetic operators and elementary functions of NumPy, and its where,
        clip, minimum, maximum, sign and comparisons, but no branches on `t` or `y`.
    t0 : float
        The time of the initial state.
    y0 : array_like, shape (n,)
        The initial state, real.
    t_bound : float
        The final time, before or after `t0`.
    max_step : float, optional
        The longest step. Default is inf. `solve_ivp` misses two roots of an event within one step;
        shorter steps separate them.
    rtol, atol : float or array_like, shape (n,), optional
        The local error of component k of y is below ``atol[k] + rtol[k] * abs(y[k])``. If `atol` is
        0, the error of a zero component is relative to the largest component. Defaults are 1e-3 and
        1e-6.
    vectorized : bool, optional
        Ignored.
    first_step : float, optional
        The longest first step. By default the method chooses it.
    **extraneous : dict
        Options of other methods, ignored with a warning.

    Raises
    ------
    InputError
        If `fun` can't be recorded or does not return n numbers, or an option is not allowed.
    ValueError
        If `y0` is complex or not one-dimensional.

    Examples
    --------
    >>> from scipy.integrate import solve_ivp
    >>> from pyharness import Taylor
    >>> found = solve_ivp(lambda t, y: [y[1], -y[0]], (0.0, 10.0), [1.0, 0.0],
    ...                   method=Taylor, rtol=1e-12, atol=1e-12)
    >>> found.y[:, -1].round(6)
    array([-0.839072,  0.544021])
    """

    t: float
    t_bound: float
    y: Array

    def __init__(
        self,
        fun: Callable[..., Any],
        t0: float,
        y0: Any,
        t_bound: float,
        max_step: float = math.inf,
        rtol: Any = 1e-3,
        atol: Any = 1e-6,
        vectorized: bool = False,
        first_step: float | None = None,
        **extraneous: Any,
    ) -> None:
        if extraneous:
            names = ", ".join(f"`{name}`" for name in extraneous)
            warnings.warn(f"the method Taylor ignores {names}", stacklevel=3)
        super().__init__(fun, t0, y0, t_bound, vectorized)
        if math.isnan(self.t_bound) or not math.isfinite(self.t):
            raise InputError(
                f"the time span is {t0} to {t_bound}; allowed: finite times, or to inf"
            )
        self._tape = kernel_tape(recorded_equation(fun, self.n))
        self.nfev = 1
        self.max_step = self._longer_than_spacing("max_step", max_step)
        self.rtol, self.atol = _tolerances(rtol, atol, self.n)
        longest = np.abs(self.y).max(initial=0.0)
        share = self.atol.min(initial=math.inf) / longest if longest else 0.0
        self._relative = min(1.0, float(self.rtol.min(initial=1.0) + share))
        span = abs(self.t_bound - self.t)
        self._trial = min(span, LONGEST_TRIAL)
        self._terms = np.zeros((1, self.n))
        self._switches = 0  # reached by steps of at most _SHORT units, in succession
        if first_step is None:
            self._longest = self._first_step(span)
        else:
            self._longest = self._longer_than_spacing("first_step", first_step)
        if self._longest > span:
            raise InputError(f"first_step is {first_step}; allowed: up to {span:g}, the time span")

    def _longer_than_spacing(self, name: str, value: Any) -> float:
        found = number(name, value)
        if self.t + self.direction * found == self.t or not found > 0.0:
            least = 0.5 * math.ulp(self.t)
            raise InputError(f"{name} is {found:g}; allowed: a number larger than {least:g} at t0")
        return found

    def _first_step(self, span: float) -> float:
        if not (self.n and span):
            return span
        try:
            step = self._step_to(self.t_bound)
        except TimedError:
            return span  # the first step, which fails too, has the message
        if step.h == 0.0:
            return span
        scale = self._scale()
        change = _FIRST_CHANGE * max(1.0, float(np.abs(self.y / scale).max()))
        sizes = np.abs(step.terms[1:] / scale).max(axis=1)
        # The first term may have half the change, term k 2**-k of it.
        with np.errstate(divide="ignore", over="ignore"):
            parts = 0.5 * (change / sizes) ** (1.0 / np.arange(1, len(sizes) + 1))
        first = float(np.clip(parts.min(), *_FIRST_PARTS)) * abs(step.h)
        return min(span, max(first, 10.0 * math.ulp(self.t)))

    def _step_to(self, end: float) -> Step:
        step = taylor_step(
            self._tape, self.t, self.y, self._scale(), self._relative, self._trial, end,
            is_beyond=True,
        )  # fmt: skip
        self.nfev += step.expansions
        return step

    def _step_impl(self) -> tuple[bool, str | None]:
        rest = abs(self.t_bound - self.t)
        longest = min(rest, self.max_step, self._longest)
        # As in SciPy's methods, a step is at least ten times the spacing of the times.
        if self.max_step < min(rest, 10.0 * math.ulp(self.t)):
            return False, self.TOO_SMALL_STEP
        end = self.t_bound if longest == rest else self.t + self.direction * longest
        try:
            step = self._step_to(end)
        except TimedError as error:
            return False, str(error)
        if step.h == 0.0:
            return False, self.TOO_SMALL_STEP
        self._terms = step.terms
        self._trial = step.next_trial(self._trial)
        self._longest = max(self._longest, _MOST_GROWTH * abs(step.h))
        if step.is_switched:
            self._longest = max(_AFTER_SWITCH * self._trial, 10.0 * math.ulp(step.time))
        is_short = abs(step.h) <= _SHORT * math.ulp(step.time)
        self._switches = self._switches + step.is_switched if is_short else 0
        if self._switches > _MOST_SWITCHES:
            return False, str(TimedError(SLIDING, self.t))
        self.t, self.y = step.time, step.state
        return True, None

    def _scale(self) -> Array:
        sizes = np.abs(self.y)
        scale: Array = self.atol + self.rtol * sizes
        if scale.min(initial=math.inf) >= _LEAST_SCALE:
            return scale
        # Without an absolute tolerance, a component that is 0 is compared with the largest.
        missing = float(self.rtol.min()) * float(sizes.max(initial=0.0)) or 1.0
        return np.maximum(np.where(scale > 0.0, scale, missing), _LEAST_SCALE)

    def _dense_output_impl(self) -> DenseOutput:
        assert self.t_old is not None
        return _Series(self.t_old, self.t, self._terms)


class _Series(DenseOutput):  # type: ignore[misc]
    def __init__(self, t_old: float, t: float, terms: Array) -> None:
        super().__init__(t_old, t)
        self._terms = terms

    def _call_impl(self, t: Array) -> Array:
        values: Array = polyval((t - self.t_old) / (self.t - self.t_old), self._terms)
        return values


def recorded_equation(fun: Callable[..., Any], n: int) -> Tape:
    def record(recorder: Recorder) -> Tape:
        time, *state = recorder.inputs()
        # A single equation may return a number.
        rates = called_once(
            lambda t, y: np.ravel(np.array(fun(t, y), dtype=object)),
            (time, symbol_array(state)),
            recorder,
            f"a function of (t, y) that returns {n} numbers",
        )
        if len(rates) != n:
            raise InputError(f"fun returned {len(rates)} values; allowed: {n}, the length of y0")
        return recorder.tape(rates)

    instead = "another method of solve_ivp"
    return recorded_twice(record, lambda: Recorder(_MOST_OPERATIONS, n + 1, "fun", instead))


def _tolerances(rtol: Any, atol: Any, n: int) -> tuple[Array, Array]:
    found = []
    for name, value in (("rtol", rtol), ("atol", atol)):
        try:
            given = numbers_of(name, value)
        except InputError:
            raise InputError(f"{name} is {value!r}; allowed: a number, or {n} numbers") from None
        if given.shape not in ((), (n,)):
            raise InputError(f"{name} has shape {given.shape}; allowed: a number, or shape ({n},)")
        if not np.all(given >= 0.0):
            raise InputError(f"{name} is {value}; allowed: numbers of at least 0")
        found.append(np.broadcast_to(given, (n,)))
    if not np.isfinite(found[0]).all():
        raise InputError(f"rtol is {rtol}; allowed: finite numbers")
    if np.any(found[0] < _LEAST_RTOL):
        warnings.warn(f"`rtol` is too small; {_LEAST_RTOL:.2g} is used", stacklevel=4)
    return np.maximum(found[0], _LEAST_RTOL), found[1]
