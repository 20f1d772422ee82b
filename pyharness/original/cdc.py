"""The arithmetic of the CDC 6600 and CYBER 70: its rules of rounding.

After the CYBER 170 hardware reference, CDC 60463560: a coefficient of p = 48 bits, a whole number,
and an exponent; sums in a frame of 2 p bits. `FX` are the instructions 30, 31, 40 and 44, `RX`
their rounded kind, 34, 35, 41 and 45; NX (24) normalises a sum. No guard bit survives: what lies
below the unit of the larger operand is cut before NX moves the sum to the left.
"""

from pyharness.original.rounding import Operation, Pair, Rules, rounding

# Exponents of the whole number that a coefficient is: the fields 0000 and 3776 of a word.
LEAST, MOST = -1023, 1022


def cdc(p: int, rounds: bool) -> Rules:
    """Return the rules for coefficients of p bits, FX, or RX where it `rounds`.

    Literals go to nearest, as the constants .2 and .01 in the decks; nothing says so of FTN.
    """
    settled = rounding(p, LEAST, MOST, cut=True, gradual=False)
    quarter = 1 << p - 2 if rounds else 0
    third = (1 << p) // 3 if rounds else 0

    def multiply(xm: int, xe: int, ym: int, ye: int) -> Pair:
        product = abs(xm * ym) + quarter
        return settled(product if (xm < 0) == (ym < 0) else -product, xe + ye)

    def divide(xm: int, xe: int, ym: int, ye: int) -> Pair:
        quotient = ((abs(xm) << p) + third) // abs(ym)
        return settled(quotient if (xm < 0) == (ym < 0) else -quotient, xe - ye - p)

    nearest = rounding(p, LEAST, MOST, cut=False, gradual=False)
    plain, add = (_sum(p, each) for each in (False, rounds))
    return Rules(nearest, settled, add, multiply, divide, plain, signed_zero=False)


def _sum(p: int, rounds: bool) -> Operation:
    settled = rounding(p, LEAST, MOST, cut=True, gradual=False)

    def add(xm: int, xe: int, ym: int, ye: int) -> Pair:
        frame, e = framed(p, rounds, xm, xe, ym, ye)
        return settled(frame >> p if frame > 0 else -(-frame >> p), e)

    return add


def framed(p: int, rounds: bool, xm: int, xe: int, ym: int, ye: int) -> tuple[int, int]:
    """Return the sum in its frame, in units of 2**(e - p), and e, of the larger operand.

    The operands are normalised. The shift of the smaller one cuts its magnitude.
    """
    if xe <= ye:
        xm, xe, ym, ye = ym, ye, xm, xe
    apart = xe - ye
    large, small = abs(xm) << p, abs(ym) << p >> apart
    if rounds:
        half = 1 << p - 1
        large += half
        small += half >> apart
    return (large if xm > 0 else -large) + (small if ym > 0 else -small), xe
