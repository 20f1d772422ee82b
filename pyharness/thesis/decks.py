"""The cards as fixed-form FORTRAN programs (decks), their compilation and their runs.

A compiled deck checks the ports independently, with the author's statements and a separate LEQT1F
(`data/cards/leqt1f.f`).
"""

import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from pyharness.model.errors import InputError, unknown
from pyharness.model.facts import facts
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.thesis.cards import deck, numbers
from pyharness.thesis.equations import card_torque
from pyharness.thesis.printer import TAPE5

# As printed, for GNU Fortran, and for CDC's FTN. The last two add the torque of Case 7.
DIALECTS = ("1982", "gfortran", "ftn")
SYSTEMS = ("nos", "nosbe")
# Numbers of terms of two more collocation programs, which the thesis uses for Case 6 (V.2), but
# does not print.
MODELS = (3, 5)
COMPILER = "gfortran"
# Options for REAL in binary64, variables that are 0 until set, and no fused operations.
FLAGS = (
    "-std=legacy", "-fdefault-real-8", "-fno-automatic", "-finit-real=zero", "-ffp-contract=off",
    "-fno-sign-zero",
)  # fmt: skip
_SOLVER = Path(__file__).parent.parent / "data" / "cards" / "leqt1f.f"
_MARK = "+"


class Run(NamedTuple):
    """The output of a compiled deck."""

    tape5: np.ndarray  # shape (n, 7): TIME (s), U1 to U3 (rad/s), V1 to V3 (m/s)
    page: str  # TAPE6 without carriage control or trailing blanks


def deck_text(
    listing: Listing, scene: Scene | None = None, dialect: str = "1982", terms: int | None = None
) -> str:
    """Return a deck as fixed-form FORTRAN, with the printed data or the data of `scene`.

    With `terms`, 3 or 5, the deck is that of `model_cards`.
    """
    if dialect not in DIALECTS:
        raise unknown("dialect", dialect, DIALECTS, "--dialect")
    if listing.has("initial-torque"):
        raise InputError(
            "'initial-torque' can't be written as cards; allowed: --conjecture torque-held, none"
        )
    cards = {number: card.text for number, card in deck(listing.program).cards.items()}
    if terms is not None:
        cards = _model(terms, listing, scene)
    if scene is not None:
        cards |= _case_cards(listing.program, scene)
    marked = set()
    for each in alterations():
        if terms is not None and "dialect" not in each:
            continue
        if _is_made(each, listing, dialect, scene.case if scene else None):
            for number in numbers(each.get("delete", "")):
                cards.pop(number, None)
            new = {
                n: f"      {text}" for n, text in each.get("replace", []) + each.get("insert", [])
            }
            cards |= new
            if "dialect" in each:
                marked |= set(new)
    # Column 73 marks the dialect's cards; columns 74 to 80 have the card number.
    return "".join(f"{cards[n]:72}{_MARK if n in marked else '':1}{n:7d}\n" for n in sorted(cards))


def alterations() -> list[dict[str, Any]]:
    """Return the alterations by entries of the apparatus, then by dialects."""
    by_entries = [
        {"keeps" if each.get("active") else "corrects": entry["id"]} | each
        for entry in facts("apparatus")["entry"]
        for each in entry.get("alteration", [])
    ]
    return [*by_entries, *facts("cards/alterations")["alteration"]]


def card_steps(program: str) -> int:
    """Return the number of steps in a program's printed DO statement."""
    number = facts("cards/alterations")["case"][program]["steps"]
    return int(deck(program).cards[number].text.split(",")[1])


def corrected_cards(program: str) -> dict[int, str]:
    lines = deck_text(Listing.corrected(program)).splitlines()
    return {int(line[73:]): line[:72].rstrip() for line in lines}


def corrections(program: str) -> dict[int, list[str]]:
    """Return the defects whose correction changes a card, by card number."""
    found: dict[int, list[str]] = {}
    for each in alterations():
        if each["program"] == program and "corrects" in each and "case" not in each:
            new = [number for number, _ in each.get("replace", []) + each.get("insert", [])]
            for number in {*numbers(each.get("delete", "")), *new}:
                if each["corrects"] not in (names := found.setdefault(number, [])):
                    names.append(each["corrects"])
    return found


