"""Taylor coefficients, in decimal arithmetic, of a recorded torque.

A tape is a list of operations, with results in numbered slots. The coefficients of torque
and solution are computed together, order by order (Jorba and Zou 2005, Experimental Mathematics
14).
"""

import math
from bisect import bisect_left, bisect_right
from collections import Counter
from decimal import Context, Decimal

from pyharness.model.tape import N_INPUTS, SWITCHES, Linear, Operation, Table, Tape, live_slots
from pyharness.truth.decimal_functions import (
    ELEMENTARY,
    Row,
    logarithm,
    product,
    sine_cosine,
    value_at,
)

# A larger angle has no sine in any method, because its reduction would take too many digits.
_LARGEST_ANGLE = Decimal("1e308")
# An exponential below exp(-_INVISIBLE) affects no digit of a result, whatever its factor.
_INVISIBLE = 400
# Largest change of a divisor in a step, over its value at the beginning.
_WITHIN_CIRCLE = Decimal("0.9")
_MANY_FACTORS = 3  # products of so many factors are checked; products of two show in any series
# The order is at least this multiple of the number of factors, up to _MOST_ORDER, so that a product
# shows in the series although its factors are 0 at the centre.
_ORDER_A_FACTOR = 4
_MOST_ORDER = 100
# A negative value of a root's polynomial is no truncation error if its square differs from the
# operand by at most this part.
_TRUSTED = Decimal("1e-6")

_ROUGH = Context(prec=9)


# A product of many factors: how often each slot is a factor, the decimal logarithm of the product's
# largest coefficient, and slots with which its size is compared.
_Power = tuple[Counter[int], Decimal, set[int]]
# A linear combination of slots: the constant, and pairs of coefficient and slot.
_Sum = tuple[Decimal, list[tuple[Decimal, int]]]


def series_products(tape: Tape) -> int:
    """Return how many products of two series each order of a tape (recorded torque) needs."""
    # A sine with its cosine, or a tanh with its derivative, takes two; a table takes none.
    waves = ("sine", "cosine")
    angles = {each.operands for each in tape.operations if each.kind in waves}
    others = [each for each in tape.operations if each.kind not in ("linear", "table", *waves)]
    return 2 * len(angles) + len(others) + sum(each.kind == "tanh" for each in others)


