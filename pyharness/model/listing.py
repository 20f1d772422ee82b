"""Listings: programs of the thesis with a choice of their defects, readings and conjectures."""

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
    """A program of the thesis: as printed, as corrected, or with any other choice of its defects.

    Attributes
    ----------
    program : {"two-term", "four-term", "runge-kutta"}
        The name of the program.
    defects : frozenset of str
        The active defects: mistakes of the printed program that are not corrected.
    readings : frozenset of str
        The active readings: interpretations of doubtful cards (program lines), other than ours. No
        reading changes a corrected program.
    conjectures : frozenset of str
        The active assumptions about statements for which no card exists. The argument `defects`
        also accepts the names of conjectures and readings.

    Raises
    ------
    InputError
        For an unknown program, or a name that the program does not have.

    Examples
    --------
    >>> from pyharness import Listing
    >>> Listing("two-term", {"dt-accumulates"}).label
    'custom'
    >>> Listing.original("two-term").label
    'original'
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
        _check_program(self.program)
        given = {field: _names(field, getattr(self, field)) for field in _FIELDS.values()}
        for kind in ("reading", "conjecture"):
            among = given["defects"] & set(names_of(kind, self.program))
            given["defects"] -= among
            given[_FIELDS[kind]] |= among
        for kind, field in _FIELDS.items():
            names = given[field]
            object.__setattr__(self, field, names)
            _check_names(kind, names, self.program)

    @property
    def label(self) -> str:
        """The kind: `corrected` (nothing active), `original` (`switches` active), or `custom`."""
        if not self.active:
            return "corrected"
        is_original = self.active - self.readings == set(switches(self.program))
        return "original" if is_original else "custom"

    @property
    def active(self) -> frozenset[str]:
        """The names of all active defects, readings and conjectures."""
        return self.defects | self.readings | self.conjectures

    @property
    def flags(self) -> int:
        """The active names as a bit mask for the compiled programs."""
        return sum(1 << entry["flag"] for entry in flagged() if entry["id"] in self.active)

    @classmethod
    def original(cls, program: str, readings: Iterable[str] = ()) -> "Listing":
        """Return the program as printed, with the names in `readings` active."""
        _check_program(program)
        return cls(program, frozenset(switches(program)), frozenset(readings))

    @classmethod
    def corrected(cls, program: str) -> "Listing":
        """Return the program without active defects, readings and conjectures."""
        return cls(program, frozenset())

    def has(self, name: str) -> bool:
        """Return whether the defect, reading or conjecture is active."""
        return name in self.active


def flagged() -> list[dict[str, Any]]:
    """Return the entries of `data/apparatus.toml` that have a switch; "flag" is the bit number."""
    return [entry for entry in facts("apparatus")["entry"] if "flag" in entry]


@cache
def names_of(kind: str, program: str | None = None) -> tuple[str, ...]:
    """Return the names of a kind, such as "defect", in one program or in all."""
    return tuple(
        entry["id"]
        for entry in flagged()
        if entry["kind"] == kind and (program is None or program in entry["programs"])
    )


def switchable(program: str | None = None) -> tuple[str, ...]:
    return tuple(name for kind in _FIELDS for name in names_of(kind, program))


@cache
def switches(program: str) -> tuple[str, ...]:
    """Return the defects and conjectures of the original program."""
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

    Parameters
    ----------
    program : {"two-term", "four-term", "runge-kutta"}
        The name of the program.
    base : {"original", "corrected"}, optional
        The listing to start from. The default is `corrected` if `keep` has names and `fix` has
        none, else `original`. With a corrected base, only `keep` activates readings and
        conjectures.
    fix, keep : iterable of str
        Names of any kind: `fix` corrects them, `keep` leaves them active.
    readings : iterable of str
        The readings to activate.
    conjectures : iterable of str, optional
        The conjectures to activate, or ``none``; by default those of `Listing.original`.

    Returns
    -------
    Listing
        The program with the selected names active.

    Raises
    ------
    InputError
        For an unknown program, base or name, a name in both `fix` and `keep`, and ``none`` beside
        another conjecture.

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
        _check_names(kind, names, program, option)
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


def _check_names(kind: str, names: frozenset[str], program: str, where: str = "") -> None:
    every, own = names_of(kind), names_of(kind, program)
    if where in ("--fix", "--keep"):
        every, own = switchable(), switchable(program)
    for name in sorted(names - {*own}):
        if name not in every:
            raise unknown(kind, name, own, where)
        place, allowed = f"{where}: " if where else "", ", ".join(own) or "none"
        raise InputError(f"{place}program {program} has no {kind} '{name}'; allowed: {allowed}")
