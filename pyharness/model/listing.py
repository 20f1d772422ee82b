"""Listings: programs of the thesis with a choice of their defects, readings and conjectures.

A card has one line of a program. A defect is a mistake of the printed program, and a reading is an
interpretation of a doubtful card. A conjecture is an assumption about a statement for which no card
exists.
"""

from collections.abc import Iterable, Set
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.facts import facts
from pyharness.model.values import number_list

PROGRAMS = ("two-term", "four-term", "runge-kutta")
_FIELDS = {"defect": "defects", "reading": "readings", "conjecture": "conjectures"}


@dataclass(frozen=True)
class Listing:
    """A program of the thesis as printed, as corrected, or with any other choice of its defects.

    Attributes
    ----------
    program : {"two-term", "four-term", "runge-kutta"}
        The name of the program.
    defects : frozenset of str
        The active defects, which are mistakes of the printed program that are not corrected.
    readings : frozenset of str
        The active readings, which are the ones that the program follows. A reading is an
        interpretation of a doubtful original statement, other than the one that we adopt. A
        corrected program has no readings, because no reading changes a corrected statement.
    conjectures : frozenset of str
        The active assumptions about statements that are on no printed card. Names of conjectures
        and readings are also accepted among `defects`.

    Raises
    ------
    InputError
        For an unknown program, or for a name that the program does not have.

    Examples
    --------
    >>> from pyharness import Listing
    >>> Listing("two-term", {"dt-accumulates"}).label
    'custom'
    >>> Listing.original("two-term").label
    'original'
    >>> Listing.corrected("two-term").label
    'corrected'
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
        """Check the given names, and assign each to its kind: defect, reading or conjecture.

        Raise InputError for an unknown program, or for a name that the program does not have.
        """
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
        """The kind of listing, as text: `original`, `corrected` or `custom`.

        The label is `corrected` if no defect (mistake), reading (interpretation of a doubtful
        statement) or conjecture (assumption about a missing statement) is active. It is `original`
        if, apart from readings, exactly the defects and conjectures that `switches` returns are
        active. It is `custom` otherwise.
        """
        if not self.active:
            return "corrected"
        return (
            "original" if self.active - self.readings == set(switches(self.program)) else "custom"
        )

    @property
    def active(self) -> frozenset[str]:
        """The names of all active defects, readings and conjectures of the listing.

        The listing is a program with a choice of these. A defect (mistake) is active if it is not
        corrected. A reading (interpretation of a doubtful statement) or a conjecture (assumption
        about a missing statement) is active if the program follows it.
        """
        return self.defects | self.readings | self.conjectures

    @property
    def flags(self) -> int:
        """The active defects, readings and conjectures as a bit mask, an integer.

        The compiled programs take this integer as an argument. A defect (mistake) is active if it
        is not corrected. A reading (interpretation of a doubtful statement) or a conjecture
        (assumption about a missing statement) is active if the program follows it.
        """
        return sum(1 << entry["flag"] for entry in flagged() if entry["id"] in self.active)

    @classmethod
    def original(cls, program: str, readings: Iterable[str] = ()) -> "Listing":
        """Return the listing of the original program, with all its defects active.

        The conjectures (assumptions) that belong to the original, as `switches` says, are active
        too. The given `readings`, which are interpretations of doubtful statements, are also
        active.
        """
        return cls(program, frozenset(switches(program)), frozenset(readings))

    @classmethod
    def corrected(cls, program: str) -> "Listing":
        """Return the listing of the corrected program.

        In this listing no defect (mistake), reading (interpretation of a doubtful statement) or
        conjecture (assumption about a missing statement) is active.
        """
        return cls(program, frozenset())

    def has(self, name: str) -> bool:
        """Return whether the defect, reading or conjecture with this name is active.

        A defect (mistake) is active if it is not corrected. A reading (interpretation of a doubtful
        statement) or a conjecture (assumption about a missing statement) is active if the program
        follows it.
        """
        return name in self.active


def flagged() -> list[dict[str, Any]]:
    """Return the entries of the critical apparatus that a listing can switch on or off.

    A listing is a program with a choice of its defects (mistakes), readings (interpretations) and
    conjectures (assumptions). The critical apparatus, the file `data/apparatus.toml`, has an entry
    for each of them. The key "flag" of an entry is the number of its bit in `Listing.flags`.
    """
    return [entry for entry in facts("apparatus")["entry"] if "flag" in entry]


@cache
def names_of(kind: str, program: str | None = None) -> tuple[str, ...]:
    """Return the names of all defects, of all readings or of all conjectures.

    `kind` is "defect", "reading" or "conjecture". A defect is a mistake of a printed program, a
    reading an interpretation of a doubtful statement, and a conjecture an assumption about a
    statement that is on no card. If `program` is given, only the names that this program has are
    returned.
    """
    return tuple(
        entry["id"]
        for entry in flagged()
        if entry["kind"] == kind and (program is None or program in entry["programs"])
    )


def switchable(program: str | None = None) -> tuple[str, ...]:
    """Return the names of all defects, readings and conjectures, in this order.

    A defect is a mistake of a printed program, a reading an interpretation of a doubtful statement,
    and a conjecture an assumption about a statement that is on no card. The options --fix and
    --keep accept these names. If `program` is given, only the names that this program has are
    returned.
    """
    return tuple(name for kind in _FIELDS for name in names_of(kind, program))


@cache
def switches(program: str) -> tuple[str, ...]:
    """Return the names of the defects and conjectures that are active in the original program.

    All its defects (mistakes) are active, which means that they are not corrected. A conjecture (an
    assumption about a statement that is on no card) is active, which means that the program follows
    it, if its entry in `data/apparatus.toml` has the key `in_original`, with the value true.
    """
    return tuple(
        entry["id"]
        for entry in flagged()
        if program in entry["programs"]
        and (entry["kind"] == "defect" or entry.get("in_original", False))
    )


def subset(
    program: str,
    base: str | None = None,
    fix: Iterable[str] = (),
    *,
    keep: Iterable[str] = (),
    readings: Iterable[str] = (),
    conjectures: Iterable[str] | None = None,
) -> Listing:
    """Return a Listing: a program with a selection of its defects, readings and conjectures.

    A defect is a mistake of the printed program, and a reading an interpretation of a doubtful
    statement. The parameters correspond to the options --program, --listing (`base`), --fix,
    --keep, --reading and --conjecture of the command line.

    Parameters
    ----------
    program : {"two-term", "four-term", "runge-kutta"}
        The name of the program.
    base : {"original", "corrected"}, optional
        The listing to start from. The default is `corrected` if `keep` has names and `fix` has no
        names, else `original`.
    fix, keep : iterable of str
        Names of defects, readings or conjectures: those to correct, and those to keep active.
    readings : iterable of str
        The readings to activate; an active reading replaces the adopted one. If the base is
        `corrected`, only `keep` activates a reading, because a corrected statement has its intended
        form under every reading.
    conjectures : iterable of str, optional
        The assumptions to make where no card exists, or ``none`` for no assumption. The default is
        the conjectures of `Listing.original`. If the base is `corrected`, only
        `keep` activates a conjecture.

    Returns
    -------
    Listing
        The program with the selected names active.

    Raises
    ------
    InputError
        For an unknown program or base, a name in both `fix` and `keep`, ``none`` together with
        another conjecture, or a name that the program does not have.

    Examples
    --------
    >>> from pyharness import subset
    >>> subset("two-term").label
    'original'
    >>> sorted(subset("runge-kutta", keep=["stage-base"]).defects)
    ['stage-base']
    """
    _check_program(program)
    fixed, kept, chosen = _names("fix", fix), _names("keep", keep), _names("readings", readings)
    for name in sorted(fixed & kept):
        raise InputError(f"'{name}' is given to both --fix and --keep; give it to one of them")
    assumed = None if conjectures is None else _names("conjectures", conjectures)
    if assumed is not None and "none" in assumed:
        if len(assumed) > 1:
            raise InputError("--conjecture: 'none' and a name are both given; give one of them")
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
    """Return the user's argument `listing`, or raise InputError if it is not a Listing."""
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