class TapeSeries:
    """The Taylor series of the operations on a tape (recorded torque).

    `begin` starts the series, and each `next` adds a coefficient.
    """

    def __init__(
        self, tape: Tape, change: Decimal = Decimal(0), results: dict[int, Decimal] | None = None
    ) -> None:
        # The caller sets the results of switches, by slot.
        self.results = {} if results is None else results
        self._tape = tape
        self.has_switches = tape.n_switches > 0
        # Terms of sums are multiplied by 1 plus or minus `change`, to show the effect of rounding.
        self._operations = [(each, _sum(each.linear, change)) for each in tape.operations]
        self._outputs = [_sum(each, change) for each in tape.outputs]
        # By slot: the table, and the exact times at which its pieces begin.
        self._breaks = {
            slot: (table, [Decimal(time) for time in table.breaks.tolist()])
            for slot, (_, _, _, table) in enumerate(tape.operations, N_INPUTS)
            if table is not None
        }
        changes = {time for _, breaks in self._breaks.values() for time in breaks[1:]}
        self._changes = sorted(changes)
        self._powers, largest = _powers(tape)
        # The lowest order that loses no product whose factors are 0 at the beginning.
        self.least_order = min(_MOST_ORDER, _ORDER_A_FACTOR * largest)
        self._slots: list[Row] = []
        self._live: list[int] = []

    def begin(
        self, time: Decimal, omega: list[Row], attitude: list[Row], forward: bool = True
    ) -> None:
        """Begin an expansion around `time` (s), forward or backward in time.

        The caller extends the lists `omega` and `attitude` (perhaps empty).
        """
        self._order = 0
        self._tables = {
            slot: _expanded(*each, time, forward) for slot, each in self._breaks.items()
        }
        self._slots = [[time], *omega, *(attitude or [[] for _ in range(4)])]
        self._slots += [[] for _ in self._operations]
        # By operand: the series of its sine and cosine.
        self._waves: dict[int, tuple[Row, Row]] = {}
        # By operand: the series of 1 minus the square of its hyperbolic tangent.
        self._bells: dict[int, Row] = {}
        # By operand: coefficient j times j, from j = 1.
        self._slopes: dict[int, Row] = {}

    def next(self) -> Row:
        """Return the next Taylor coefficient, from number 0, of each of the three outputs.

        Raise ArithmeticError at a singularity.
        """
        # The unknowns already have this coefficient.
        k = self._order
        if k > 0:
            self._slots[0].append(Decimal(k == 1))
            for slot in self._live:
                self._add(slot)
        else:
            self._live = live_slots(self._tape, self._add, lambda slot: self._slots[slot][0] != 0)
        self._order = k + 1
        return [self._combined(each, k) for each in self._outputs]

    def _add(self, slot: int) -> None:
        operation, linear = self._operations[slot - N_INPUTS]
        self._slots[slot].append(self._coefficient(operation, linear, slot, self._order))

    def _live_operations(self) -> list[tuple[int, Operation]]:
        return [(slot, self._operations[slot - N_INPUTS][0]) for slot in self._live]

    def _combined(self, linear: _Sum, k: int) -> Decimal:
        constant, terms = linear
        start = constant if k == 0 else Decimal(0)
        return sum((factor * self._slots[slot][k] for factor, slot in terms), start)

    def _coefficient(self, operation: Operation, linear: _Sum, slot: int, k: int) -> Decimal:
        """Return Taylor coefficient k of an operation, whose series has those up to k - 1."""
        kind, operands, _, table = operation
        if kind == "linear":
            return self._combined(linear, k)
        if table is not None:
            return self._tables[slot][k] if k < 4 else Decimal(0)
        x, found = self._slots[operands[0]], self._slots[slot]
        if kind in SWITCHES:
            return self.results.get(slot, Decimal(0)) if k == 0 else Decimal(0)
        if kind == "select":
            return self._slots[operands[1] if x[0] else operands[2]][k]
        if kind in ELEMENTARY:
            if k == 0:
                return ELEMENTARY[kind](x[0])
            slope = self._slope(operands[0], k)
            if kind == "exp2":
                return logarithm(2) * product(slope, found[::-1]) / k
            if kind == "cbrt":
                return _cube_root_coefficient(x, slope, found, k)
            # The derivative on the tape has a rounded factor.
            base = {"log2": 2, "log10": 10}.get(kind)
            exact = 1 / (logarithm(base) * Decimal(1.0 / math.log(base))) if base else 1
            return exact * product(slope, self._slots[operands[1]][:k][::-1]) / k
        if kind == "product":
            return product(x, self._slots[operands[1]][::-1])
        if kind == "quotient":
            divisor = self._slots[operands[1]]
            return (x[k] - product(divisor[1:], found[::-1])) / divisor[0]
        if kind == "sqrt":
            return _root_coefficient(x, found, k)
        if kind == "exp":
            if k == 0:
                return x[0].exp()
            return product(self._slope(operands[0], k), found[::-1]) / k
        if kind == "tanh":
            return self._tangent(operands[0], found, k)
        sine, cosine = self._wave(operands[0], k)
        return (sine if kind == "sine" else cosine)[k]

    def _wave(self, operand: int, k: int) -> tuple[Row, Row]:
        if k == 0 and operand not in self._waves:
            angle = self._slots[operand][0]
            if abs(angle) > _LARGEST_ANGLE:
                raise OverflowError("an angle is beyond the range of binary64")
            first, second = sine_cosine(angle)
            self._waves[operand] = [first], [second]
        sine, cosine = self._waves[operand]
        if len(sine) == k:
            slope = self._slope(operand, k)
            terms = product(slope, cosine[::-1]) / k, -product(slope, sine[::-1]) / k
            sine.append(terms[0])
            cosine.append(terms[1])
        return sine, cosine

    def _tangent(self, operand: int, found: Row, k: int) -> Decimal:
        """Return coefficient k of a slot's hyperbolic tangent; `found` has those up to k - 1."""
        if k == 0:
            x = self._slots[operand][0]
            small = (-2 * abs(x)).exp()
            self._bells[operand] = [4 * small / (1 + small) ** 2]
            return ((1 - small) / (1 + small)).copy_sign(x)
        bell = self._bells[operand]
        new = product(self._slope(operand, k), bell[::-1]) / k
        bell.append(-product([*found, new], [new, *found[::-1]]))
        return new

    def _slope(self, operand: int, k: int) -> Row:
        """Return coefficients 1 to k of a slot's series, each times its index; k grows by 1."""
        slope = self._slopes.setdefault(operand, [])
        if len(slope) < k:
            slope.append(k * self._slots[operand][k])
        return slope

    def operands_of_switches(self) -> list[tuple[int, bool, Row]]:
        """Return the slot of each switch, whether it is a floor, and its operand's coefficients."""
        return [
            (slot, operation.kind == "floor", self._slots[operation.operands[0]])
            for slot, operation in self._live_operations()
            if operation.kind in SWITCHES
        ]

    def reach(self, length: Decimal) -> Decimal:
        """Return the step (s), reduced so that the series of every operation converges."""
        for _, operation in self._live_operations():
            most = self._largest_change(operation)
            if most is None:
                continue
            sizes = [Decimal(0), *map(abs, self._slots[operation.operands[-1]][1:])]
            while (change := value_at(sizes, length)) > 2 * most:
                length /= 2
            if change > most:
                # The change is a convex function of the length: one reduction is enough.
                length *= most / change
        while any(self._is_hidden(each, length) for each in self._powers):
            length *= Decimal("0.7")
        return length

    def _is_hidden(self, power: _Power, length: Decimal) -> bool:
        """Return whether a product may matter in a step although its terms do not."""
        # The mean order of the product's terms, weighted by magnitude, is the sum of the mean
        # orders of its factors.
        (factors, size, slots), order = power, Decimal(0)
        for slot, count in factors.items():
            terms = [abs(x) * length**k for k, x in enumerate(self._slots[slot])]
            if not (total := sum(terms)):
                return False
            order += count * sum(k * x for k, x in enumerate(terms)) / total
            size += count * total.log10(_ROUGH)
        # A divisor in an unused branch has no series.
        divisors = [abs(self._slots[slot][0]).log10(_ROUGH) for slot in slots if self._slots[slot]]
        least = min([Decimal(0), *divisors]) - _INVISIBLE * Decimal("0.4343")
        return 2 * order > self._order and size > least

    def _largest_change(self, operation: Operation) -> Decimal | None:
        """Return how much an operation's last operand may change; None if there is no limit."""
        if operation.kind not in ("exp", "tanh", "quotient"):
            return None
        # An exponential, or the derivative of a tanh, may be negligible at the beginning of a step
        # and large a little later. The argument may change by half the order, or by more if the
        # function remains negligible.
        x = self._slots[operation.operands[-1]][0]
        if operation.kind == "quotient":
            return _WITHIN_CIRCLE * abs(x)
        if operation.kind == "exp":
            return max(Decimal(self._order) / 2, -x - _INVISIBLE)
        # The derivative decreases as exp(-2 abs(x)).
        return max(Decimal(self._order) / 2, 2 * abs(x) - _INVISIBLE) / 2

    def next_change(self, time: Decimal, forward: bool) -> Decimal | None:
        """Return the time (s) of a table's next change or, unless `forward`, the previous one."""
        place = (bisect_right if forward else bisect_left)(self._changes, time) - (not forward)
        return self._changes[place] if 0 <= place < len(self._changes) else None

    def crosses_a_branch(self, offset: Decimal) -> bool:
        """Return whether a square root reaches 0 within `offset` (s) of the expansion's time."""
        # Beyond a zero, the series may be the root's negative, as for sqrt(x**2).
        for slot, operation in self._live_operations():
            if operation.kind == "sqrt":
                root = value_at(self._slots[slot], offset)
                operand = value_at(self._slots[operation.operands[0]], offset)
                if root < 0 and abs(root * root - operand) <= _TRUSTED * abs(operand):
                    return True
        return False


