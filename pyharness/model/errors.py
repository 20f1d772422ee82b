"""Exceptions for users. Each message is one line: what is wrong, where, and what is allowed."""

from collections.abc import Iterable

# The most characters of a message. A message is longer only if it quotes long input; it is then
# shortened.
_LONGEST = 900


class InputError(ValueError):
    """The exception for an error in the user's input; a command that it ends has exit status 2.

    The message is one line of printable characters, even if it quotes other text.

    Parameters
    ----------
    message : str
        What is wrong, where, and what is allowed. White space is collapsed, and characters that are
        not printable are escaped. A message of more than 900 characters is shortened in the middle.

    Examples
    --------
    >>> from pyharness import InputError, case_scene
    >>> try:
    ...     case_scene(9)
    ... except InputError as error:
    ...     print(error)
    --case: unknown case '9'; allowed: 1, 2, 3, 4, 5, 6, 7
    """

    def __init__(self, message: str) -> None:
        """Store the message as one printable line."""
        line = printable(" ".join(message.split()))
        if len(line) > _LONGEST:
            line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"
        super().__init__(line)


class TimedError(InputError):
    """An InputError of a method, whose message contains a time (s) of the integrated scene.

    An example is the time at which the method reached its work limit. The integrated scene may be a
    copy of the user's scene with rescaled time. The function `slower` then converts the time to
    that of the user's scene.
    """

    def __init__(self, message: str, time: float) -> None:
        """Store the message, with `time` (s) in place of the text ``{time}``."""
        super().__init__(message.replace("{time}", f"{time:.6g}"))
        self.time = time
        self._message = message

    def __reduce__(self) -> tuple[type["TimedError"], tuple[str, float]]:
        """Return the class and the arguments that recreate the error, so that it can be pickled.

        Python's multiprocessing pickles errors.
        """
        return type(self), (self._message, self.time)

    def slower(self, factor: float) -> "TimedError":
        """Return the same error with its time multiplied by `factor`.

        The error was raised for a copy of the user's scene with rescaled time. `factor` converts
        the time of this copy to that of the user's scene.
        """
        return TimedError(self._message, self.time * factor)


class NotBuiltError(RuntimeError):
    """The exception for a missing Fortran extension; a command that it ends has exit status 3.

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
    r"""Return `text` with its unprintable characters replaced by escape sequences.

    Control characters are unprintable too. The characters in `kept`, for example ``"\n\t"``, are
    not replaced.
    """
    if text.translate(dict.fromkeys(map(ord, kept))).isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text
    )


def kind_of(value: object) -> str:
    """Return the type of a value in words for an error message, for example "a list".

    The words are the same for a value from a TOML file and the corresponding Python or NumPy value.
    """
    kinds = {
        "text": (str, bytes, bytearray), "true or false": (bool,), "a whole number": (int,),
        "a number": (float,), "a complex number": (complex,), "a list": (list, tuple),
        "a table": (dict,), "nothing": (type(None),),
    }  # fmt: skip
    for name, types in kinds.items():
        if isinstance(value, types):
            return name
    # NumPy is not imported for this. An array counts as a list.
    dtype_kind = getattr(getattr(value, "dtype", None), "kind", None)
    if isinstance(dtype_kind, str):
        if getattr(value, "shape", ()) != ():
            return "a list"
        scalars = {"b": bool, "i": int, "u": int, "f": float, "c": complex, "U": str, "S": str}
        if dtype_kind in scalars:
            return kind_of(scalars[dtype_kind]())
    return f"a {type(value).__name__}"


def unknown(what: str, name: object, allowed: Iterable[str], where: str = "") -> InputError:
    """Return the InputError for a name that is not among the allowed names.

    Its message lists the allowed names, and suggests one that is similar to `name`, if there is
    one. `what` says what `name` should denote, as in "case". `where` is the option or key to which
    the name was given, as in "--fix"; the message begins with it.
    """
    import difflib

    names = [str(each) for each in allowed]
    place = f"{where}: " if where else ""
    if not isinstance(name, str):
        return InputError(f"{place}{what} is {kind_of(name)}; allowed: {', '.join(names)}")
    initials = ["".join(part[:1] for part in each.split("-")) for each in names]
    near = [each for each, short in zip(names, initials, strict=True) if short == name.lower()]
    near = near or difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'? " if near else ""
    shown = name if len(name) <= 60 else name[:57] + "..."
    return InputError(f"{place}unknown {what} '{shown}'; {hint}allowed: {', '.join(names)}")
