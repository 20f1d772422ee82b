"""C names for the slots (inputs and results) of a tape (recorded operations)."""

import re
from collections.abc import Iterator
from hashlib import sha256
from typing import TYPE_CHECKING, NamedTuple

from pyharness.model.codes import Operations
from pyharness.model.recurrences import OPERATIONS, WAVE, Operation

if TYPE_CHECKING:
    from pyharness.engine.system.recorded import Listing

TIME, FIRST_UNKNOWN = 1, 2  # slots, from 1
_MOST_OPERATIONS = 499  # whose products fit on a thread's stack

Listed = tuple[int, int, int, int]  # kind, operands x and y, and slot o of an operation


class Structure(NamedTuple):
    """The parts of recorded operations that determine their compiled code."""

    n_unknowns: int
    operations: tuple[Listed, ...]
    combinations: tuple[tuple[int, ...], ...]  # the slots of each


def structure(tape: "Listing") -> Structure | None:
    kinds = {operation[0] for operation in tape.operations}
    if not kinds <= {*OPERATIONS, Operations.LINEAR} or len(tape.operations) > _MOST_OPERATIONS:
        return None
    combinations = (tuple(slot for slot, _ in terms) for _, terms in tape.combinations)
    return Structure(tape.n_unknowns, tuple(tape.operations), tuple(combinations))


def key(tape: Structure) -> int:
    return int.from_bytes(sha256(repr(tuple(tape)).encode()).digest()[:8]) >> 1


def rule_of(operation: Listed) -> Operation:
    is_wave = operation[0] == Operations.SINE_COSINE and operation[2] > 0
    return OPERATIONS[WAVE if is_wave else operation[0]]


def letters(operation: Listed) -> dict[str, int]:
    """Return an operation's slots by their letters in recurrences.py."""
    _, x, y, out = operation
    return {"x": x, "y": y, "o": out, "p": out + 1, "q": out + 2}


def place(slot: int, k: str) -> str:
    """Return C code for term k of the Taylor series of a slot."""
    return f"A({slot}, {k})"


def with_slots(text: str, operation: Listed) -> str:
    """Return C code in which an operation's slots replace the letters."""
    slots = letters(operation)

    def name(match: re.Match[str]) -> str:
        what, slot = match[1], slots[match[2]]
        term = {"b": "k - 1", "f": "1", "l": "k"}.get(what)
        return place(slot, term) if term else f"{what}{slot}"

    return re.sub(r"\b([tzmbfl])_([xyopq])\b", name, text)


def combined(tape: Structure, number: int, name: str, *, is_value: bool) -> str:
    """Return C code for a linear combination of variables, named by `name` and their slots."""
    parts = [f"d[{number - 1}]"] * is_value
    parts += [f"c[{i}]*{name}{slot}" for i, slot in numbered_terms(tape, number)]
    return " + ".join(parts) or "0.0"


def numbered_terms(tape: Structure, number: int) -> Iterator[tuple[int, int]]:
    """Yield the number and the slot of each coefficient in a linear combination."""
    begin = sum(map(len, tape.combinations[: number - 1]))
    yield from enumerate(tape.combinations[number - 1], begin)


def rates_of(tape: Structure) -> range:
    """Return the numbers of the combinations that are the unknowns' derivatives."""
    return range(len(tape.combinations) - tape.n_unknowns + 1, len(tape.combinations) + 1)


def unknowns_of(tape: Structure) -> range:
    return range(FIRST_UNKNOWN, FIRST_UNKNOWN + tape.n_unknowns)


def slots_read(lines: list[str]) -> list[int]:
    """Return the slots that C code reads, such as 5 for z5."""
    return sorted({int(each) for each in re.findall(r"\bz(\d+)", " ".join(lines))})