def _powers(tape: Tape) -> tuple[list[_Power], int]:
    """Return data on the products of three or more factors, and the largest number of factors."""
    factors: dict[int, Counter[int]] = {}
    numbers: dict[int, int] = {}
    scales: dict[int, float] = {}
    for slot, (kind, operands, linear, _) in enumerate(tape.operations, N_INPUTS):
        if kind == "product":
            parts = [factors.get(each, Counter([each])) for each in operands]
            factors[slot] = parts[0] + parts[1]
            numbers[slot] = sum(numbers.get(each, 1) for each in operands)
        else:
            scales.update((each, max(1.0, scales.get(each, 0.0))) for each in operands)
            terms = linear.terms if linear else ()
            # A sum counts as many factors as the term with the most.
            numbers[slot] = max((numbers.get(each, 1) for each, _ in terms), default=1)
    sums = [each.linear for each in tape.operations if each.linear] + list(tape.outputs)
    for each, factor in (term for linear in sums for term in linear.terms):
        scales[each] = max(abs(factor), scales.get(each, 0.0))
    divisors = _divisors(tape)
    found = [each for each in factors if numbers[each] >= _MANY_FACTORS and scales.get(each)]
    powers = [
        (factors[each], Decimal(scales[each]).log10(_ROUGH), divisors.get(each, set()))
        for each in found
    ]
    return powers, max((numbers[each] for each in found), default=0)


