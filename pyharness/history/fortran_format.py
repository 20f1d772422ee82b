"""FORMAT: the edit descriptors that the decks use, and the records they write."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

_DESCRIPTOR = re.compile(
    r"(?P<count>\d*)(?:(?P<kind>[XH/])|F(?P<f>\d+)\.(?P<decimals>\d+)|I(?P<i>\d+))"
)


@dataclass(frozen=True)
class Edit:
    """One edit descriptor.

    Attributes
    ----------
    kind : str
        `F`, `I`, `X`, `H` or `/`.
    width, decimals : int
        Of the field; both 0 where they mean nothing.
    text : str
        What `H` writes.
    """

    kind: str
    width: int = 0
    decimals: int = 0
    text: str = ""

    @property
    def takes_a_value(self) -> bool:
        """Whether it edits an item of the list."""
        return self.kind in "FI"


@cache
def parse(text: str) -> tuple[Edit, ...]:
    """Return the descriptors of a FORMAT, parentheses included in `text`.

    Raises
    ------
    ValueError
        For what is no descriptor of the five kinds, or has no parentheses around it.
    """
    if not (text.startswith("(") and text.endswith(")")):
        raise ValueError(f"FORMAT {text!r}: no parentheses around it")
    edits: list[Edit] = []
    place, end = 1, len(text) - 1
    while place < end:
        if text[place] in ", ":
            place += 1
            continue
        found = _DESCRIPTOR.match(text, place, end)
        if found is None:
            raise ValueError(f"FORMAT {text!r}: no descriptor known here at character {place + 1}")
        place = found.end()
        count = int(found["count"] or 1)
        if found["kind"] == "H":
            literal = text[place : place + count]
            if place + count > end:
                raise ValueError(f"FORMAT {text!r}: {count}H reaches beyond the end")
            edits.append(Edit("H", count, text=literal))
            place += count
        elif found["kind"] == "X":
            edits.append(Edit("X", count))
        elif found["kind"] == "/":
            edits += [Edit("/")] * count
        elif found["f"]:
            edits += [Edit("F", int(found["f"]), int(found["decimals"]))] * count
        else:
            edits += [Edit("I", int(found["i"]))] * count
    return tuple(edits)


def write(text: str, values: Sequence[float]) -> list[str]:
    """Write a list by a FORMAT, as one WRITE statement does.

    Parameters
    ----------
    text : str
        The FORMAT, with its parentheses.
    values : sequence of float or int
        The list; whole numbers where the descriptor is `I`.

    Returns
    -------
    list of str
        The records, the character for the carriage control included.

    Notes
    -----
    Where the list is longer than the FORMAT, a new record begins at its start. Where it is
    shorter, what stands before the next descriptor that needs a value is still obeyed, a `/` too:
    so a FORMAT for four values that writes six ends with an empty record.
    """
    edits = parse(text)
    if values and not any(each.takes_a_value for each in edits):
        raise ValueError(f"FORMAT {text!r} has no place for a value")
    records = [""]
    rest: Iterator[float] = iter(values)
    left = len(values)
    while True:
        for edit in edits:
            if edit.kind == "/":
                records.append("")
            elif edit.takes_a_value:
                if not left:
                    return records
                left -= 1
                records[-1] += _field(edit, next(rest))
            else:
                records[-1] += edit.text or " " * edit.width
        if not left:
            return records
        records.append("")


def _field(edit: Edit, value: float) -> str:
    text = whole(value) if edit.kind == "I" else fixed(value, edit.width, edit.decimals)
    return text.rjust(edit.width) if len(text) <= edit.width else "*" * edit.width


def whole(value: float) -> str:
    """Return a whole number as `I` edits it."""
    if value != int(value):
        raise ValueError(f"{value!r} is not whole; I edits whole numbers")
    return str(int(value))


def fixed(value: float, width: int, decimals: int) -> str:
    """Return a number as `F` edits it, too long where it does not fit.

    The value that binary64 holds is rounded, exactly; a tie goes away from zero, as adding half
    a unit makes it. Zero has no minus sign (FORTRAN 77, 13.5.9). The zero before the point, which
    the language leaves to the processor, is written where there is room. What is not finite does
    not fit: the machine of 1982 printed R or I there, and asterisks say no less.
    """
    if not math.isfinite(value):
        return "*" * (width + 1)
    from decimal import ROUND_HALF_UP, Context, Decimal

    # binary64 has at most 309 digits before the point.
    context = Context(prec=320 + decimals, rounding=ROUND_HALF_UP)
    rounded = Decimal(float(value)).quantize(Decimal(1).scaleb(-decimals), context=context)
    sign = "-" if rounded < 0 else ""
    digits = f"{abs(rounded):f}" + ("" if decimals else ".")
    if len(sign + digits) > width and decimals and digits.startswith("0."):
        digits = digits[1:]
    return sign + digits
