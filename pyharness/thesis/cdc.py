"""The rounding rules of the floating-point arithmetic of the CDC 6600 and CYBER 70.

The source is the CYBER 170 hardware reference, CDC 60463560. A number is an integer coefficient of
p = 48 bits and an exponent; a sum is formed in a register of 2 p bits, the frame. `FX` denotes
truncating sum, difference, product and quotient (octal 30, 31, 40 and 44), `RX` rounding ones (34,
35, 41 and 45). There is no guard bit: the bits below the unit of the larger operand are truncated
before NX (24) normalises a sum.
"""

from pyharness.thesis.rounding import Operation, Pair, Rules, rounding

# Exponents of an integer coefficient, for the octal exponent fields 0000 and 3776 of a word.
LEAST, MOST = -1023, 1022


def cdc(p: int, rounds: bool) -> Rules:
    """Return the arithmetic of the CDC for p-bit coefficients: RX if `rounds`, else FX.

    Literals are rounded to nearest, an assumption: no source states how CDC's FTN converted them.
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
    """Return the sum of xm 2**xe and ym 2**ye before normalisation, as a pair (frame, e).

    The frame is in units of 2**(e - p), where e is the larger exponent; coefficients have p bits.
    The smaller operand is shifted and truncated. If `rounds`, half a unit in the last place is
    first added to each operand, as RX does.
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