def _divisors(tape: Tape) -> dict[int, set[int]]:
    """Return, for each slot, the divisors and arguments of roots that contain it."""
    found: dict[int, set[int]] = {}
    for slot, (kind, operands, linear, _) in reversed([*enumerate(tape.operations, N_INPUTS)]):
        parts = operands if linear is None else [each for each, _ in linear.terms]
        if kind in ("quotient", "sqrt"):
            passed = {operands[-1]}
        elif kind in ("product", "linear"):
            passed = found.get(slot, set())
        else:
            continue
        for part in parts:
            found[part] = found.get(part, set()) | passed
    return found


def _sum(linear: Linear | None, change: Decimal) -> _Sum:
    """Return a linear combination with rounded numbers, so that equal numbers cancel."""
    if linear is None:
        return Decimal(0), []
    constant, terms = +Decimal(linear.constant), []
    for k, (slot, factor) in enumerate(linear.terms):
        terms.append(((1 + (change if k % 2 else -change)) * Decimal(factor), slot))
    return constant * (1 + change), terms


def _expanded(table: Table, breaks: Row, time: Decimal, forward: bool) -> Row:
    """Return coefficients 0 to 3 of a table's piece after `time` (s) if `forward`, else before."""
    piece = max(0, (bisect_right if forward else bisect_left)(breaks, time) - 1)
    c0, c1, c2, c3 = map(Decimal, table.pieces[piece].tolist())
    s = time - breaks[piece]
    return [c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2 * c2 + s * 3 * c3), c2 + 3 * s * c3, +c3]


def _cube_root_coefficient(x: Row, slope: Row, root: Row, k: int) -> Decimal:
    """Return Taylor coefficient k of the cube root r of x, from 3 x r' = r x'."""
    slopes = [j * each for j, each in enumerate(root)][1:]
    return (product(slope, root[::-1]) / 3 - product(slopes, x[1:k][::-1])) / (k * x[0])


def _root_coefficient(x: Row, root: Row, k: int) -> Decimal:
    """Return Taylor coefficient k of the square root of x; `root` has those up to k - 1."""
    if k == 0:
        return x[0].sqrt()
    rest = x[k] - product(root[1:], root[:0:-1])
    # If x is 0 throughout, so is its root. Where x is 0 and changes, the division fails, because
    # the root has no Taylor series.
    if root[0] == 0 == rest:
        return rest
    return rest / (2 * root[0])
