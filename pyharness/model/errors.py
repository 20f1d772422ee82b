"""Exceptions for users, and parts of their messages."""

from collections.abc import Iterable

_LONGEST = 900  # most characters of a message; a longer one, which quotes input, is shortened


class InputError(ValueError):
    """An error in the user's input; a command that it ends has exit status 2.

    Parameters
    ----------
    message : str
        What is wrong, where, and what is allowed, as one printable line; above 900 characters it is
        shortened in the middle.

    Examples
    --------
    >>> from pyharness import InputError, case_scene
    >>> try:
    ...     case_scene(9)
    ... except InputError as error:
    ...     print(error)
    unknown case '9'; allowed: 1, 2, 3, 4, 5, 6, 7
    """

    def __init__(self, message: str) -> None:
        line = printable(" ".join(message.split()))
        if len(line) > _LONGEST:
            line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"
        super().__init__(line)


# The reason for the end of an integration at a switch.
SLIDING = (
    "a switch (where, sign, a comparison) would change back and forth without end from t = {time} "
    "s on; write a smooth function, such as tanh(x/width), or hold the torque between steps of a "
    "Stepper"
)


class TimedError(InputError):
    """An InputError whose message has the time (s) in place of "{time}"."""

    def __init__(self, message: str, time: float) -> None:
        super().__init__(message.replace("{time}", f"{time:.6g}"))
        self.time = time
        self._message = message

    def __reduce__(self) -> tuple[type["TimedError"], tuple[str, float]]:
        return type(self), (self._message, self.time)

    def slower(self, factor: float) -> "TimedError":
        return type(self)(self._message, self.time * factor)

    def later(self, by: float) -> "TimedError":
        return TimedError(self._message, self.time + by)


class WorkLimitError(TimedError):
    pass


class NotBuiltError(RuntimeError):
    """An error for a missing Fortran extension; a command that it ends has exit status 3.

    Examples
    --------
    >>> from pyharness import NotBuiltError, case_scene, run_program, subset
    >>> try:
    ...     found = run_program(case_scene(1), subset("two-term"))
    ... except NotBuiltError:
    ...     found = run_program(case_scene(1), subset("two-term"), implementation="python")
    >>> found.steps
    100
    """


def printable(text: str, kept: str = "") -> str:
    if text.translate(dict.fromkeys(map(ord, kept))).isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text
    )


def kind_of(value: object) -> str:
    """Return the type of a value in words, such as "a list"."""
    kinds = {
        "text": (str, bytes, bytearray), "true or false": (bool,), "a whole number": (int,),
        "a number": (float,), "a complex number": (complex,), "a list": (list, tuple),
        "a table": (dict,), "nothing": (type(None),),
    }  # fmt: skip
    for name, types in kinds.items():
        if isinstance(value, types):
            return name
    # Attributes are read so that NumPy need not be imported. An array counts as a list.
    dtype_kind = getattr(getattr(value, "dtype", None), "kind", None)
    if isinstance(dtype_kind, str):
        if getattr(value, "shape", ()) != ():
            return "a list"
        scalars = {"b": bool, "i": int, "u": int, "f": float, "c": complex, "U": str, "S": str}
        if dtype_kind in scalars:
            return kind_of(scalars[dtype_kind]())
    return f"a {type(value).__name__}"


def kind_or_empty(value: object) -> str:
    """Return "empty" for an empty list, else the type in words."""
    return "empty" if isinstance(value, list) and not value else kind_of(value)


def known(what: str, name: object, allowed: Iterable[str]) -> str:
    names = list(allowed)
    found = name.lower() if isinstance(name, str) else ""
    if found not in names:
        raise unknown(what, name, names)
    return found


def unknown(what: str, name: object, allowed: Iterable[str], where: str = "") -> InputError:
    """Return an InputError for a `name` that is not `allowed`."""
    import difflib

    names = [str(each) for each in allowed]
    place = f"{where}: " if where else ""
    if not isinstance(name, str):
        return InputError(f"{place}{what} is {kind_of(name)}; allowed: {', '.join(names)}")
    initials = ["".join(part[:1] for part in each.split("-")) for each in names]
    near = [each for each, short in zip(names, initials, strict=True) if short == name.lower()]
    near = near or difflib.get_close_matches(name, names, n=1, cutoff=0.7)
    hint = f"did you mean '{near[0]}'? " if near else ""
    shown = name if len(name) <= 60 else name[:57] + "..."
    return InputError(f"{place}unknown {what} '{shown}'; {hint}allowed: {', '.join(names)}")
