"""Discontinuous functions (switches), such as floor, of a recorded torque in decimal arithmetic.

Steps end at the jumps. `pyharness.model.tape` explains tapes and slots.
"""

from decimal import Decimal, getcontext

import numpy as np

from pyharness.model.errors import SLIDING, TimedError
from pyharness.truth.decimal_functions import Row, value_at
from pyharness.truth.tape_series import TapeSeries

# In a step, an operand's series counts as converged if its last two terms are at most this part of
# the sum of all.
_SMALL = Decimal("1e-8")
_ZERO = Decimal("1e-20")  # part of the terms that counts as rounding error
_IMAGINARY = 1e-4  # largest imaginary part of a root that counts as real, over the step
_NEWTON = 8
_TOGETHER = Decimal("1e-15")  # relative difference of roots that count as one


class Switches:
    """The switches of a tape.

    `results`, by slot, jump where an operand crosses a level: 0, or an integer for a floor.
    """

    def __init__(self, tape: TapeSeries) -> None:
        self._tape, self.results = tape, tape.results
        # By slot with its operand at a level: -1 if the result is the one above the level, else 1.
        self._levels: dict[int, int] = {}
        self._turned: set[int] = set()
        self._next: dict[int, int] = {}

    def settle(self) -> bool:
        """Correct the first result that contradicts its switch; return whether there was one."""
        for slot, is_floor, x in self._tape.operands_of_switches():
            level = x[0].to_integral_value() if is_floor else Decimal(0)
            if abs(x[0] - level) <= _ZERO * (1 + abs(x[0])):
                # At the jump, an earlier choice (as by `turns`) stays; the first choice is NumPy's.
                known = self._levels.get(slot)
                value = level if is_floor else Decimal(0)
                if slot in self.results and known is not None:
                    at = self.results[slot] + (known > 0 if is_floor else 0)
                    if not is_floor or at == level:
                        continue
                self._levels[slot] = -1 if is_floor else 1
            else:
                self._levels.pop(slot, None)
                value = x[0].to_integral_value("ROUND_FLOOR") if is_floor else Decimal(x[0] > 0)
            if self.results.get(slot) != value:
                self.results[slot] = value
                return True
        return False

    def turns(self, time: Decimal, length: Decimal) -> bool:
        """Change the first result whose operand, now at a level, moves to the other side.

        Return whether one did; raise TimedError for sliding.
        """
        for slot, is_floor, x in self._tape.operands_of_switches():
            level = self._levels.get(slot)
            if level is None:
                continue
            terms = [each * length**k for k, each in enumerate(x)][1:]
            total = sum(map(abs, terms))
            first = next((each for each in terms if abs(each) > _ZERO * total), Decimal(0))
            if (is_floor if first == 0 else first > 0) == (level < 0):
                continue
            # Sliding: with either result, the operand moves to the other side.
            if slot in self._turned:
                raise TimedError(f"reference: {SLIDING}", float(time))
            self._turned.add(slot)
            self._cross(slot, level)
            return True
        self._turned.clear()
        return False

    def end(self, length: Decimal) -> Decimal:
        """Return `length` (s), shortened to the first jump and until operands' series converge."""
        while any(self._is_unresolved(x, length) for *_, x in self._tape.operands_of_switches()):
            length *= Decimal("0.75")
        roots = []
        for slot, is_floor, x in self._tape.operands_of_switches():
            result = self.results[slot]
            levels = [(-1, result), (1, result + 1)] if is_floor else [(1 - 2 * int(result), 0)]
            for level, value in levels:
                terms = [x[0] - value, *x[1:]]
                if self._levels.get(slot) == level:
                    terms[0] = Decimal(0)
                root = _first_root(terms, length, -level)
                if root is not None:
                    roots.append((root, slot, level))
        self._next = {}
        if not roots:
            return length
        first = min(abs(root) for root, *_ in roots)
        self._next = {
            slot: level for root, slot, level in roots if abs(root) <= first * (1 + _TOGETHER)
        }
        return first.copy_sign(length)

    def step(self, is_whole: bool) -> None:
        """Change the results that jump at the end of a step if it `is_whole`, not shortened."""
        self._levels = {}
        if is_whole:
            for slot, level in self._next.items():
                self._cross(slot, level)

    def _cross(self, slot: int, level: int) -> None:
        self.results[slot] += level
        self._levels[slot] = -level

    def _is_unresolved(self, x: Row, length: Decimal) -> bool:
        sizes = [abs(each * length**k) for k, each in enumerate(x)]
        return max(sizes[-2:]) > _SMALL * sum(sizes)


def _first_root(terms: Row, length: Decimal, side: int) -> Decimal | None:
    """Return the distance at which a series first loses the sign `side` in a step, or None."""
    scaled = [each * length**k for k, each in enumerate(terms)]
    if not scaled[0]:
        scaled = scaled[1:]
    size = max(map(abs, scaled))
    if not size or abs(scaled[0]) > sum(map(abs, scaled[1:])):
        return None
    floats = np.array([float(each / size) for each in scaled])
    kept = np.flatnonzero(np.abs(floats) > 1e-25)
    # Eigenvalues of the companion matrix in binary64, corrected below by Newton's method.
    found = np.roots(floats[: kept[-1] + 1][::-1])
    near = found[(np.abs(found.imag) < _IMAGINARY) & (found.real > -1e-3) & (found.real < 1.001)]
    slopes = [k * each for k, each in enumerate(scaled)][1:]
    for guess in sorted(near.real):
        root = Decimal(guess)
        for _ in range(_NEWTON):
            slope = value_at(slopes, root)
            if not slope:
                break
            root -= value_at(scaled, root) / slope
        tiny = Decimal(10) ** (4 - getcontext().prec) * size
        if not 0 < root <= 1 or abs(value_at(scaled, root)) > tiny:
            continue
        if value_at(slopes, root) * side < 0:
            return root * abs(length)
    return None