def job_text(deck: str, system: str = "nos", rounds: bool = False) -> str:
    """Return a batch job that compiles and runs a deck (dialect `ftn`) with CDC's FTN.

    `rounds` sets FTN's option ROUND.
    """
    if system not in SYSTEMS:
        raise unknown("system", system, SYSTEMS, "--system")
    jobs = facts("cards/jobs")
    job = jobs[system]
    compiles = job["compile"].format(rounds=jobs["rounds"] if rounds else "")
    control = [*job["before"], compiles, *job["after"], jobs["record"]]
    statements = "".join(f"{each}\n" for each in control)
    named = statements.format(user="USERNAME", password="PASSWORD")  # assigned by the site
    return named + with_solver(deck)


def with_solver(deck: str) -> str:
    """Return a deck with our LEQT1F, which was in a library, if it calls it."""
    return deck + (_SOLVER.read_text() if "LEQT1F" in deck else "")


def _is_made(
    alteration: Mapping[str, Any], listing: Listing, dialect: str, case: int | None
) -> bool:
    """Return whether an alteration's conditions hold; `case` is None for the printed data."""
    named = alteration.get
    return (
        named("program") == listing.program
        and dialect in named("dialect", [dialect])
        and named("case", case) == case
        and not ("corrects" in alteration and listing.has(named("corrects", "")))
        and named("listing", listing.label) == listing.label
        and not any(name == listing.label or listing.has(name) for name in named("unless", ()))
        and ("keeps" not in alteration or listing.has(alteration["keeps"]))
    )


def _model(terms: int, listing: Listing, scene: Scene | None) -> dict[int, str]:
    if listing.program != "four-term":
        raise InputError("terms: not for this program; allowed: with program four-term")
    if terms not in MODELS:
        raise InputError(f"terms is {terms}; allowed: 3 or 5")
    if scene is not None and scene.torque.varies:
        raise InputError("--terms writes no torque that varies with time; allowed: --case 1 to 6")
    cards = model_cards(terms)
    if not listing.has("dt-accumulates"):
        cards = {n: each for n, each in cards.items() if each.strip() != "DT=DT+.01"}
    return cards


