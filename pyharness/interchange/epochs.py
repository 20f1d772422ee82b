"""Epochs: dates and times of files, as decimals without rounding."""

import re
from datetime import date, timedelta
from decimal import Context, Decimal

from pyharness.model.errors import InputError, kind_of

_ALLOWED = "allowed: a date and time such as 2026-01-31T12:00:00.5"
_CALENDAR = re.compile(
    r"(\d{4})-(?:(\d\d)-(\d\d)|(\d{3}))T(\d\d):(\d\d):(\d\d(?:\.\d+)?)Z?", re.ASCII
)
_DAY = 86_400
_DECIMALS = 15  # of a second; the rounding error is less than that of a time in binary64
_EXACT = Context(prec=60)
_FARTHEST = 1e15  # s; the calendar has fewer
_J2000 = (date(2000, 1, 1), Decimal(_DAY // 2))

# A date, and the seconds since its midnight.
Epoch = tuple[date, Decimal]


def read_epoch(where: str, text: object) -> Epoch:
    """Return the date, and the seconds since its midnight, of a date and time in ISO 8601.

    The date is a calendar date or a year with the number of the day, as CCSDS files have it. Raise
    InputError, with `where` in front of the message, if `text` is anything else.
    """
    if not isinstance(text, str):
        raise InputError(f"{where}: {kind_of(text)}; {_ALLOWED}")
    parts = _CALENDAR.fullmatch(text)
    if parts is None:
        raise InputError(f"{where}: '{text}' is no date and time; {_ALLOWED}")
    year, month, day, number, hours, minutes, seconds = parts.groups()
    try:
        if number is None:
            found = date(int(year), int(month), int(day))
        else:
            found = date(int(year), 1, 1) + timedelta(int(number) - 1)
            if int(number) < 1 or found.year != int(year):
                raise ValueError
    except (ValueError, OverflowError):
        raise InputError(f"{where}: '{text}' has no day of the calendar; {_ALLOWED}") from None
    if int(hours) > 23 or int(minutes) > 59 or Decimal(seconds) >= 61:
        raise InputError(f"{where}: '{text}' has no time of a day; {_ALLOWED}")
    if Decimal(seconds) >= 60:
        raise InputError(
            f"{where}: '{text}' is in a leap second; allowed: a file without one, as in the time "
            "system TAI"
        )
    return found, 3600 * int(hours) + 60 * int(minutes) + Decimal(seconds)


def later(epoch: Epoch, time: float) -> Epoch:
    """Return the epoch that is `time` (s) after another, rounded to 15 decimals of a second.

    Raise InputError if the calendar has no such day.
    """
    day, seconds = epoch
    if abs(time) > _FARTHEST:
        raise _beyond(time)
    total = _EXACT.add(seconds, Decimal(repr(time)))
    total = _EXACT.quantize(total, Decimal(1).scaleb(-_DECIMALS))
    days = int(_EXACT.divide_int(total, Decimal(_DAY)))
    rest = _EXACT.subtract(total, Decimal(_DAY * days))
    if rest < 0:
        days, rest = days - 1, _EXACT.add(rest, Decimal(_DAY))
    try:
        return day + timedelta(days), rest
    except OverflowError:
        raise _beyond(time) from None


def _beyond(time: float) -> InputError:
    return InputError(
        f"time {time:g} s is beyond the calendar; allowed: dates in the years 1 to 9999"
    )


def epoch_text(epoch: Epoch) -> str:
    """Return an epoch as text in ISO 8601, with as many decimals as it needs, and one at least."""
    day, seconds = epoch
    minutes = int(seconds) // 60
    whole, _, decimals = f"{seconds - 60 * minutes:f}".partition(".")
    clock = f"{minutes // 60:02}:{minutes % 60:02}:{int(whole):02}"
    return f"{day.isoformat()}T{clock}.{decimals.rstrip('0') or '0'}"


def seconds_between(first: Epoch, second: Epoch) -> float:
    """Return the seconds from one epoch to another, rounded once."""
    days = _DAY * (second[0] - first[0]).days
    return float(_EXACT.add(Decimal(days), _EXACT.subtract(second[1], first[1])))


def is_before(first: Epoch, second: Epoch) -> bool:
    """Return whether an epoch is before another one."""
    return first < second


def seconds_past_j2000(epoch: Epoch) -> float:
    """Return the seconds from 2000-01-01T12:00:00 to an epoch in the same time system."""
    return seconds_between(_J2000, epoch)


def half_years(first: Epoch, last: Epoch) -> bool:
    """Return whether an end of June or December, where leap seconds are, is between two epochs."""
    months = [(day.year, day.month > 6) for day, _ in (first, last)]
    return months[0] != months[1]
