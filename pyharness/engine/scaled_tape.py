"""A recorded torque in rescaled time, in which omega is near 1 rad/s.

Each slot (input or result) has its own power of two as factor, so that none overflows or
underflows.
"""

from functools import lru_cache
from typing import Any

import numpy as np

from pyharness.model.tape import N_INPUTS, OMEGA, TIME, Linear, Operation, Table, Tape

# The exponents of rescaled time are multiples of this number, so that those of nested square roots
# are whole numbers.
MULTIPLE = 16


@lru_cache(maxsize=64)
def scaled_tape(tape: Tape, exponent: int) -> Tape | None:
    """Return the tape of a torque in the unit of time 2**exponent s, without rounding.

    Its outputs are multiplied by 2**(2 * exponent). The result is None if a number would be
    rounded.
    """
    scaling = _Scaling(exponent)
    try:
        for operation in tape.operations:
            scaling.add(operation)
        outputs = tuple(scaling.combined(each, 2 * exponent) for each in tape.outputs)
    except ArithmeticError:
        return None
    return Tape(tuple(scaling.operations), outputs)


class _Scaling:
    """The conversion of a tape: slot n becomes slot `_places[n]`, times 2**`_exponents[n]`."""

    def __init__(self, exponent: int) -> None:
        """Begin with the inputs, for the unit of time 2**exponent s."""
        self.operations: list[Operation] = []
        self._unit = exponent
        self._places = list(range(N_INPUTS))
        self._exponents = [0] * N_INPUTS
        self._exponents[TIME] = -exponent
        for slot in OMEGA:
            self._exponents[slot] = exponent
        # Slots that are linear combinations.
        self._linear: dict[int, Linear] = {TIME: Linear(0.0, ((TIME, 1.0),))}

    def add(self, operation: Operation) -> None:
        """Convert the next operation, or raise ArithmeticError."""
        kind, operands, linear, table = operation
        exponents = [self._exponents[slot] for slot in operands]
        if linear is not None:
            self._linear[len(self._places)] = linear
            exponent = self._exponent_of(linear)
            found = Operation(kind, (), self.combined(linear, exponent))
        elif table is not None:
            exponent, found = 0, Operation(kind, (), None, self._moved(table))
        elif kind in ("product", "quotient"):
            exponent = exponents[0] + (exponents[1] if kind == "product" else -exponents[1])
            found = Operation(kind, tuple(self._places[slot] for slot in operands))
        elif kind == "sqrt":
            exponent, odd = divmod(exponents[0], 2)
            if odd:
                raise ArithmeticError("the exponent of a square root is not a whole number")
            found = Operation(kind, (self._places[operands[0]],))
        elif kind == "switch":
            exponent, found = 0, Operation(kind, (self._places[operands[0]],))
        elif kind == "select":
            exponent = exponents[1]
            other = self._at(operands[2], exponent)
            chosen = self._places[operands[0]], self._places[operands[1]], other
            found = Operation(kind, chosen)
        else:
            exponent, found = 0, Operation(kind, tuple(self._at(slot, 0) for slot in operands))
        self._places.append(self._append(found))
        self._exponents.append(exponent)

    def combined(self, linear: Linear, exponent: int) -> Linear:
        """Return a combination of the new slots, times 2**exponent, or raise ArithmeticError."""
        terms = tuple(
            (self._places[slot], _scaled(factor, exponent - self._exponents[slot]))
            for slot, factor in linear.terms
        )
        return Linear(_scaled(linear.constant, exponent), terms)

    def _append(self, operation: Operation) -> int:
        self.operations.append(operation)
        return N_INPUTS + len(self.operations) - 1

    def _exponent_of(self, linear: Linear) -> int:
        own = {self._exponents[slot] for slot, _ in linear.terms}
        return 0 if linear.constant or not own else min(own, key=abs)

    def _at(self, slot: int, exponent: int) -> int:
        """Return a new slot that has the original value of `slot`, times 2**exponent."""
        if self._exponents[slot] == exponent:
            return self._places[slot]
        # The kernel recognises an angle proportional to time by its linear combination.
        linear = self._linear.get(slot, Linear(0.0, ((slot, 1.0),)))
        return self._append(Operation("linear", (), self.combined(linear, exponent)))

    def _moved(self, table: Table) -> Table:
        powers = self._unit * np.arange(4)
        return Table(_scaled_array(table.breaks, -self._unit), _scaled_array(table.pieces, powers))


def _scaled(value: float, exponent: int) -> float:
    """Return value * 2**exponent, or raise ArithmeticError."""
    return float(_scaled_array(np.float64(value), exponent))


def _scaled_array(values: Any, exponents: Any) -> Any:
    with np.errstate(all="ignore"):
        found = np.ldexp(values, exponents)
        if not np.array_equal(np.ldexp(found, -exponents), values):
            raise ArithmeticError("the product underflows or overflows")
    return found