def model_cards(terms: int) -> dict[int, str]:
    """Return the cards of our conjectural collocation deck with `terms` terms, by number."""
    text = [card.text for card in deck("four-term").cards.values()]
    terms_range = range(1, terms + 1)
    end = f"T{terms + 1}"

    def polynomials(at: str, time: str) -> Iterator[str]:
        for column, name in enumerate(("U1", "U2", "U3", "V1", "V2", "V3"), 1):
            powers = [f"B({k},{column})*{time}" + (f"**{k}" if k > 1 else "") for k in terms_range]
            more = ["+".join(powers[3:])] if terms > 3 else []
            yield f"{name}({at})={name}(1)+" + "+".join(powers[:3]) + "+" * len(more)
            yield from more

    arrays = f"A({terms},{terms}),B({terms},6),WKA({6 * terms}),"
    heads = [each.replace("A(4,4),B(4,6),WKA(24),", arrays) for each in text[:6]]
    text[:6] = [each.replace("(6)", "(8)") for each in heads]
    name = {3: "THREE", 5: "FIVE"}.get(terms, "FOUR")
    text[text.index("C FOUR TERM APPROXIMATION")] = f"C {name} TERM APPROXIMATION, A CONJECTURE"
    # New statements, by the first and the last statement that they replace.
    groups = {
        ("T1=DT*.2", "T5=.01"): [f"T{k}=DT*{k}./{terms + 1}." for k in terms_range]
        + [f"{end}=.01"],
        ("A(1,1)=1.", "A(4,4)=4.*T4**3"): [
            f"A({j},{k})={k}." + (f"*T{j}" if k > 1 else "") + (f"**{k - 1}" if k > 2 else "")
            for j in terms_range
            for k in terms_range
        ],
        ("B(1,1)=F1", "B(4,6)=Z1"): [
            f"B({k},{c})={n}1" for c, n in enumerate("FGHXYZ", 1) for k in terms_range
        ],
        ("N=4", "IA=4"): [f"N={terms}", f"IA={terms}"],
        ("DO 400 L=2,5,1", "CB(4,6)*T(L)**4"): [
            f"DO 400 L=2,{terms + 1},1",
            *(f"T({k + 1})=T{k}" for k in terms_range),
            *polynomials("L", "T(L)"),
        ],
        ("B(1,1)=F(2)", "B(4,6)=Z(5)"): [
            f"B({k},{c})={n}({k + 1})" for c, n in enumerate("FGHXYZ", 1) for k in terms_range
        ],
        ("U1(6)=U1(1)+B(1,1)*T5+B(2,1)*T5**2+B(3,1)*T5**3+", "CB(4,6)*T5**4"): [
            *polynomials(str(terms + 2), end)
        ],
    }
    for (start, last), new in groups.items():
        for first in reversed([n for n, each in enumerate(text) if each.strip() == start]):
            after = next(n for n in range(first, len(text)) if text[n].strip() == last)
            text[first : after + 1] = [f"      {each}" for each in new]
    tail = next(n for n, each in enumerate(text) if each.strip().startswith("WRITE(6,5)"))
    text[tail:] = [each.replace("(6)", f"({terms + 2})") for each in text[tail:]]
    # A card that ends with an operator continues on the next card.
    for n, each in enumerate(text[:-1]):
        if each.rstrip().endswith("+"):
            text[n + 1] = "     C" + text[n + 1].strip().removeprefix("C")
    return {100 + 10 * n: each for n, each in enumerate(text)}


def _case_cards(program: str, scene: Scene) -> dict[int, str]:
    if scene.case is None or scene.moments is None:
        raise InputError("a deck holds one of the cases of Table 1; allowed: --case 1 to 7")
    first = facts("cards/alterations")["case"][program]
    torque = card_torque(scene) or scene.body_torque.constant
    found = {}
    for name, values in (("moments", scene.moments), ("torque", torque), ("omega", scene.omega)):
        for axis, value in enumerate(values):
            number = first[name] + 10 * axis
            # Whole numbers have no digit after the point.
            written = repr(value).removesuffix("0") if value == int(value) else repr(value)
            left = deck(program).cards[number].text.partition("=")[0]
            found[number] = f"{left}={written}"
    loop = deck(program).cards[first["steps"]].text
    found[first["steps"]] = re.sub(r",\d+,", f",{scene.steps},", loop)
    return found


def solver_cards() -> int:
    return sum(not line.startswith("C") for line in _SOLVER.read_text().splitlines())


def compiler() -> str | None:
    return shutil.which(COMPILER)


def run_deck(text: str, folder: Path | None = None) -> Run:
    """Compile and run a deck (dialect `gfortran`), and return its output.

    `folder` keeps the compiled solver for later calls.
    """
    with TemporaryDirectory() as place:
        here = Path(place)
        solver = solver_object(folder or here)
        (here / "deck.f").write_text(text)
        _command([COMPILER, *FLAGS, "deck.f", str(solver), "-o", "deck"], here)
        _command([str(here / "deck")], here)
        lines = (here / "TAPE6").read_text().splitlines()
        page = "".join(line[1:].rstrip() + "\n" for line in lines)
        return Run(np.fromfile(here / "TAPE5", TAPE5.newbyteorder("="))["items"], page)


def solver_object(folder: Path) -> Path:
    found = folder / "leqt1f.o"
    if not found.exists():
        _command([COMPILER, *FLAGS, "-c", str(_SOLVER), "-o", str(found)], folder)
    return found


def _command(words: list[str], folder: Path) -> None:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{Path(words[0]).name}: {done.stderr.strip()[:600]}")
