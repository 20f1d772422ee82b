"""What can go wrong by a user's hand, each with one line: what, where, what is allowed."""

from collections.abc import Iterable

# More of a message than this is someone's input, given back at length.
_LONGEST = 900


class InputError(ValueError):
    """A user's mistake: exit code 2 on the command line.

    Its text is one line that a terminal can show, whatever it quotes.
    """

    def __init__(self, message: str) -> None:
        """Bring the message into one line."""
        line = printable(" ".join(message.split()))
        if len(line) > _LONGEST:
            line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"
        super().__init__(line)


class TimedError(InputError):
    """One whose message has a `time` (s) in it, in the units of whoever was asked."""

    def __init__(self, message: str, time: float) -> None:
        """Put the time where ``{time}`` stands."""
        super().__init__(message.replace("{time}", f"{time:.6g}"))
        self.time = time
        self._message = message

    def __reduce__(self) -> tuple[type["TimedError"], tuple[str, float]]:
        """Let it cross to another process, as multiprocessing hands it back."""
        return type(self), (self._message, self.time)

    def slower(self, factor: float) -> "TimedError":
        """Return the error of a motion whose times are `factor` as long."""
        return TimedError(self._message, self.time * factor)


class NotBuiltError(RuntimeError):
    """The compiled extension is missing: exit code 3 on the command line."""


def printable(text: str, kept: str = "") -> str:
    r"""Return a text in which what steers a terminal, or is no character, is an escape sequence.

    The characters in `kept`, as in ``"\n\t"``, stay as they are.
    """
    if text.translate(dict.fromkeys(map(ord, kept))).isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text
    )


def kind_of(value: object) -> str:
    """Name the kind of a value for a message, the same for one of TOML and its like in Python."""
    kinds = {
        "text": (str, bytes, bytearray), "true or false": (bool,), "a whole number": (int,),
        "a number": (float,), "a complex number": (complex,), "a list": (list, tuple),
        "a table": (dict,), "nothing": (type(None),),
    }  # fmt: skip
    for name, types in kinds.items():
        if isinstance(value, types):
            return name
    # NumPy, without its import: an array is a list, of which each entry has a kind.
    dtype_kind = getattr(getattr(value, "dtype", None), "kind", None)
    if isinstance(dtype_kind, str):
        if getattr(value, "shape", ()) != ():
            return "a list"
        scalars = {"b": bool, "i": int, "u": int, "f": float, "c": complex, "U": str, "S": str}
        if dtype_kind in scalars:
            return kind_of(scalars[dtype_kind]())
    return f"a {type(value).__name__}"


def unknown(what: str, name: object, allowed: Iterable[str], where: str = "") -> InputError:
    """Return the error for a name not among those allowed, with the nearest one.

    `what` it should name, as in "case"; `where` it was given, as in "--fix".
    """
    import difflib

    names = [str(each) for each in allowed]
    place = f"{where}: " if where else ""
    if not isinstance(name, str):
        return InputError(f"{place}{what} is {kind_of(name)}; allowed: {', '.join(names)}")
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'? " if near else ""
    shown = name if len(name) <= 60 else name[:57] + "..."
    return InputError(f"{place}unknown {what} '{shown}'; {hint}allowed: {', '.join(names)}")
