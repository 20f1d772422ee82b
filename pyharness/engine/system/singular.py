"""The search for the operation that makes a recorded torque undefined."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.errors import TimedError
from pyharness.model.tape import OMEGA, Tape, live_slots, slot_values, slots_of
from pyharness.model.tape_arrays import ARRAYS

# An operand counts as 0 if it is at most _NEARLY_ZERO times its initial value, and at most _SHRUNK
# times its value before the last, very short step.
_NEARLY_ZERO = 1e-6
_SHRUNK = 0.9
# Where logarithms are infinite.
_POLES = {"log": 0.0, "log2": 0.0, "log10": 0.0, "log1p": -1.0}
# Omega counts as unbounded if its ratio to the initial omega is larger.
_UNBOUNDED = 1e6


class SingularError(TimedError):
    """A singularity, beyond which no step is possible."""

    def __init__(self, what: str | None, time: float) -> None:
        """Store `what`, a text on the undefined operation; None if omega or torque is infinite."""
        where = "at t = {time} s"
        message = f"omega or its torque becomes infinite {where}; allowed: an earlier time"
        super().__init__(f"the torque is not defined {where}: {what}" if what else message, time)
        self.what = what

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.what, self.time)


def undefined_operation(
    tape: Tape, begin: Sequence[float], before: Sequence[float], end: Sequence[float]
) -> str | None:
    """Return a text on the operation undefined at `end`, and a remedy, or None.

    `begin`, `before` and `end` are the tape's inputs at time 0, and before and after the last step.
    """
    first, last = (max(abs(inputs[slot]) for slot in OMEGA) for inputs in (begin, end))
    if last > _UNBOUNDED * (first or 1.0):
        return None
    with np.errstate(all="ignore"):
        at_begin, earlier, values = (
            slot_values(tape, list(map(np.float64, inputs)), ARRAYS)
            for inputs in (begin, before, end)
        )

    def vanishes(slot: int, zero: float = 0.0) -> bool:
        size, step = (
            abs(x[slot] - zero) if np.isfinite(x[slot]) else 0.0 for x in (at_begin, earlier)
        )
        if begin == end:
            size = step = 0.0
        return not abs(values[slot] - zero) > min(_NEARLY_ZERO * size, _SHRUNK * step)

    live = live_slots(tape, lambda slot: None, lambda slot: bool(values[slot]))
    derivatives = {each.operands[1] for each in tape.operations if each.kind in WITH_DERIVATIVE}
    arcs = ("asin", "acos", "acosh")
    of_arcs = {each.operands[1] for each in tape.operations if each.kind in arcs}
    for slot in live[::-1]:
        if slot in of_arcs and tape.operations[slot - tape.n_inputs].kind != "sqrt":
            of_arcs.update(slots_of(tape.operations[slot - tape.n_inputs]))
    # The operation may belong to a branch that begins here.
    for slot in [*live, *range(tape.n_inputs, tape.n_inputs + len(tape.operations))]:
        kind, operands, *_ = tape.operations[slot - tape.n_inputs]
        if slot in derivatives:
            continue
        if kind == "quotient" and begin != end and values[operands[0]] == earlier[operands[0]] == 0:
            continue
        pole = _POLES.get(kind)
        if pole is not None and (not values[operands[0]] > pole or vanishes(operands[0], pole)):
            return (
                "the logarithm or power of a number that becomes 0 or negative; write a smooth "
                "function, such as (x**2 + e**2)**(p/2) for abs(x)**p"
            )
        if kind == "sqrt" and (values[operands[0]] < 0.0 or vanishes(operands[0])):
            if slot in of_arcs:
                return (
                    "the arcsine, arccosine or arccosh of a number that becomes 1 or -1; write an "
                    "angle as arctan2(y, x)"
                )
            return (
                "the square root of a number that becomes 0 or negative; write a smooth function, "
                "such as x*tanh(x/e) for sqrt(x**2)"
            )
        if kind == "quotient" and vanishes(operands[1]):
            if vanishes(operands[0]):
                return "0/0; write a function that has a value there, such as a polynomial"
            return None
    return None
