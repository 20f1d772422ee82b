"""Listings: which defects of a program are active, and which readings are selected."""

from collections.abc import Iterable, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.facts import facts
from pyharness.model.values import number_list

PROGRAMS = ("two-term", "four-term", "runge-kutta")
_FIELDS = {"defect": "defects", "reading": "readings", "conjecture": "conjectures"}


@dataclass(frozen=True)
class Listing:
    """An original program, corrected, or anything between.

    Attributes
    ----------
    program : str
        One of `PROGRAMS`.
    defects : frozenset of str
        The defects that are active.
    readings : frozenset of str
        The readings that are active: an original statement is read the way that is not adopted. A
        corrected program has none, for no reading changes a corrected statement.
    conjectures : frozenset of str
        The active assumptions where no card exists. They and readings are also recognised
        among `defects`.
    """

    program: str
    defects: frozenset[str]
    readings: frozenset[str] = frozenset()
    conjectures: frozenset[str] = frozenset()

    if TYPE_CHECKING:

        def __init__(
            self,
            program: str,
            defects: Iterable[str],
            readings: Iterable[str] = ...,
            conjectures: Iterable[str] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Refuse names that the program does not have."""
        _check_program(self.program)
        given = {field: _names(field, getattr(self, field)) for field in _FIELDS.values()}
        for kind in ("reading", "conjecture"):
            among = given["defects"] & set(names_of(kind, self.program))
            given["defects"] -= among
            given[_FIELDS[kind]] |= among
        for kind, field in _FIELDS.items():
            names = given[field]
            object.__setattr__(self, field, names)
            for name in sorted(names):
                if name not in names_of(kind, self.program):
                    raise _foreign(kind, name, self.program)

    @property
    def label(self) -> str:
        """`original`, `corrected` or `custom`."""
        if not self.active:
            return "corrected"
        return (
            "original" if self.active - self.readings == set(switches(self.program)) else "custom"
        )

    @property
    def active(self) -> frozenset[str]:
        """The names of all that is active: defects, readings and conjectures."""
        return self.defects | self.readings | self.conjectures

    @property
    def flags(self) -> int:
        """The active names as the bits that the Fortran reads."""
        return sum(1 << entry["flag"] for entry in flagged() if entry["id"] in self.active)

    def has(self, name: str) -> bool:
        """Whether the defect, reading or conjecture `name` is active."""
        return name in self.active


def flagged() -> list[dict[str, Any]]:
    """Return the defects, readings and conjectures of the apparatus that have a flag."""
    return [entry for entry in facts("apparatus")["entry"] if "flag" in entry]


def names_of(kind: str, program: str | None = None) -> tuple[str, ...]:
    """Return the names of a kind (`defect`, `reading`, `conjecture`), of one program or of all."""
    return tuple(
        entry["id"]
        for entry in flagged()
        if entry["kind"] == kind and (program is None or program in entry["programs"])
    )


def switchable(program: str | None = None) -> tuple[str, ...]:
    """Return all names that can be corrected or kept: those of every kind, defects first."""
    return tuple(name for kind in _FIELDS for name in names_of(kind, program))


def switches(program: str) -> tuple[str, ...]:
    """Return all that is active in the original program: its defects, and what it conjectures."""
    return tuple(
        entry["id"]
        for entry in flagged()
        if program in entry["programs"]
        and (entry["kind"] == "defect" or entry.get("in_original", False))
    )


def original(program: str, readings: Iterable[str] = ()) -> Listing:
    """Return the original program: every defect is active, and what no card of it says."""
    return Listing(program, frozenset(switches(program)), frozenset(readings))


def corrected(program: str) -> Listing:
    """Return the corrected program, which is the same under every reading and conjecture."""
    return Listing(program, frozenset())


def subset(
    program: str,
    base: str | None = None,
    fix: Iterable[str] = (),
    keep: Iterable[str] = (),
    readings: Iterable[str] = (),
    conjectures: Iterable[str] | None = None,
) -> Listing:
    """Return the listing that the options of the command line describe.

    Parameters
    ----------
    base : {"original", "corrected"}, optional
        What to start from; where only `keep` is given, `corrected`, else `original`.
    fix, keep : iterable of str
        Defects, readings and conjectures to correct, and those to keep.
    readings : iterable of str
        Readings to select that are not the adopted ones. A corrected statement has its intended
        form under every reading: where the base is `corrected` only `keep` makes one active.
    conjectures : iterable of str, optional
        What the original assumes where no card exists, ``none`` for nothing; by default what
        `original` has. As with readings, only `keep` makes one active where the base is
        `corrected`.

    Raises
    ------
    InputError
        For a name in both `fix` and `keep`, or one that the program does not have.
    """
    _check_program(program)
    fixed, kept, chosen = _names("fix", fix), _names("keep", keep), _names("readings", readings)
    for name in sorted(fixed & kept):
        raise InputError(f"'{name}' is given to both --fix and --keep; give it to one")
    assumed = None if conjectures is None else _names("conjectures", conjectures)
    if assumed is not None and "none" in assumed:
        if len(assumed) > 1:
            raise InputError("--conjecture: 'none' beside a name; give one of them")
        assumed = frozenset()
    for option, kind, names in (
        ("--fix", "defect", fixed),
        ("--keep", "defect", kept),
        ("--reading", "reading", chosen),
        ("--conjecture", "conjecture", assumed or frozenset()),
    ):
        allowed = switchable(program) if kind == "defect" else names_of(kind, program)
        for name in sorted(names - set(allowed)):
            raise _foreign(kind, name, program, option)
    if base is None:
        base = "corrected" if kept and not fixed else "original"
    if not isinstance(base, str) or base not in ("original", "corrected"):
        raise unknown("listing", base, ("original", "corrected"), "--listing")
    if base == "corrected":
        return Listing(program, kept)
    if assumed is None:
        assumed = frozenset(switches(program)) - set(names_of("defect", program))
    return Listing(program, ({*names_of("defect", program)} | chosen | assumed) - fixed | kept)


def checked_listing(listing: object) -> Listing:
    """Return a listing; InputError where it is none."""
    if isinstance(listing, Listing):
        return listing
    raise InputError(f"listing is {kind_of(listing)}; it must be a Listing, as subset makes one")


def _check_program(program: object) -> None:
    if not isinstance(program, str) or program not in PROGRAMS:
        raise unknown("program", program, PROGRAMS)


def _names(where: str, names: object) -> frozenset[str]:
    allowed = "allowed: a list of names"
    found = list(names if isinstance(names, Set) else number_list(where, names, allowed))
    for name in found:
        if not isinstance(name, str):
            raise InputError(f"{where}: {kind_of(name)} where a name belongs")
    return frozenset(found)


def _foreign(kind: str, name: str, program: str, where: str = "") -> InputError:
    every, own = names_of(kind), names_of(kind, program)
    if where in ("--fix", "--keep"):
        every, own = switchable(), switchable(program)
    if name in every:
        place = f"{where}: " if where else ""
        return InputError(
            f"{place}program {program} has no {kind} '{name}'; allowed: {', '.join(own) or 'none'}"
        )
    return unknown(kind, name, own, where)
