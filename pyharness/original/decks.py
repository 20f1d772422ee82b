"""Decks: the cards of a program as fixed-form FORTRAN, and their run by a Fortran compiler.

A third path from the cards to the numbers. It shares the card table with the edition and nothing
with port and twin: the compiler reads the author's own statements, and LEQT1F is one of its own.
"""

import re
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from pyharness.model.errors import InputError, unknown
from pyharness.model.facts import facts
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.original.cards import deck, numbers

DIALECTS = ("1982", "gfortran")
COMPILER = "gfortran"
# Numbers are binary64 and 0 until they are set; no operation is joined with another.
FLAGS = (
    "-std=legacy", "-fdefault-real-8", "-fno-automatic", "-finit-real=zero", "-ffp-contract=off",
    "-fno-sign-zero",
)  # fmt: skip
_SOLVER = Path(__file__).parent.parent / "data" / "cards" / "leqt1f.f"
_MARK = "+"


class Run(NamedTuple):
    """What a compiled deck wrote.

    Attributes
    ----------
    tape5 : array (n, 7)
        TIME, U1 to U3 (rad/s), V1 to V3 (m/s), a row for each record.
    page : str
        TAPE6 as it was printed, without carriage control and blanks at the ends of lines.
    """

    tape5: np.ndarray
    page: str


def deck_text(
    listing: Listing,
    scene: Scene | None = None,
    dialect: str = "1982",
) -> str:
    """Return a program as fixed-form FORTRAN, card numbers in columns 73 to 80.

    Parameters
    ----------
    listing : Listing
        The program, its defects and readings.
    scene : Scene, optional
        A case of Table 1, in the deck's own assignment cards and DO limit; by default the case that
        was printed: 2 in the collocation decks, 5 in the other, 300 and 100 steps.
    dialect : {"1982", "gfortran"}
        The text, or the text with what a compiler of today needs, marked in column 73.

    Raises
    ------
    InputError
        For an unknown dialect, or a scene that no card can hold.
    """
    if dialect not in DIALECTS:
        raise unknown("dialect", dialect, DIALECTS, "--dialect")
    if listing.has("initial-torque"):
        raise InputError("no card holds 'initial-torque'; allowed: --conjecture torque-held, none")
    cards = {number: card.text for number, card in deck(listing.program).cards.items()}
    if scene is not None:
        cards |= _case_cards(listing.program, scene)
    marked = set()
    for each in facts("cards/alterations")["alteration"]:
        if _is_made(each, listing, dialect, scene.case if scene else None):
            for number in numbers(each.get("delete", "")):
                cards.pop(number, None)
            new = {
                n: f"      {text}" for n, text in each.get("replace", []) + each.get("insert", [])
            }
            cards |= new
            if "dialect" in each:
                marked |= set(new)
    return "".join(f"{cards[n]:72}{_MARK if n in marked else '':1}{n:7d}\n" for n in sorted(cards))


def _is_made(
    alteration: Mapping[str, Any], listing: Listing, dialect: str, case: int | None
) -> bool:
    """Whether all that an alteration names is so."""
    named = alteration.get
    return (
        named("program") == listing.program
        and named("dialect", dialect) == dialect
        and named("case", case) == case
        and not ("corrects" in alteration and listing.has(named("corrects", "")))
        and not ("unless" in alteration and listing.has(named("unless", "")))
        and all(listing.has(alteration[key]) for key in ("keeps", "reading") if key in alteration)
    )


def _case_cards(program: str, scene: Scene) -> dict[int, str]:
    if scene.case is None or scene.moments is None:
        raise InputError("a deck holds one of the cases of Table 1; allowed: --case 1 to 7")
    first = facts("cards/alterations")["case"][program]
    torque = scene.torque.constant
    for each in facts("printer")["initial_torque"]:
        if each["case"] == scene.case:
            torque = tuple(each["torque"])
    found = {}
    for name, values in (("moments", scene.moments), ("torque", torque), ("omega", scene.omega)):
        for axis, value in enumerate(values):
            number = first[name] + 10 * axis
            left = deck(program).cards[number].text.partition("=")[0]
            found[number] = f"{left}={_literal(value)}"
    loop = deck(program).cards[first["steps"]].text
    found[first["steps"]] = re.sub(r",\d+,", f",{scene.steps},", loop)
    return found


def _literal(value: float) -> str:
    return f"{value!r}".removesuffix("0") if value == int(value) else repr(value)


def solver_cards() -> int:
    """Return the cards of our LEQT1F, comments apart."""
    return sum(not line.startswith("C") for line in _SOLVER.read_text().splitlines())


def compiler() -> str | None:
    """Return the path of the compiler; None where there is none."""
    return shutil.which(COMPILER)


def run_deck(text: str, folder: Path | None = None) -> Run:
    """Compile a deck in the dialect `gfortran` and run it.

    Parameters
    ----------
    text : str
        The deck.
    folder : Path, optional
        Where the solver was compiled before, as `solver_object` does; else it is compiled anew.

    Raises
    ------
    RuntimeError
        Where the compiler refuses the deck, or the program fails.
    """
    with TemporaryDirectory() as place:
        here = Path(place)
        solver = solver_object(folder or here)
        (here / "deck.f").write_text(text)
        _command([COMPILER, *FLAGS, "deck.f", str(solver), "-o", "deck"], here)
        _command([str(here / "deck")], here)
        return Run(_records(here / "TAPE5"), _page((here / "TAPE6").read_text()))


def solver_object(folder: Path) -> Path:
    """Return LEQT1F compiled into a folder, where it is not yet."""
    found = folder / "leqt1f.o"
    if not found.exists():
        _command([COMPILER, *FLAGS, "-c", str(_SOLVER), "-o", str(found)], folder)
    return found


def _command(words: list[str], folder: Path) -> None:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{Path(words[0]).name}: {done.stderr.strip()[:600]}")


def _records(path: Path) -> np.ndarray:
    """Return the records of an unformatted file: 7 numbers between two lengths."""
    record = np.dtype([("begin", "i4"), ("values", "f8", 7), ("end", "i4")])
    return np.fromfile(path, dtype=record)["values"]


def _page(text: str) -> str:
    return "".join(line[1:].rstrip() + "\n" for line in text.splitlines())
