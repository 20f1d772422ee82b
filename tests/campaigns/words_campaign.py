"""`python -m tests.campaigns.words_campaign [PAIRS]`: check the arithmetic of words.

A million operations of words of 24 and 53 bits are compared with numpy.float32 and float, bit for
bit; every rule is compared with exact rationals in 1e5 operations. Exit status 0 if all agree, else
1.
"""

import math
import operator
import struct
import sys
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np

from pyharness.thesis.word import RULES, WORDS, Number, Word
from tests.thesis.exact_words import disagreements

OPERATIONS: tuple[Callable[[Any, Any], Any], ...] = (
    operator.add, operator.sub, operator.mul, operator.truediv,
)  # fmt: skip
FLOATS: dict[str, tuple[type[np.floating[Any]], str, int, int]] = {
    "binary32": (np.float32, "uint32", 23, 8),
    "binary64": (np.float64, "uint64", 52, 11),
}


def pattern(random: Random, bits: int, exponents: int, near: int | None) -> int:
    """Return the bits of a float: any exponent, or one near another's; few or all bits set."""
    most = (1 << exponents) - 1
    if near is None:
        middle = most // 2
        places = (0, 1, 2, most, most - 1, most - 2, middle, middle + 1, random.randint(0, most))
        exponent = random.choice(places)
    else:
        exponent = min(max(near + random.randint(-bits - 3, bits + 3), 0), most)
    full = (1 << bits) - 1
    low = random.randint(0, 3)
    fraction = random.choice(
        (random.randint(0, full), low, full - low, 1 << random.randrange(bits))
    )
    return random.getrandbits(1) << bits + exponents | exponent << bits | fraction


def differing(name: str, count: int, seed: str) -> list[str]:
    """Return the operations whose bits differ from numpy's; only nan may have other bits."""
    kind, unsigned, bits, exponents = FLOATS[name]
    word, random = WORDS[name], Random(f"{seed} {name}")
    found = []
    with np.errstate(all="ignore"):
        for _ in range(count):
            first = pattern(random, bits, exponents, None)
            near = first >> bits & (1 << exponents) - 1 if random.random() < 0.6 else None
            second = pattern(random, bits, exponents, near)
            if random.random() < 0.1:
                second = first ^ (random.getrandbits(1) << bits + exponents) ^ random.getrandbits(2)
            x, y = np.array([first, second], unsigned).view(kind)
            operation = random.choice(OPERATIONS)
            due = operation(x, y)
            ours = operation(given(word, x), given(word, y))
            if not same(due, ours) or (x < y, x == y, x > y) != _order(word, x, y):
                found.append(f"{name}: {operation.__name__} {x!r} {y!r}: {ours!r}, due {due!r}")
    return found


def _order(word: Word, x: Any, y: Any) -> tuple[bool, bool, bool]:
    a, b = given(word, x), given(word, y)
    return a < b, a == b, a > b


def given(word: Word, x: Any) -> Number:
    """Return a float of numpy, converted by its bits, as a number."""
    value = float(x)
    if not value or not math.isfinite(value):
        return word(value)
    m, e = math.frexp(value)
    return word.number(*word.rules.nearest(int(m * 2.0**53), e - 53))


def same(due: Any, ours: Number) -> bool:
    """Whether two values are the same, including the sign of a zero."""
    x, y = float(due), float(ours)
    return struct.pack("d", x) == struct.pack("d", y) or (math.isnan(x) and math.isnan(y))


def main(arguments: list[str]) -> int:
    count = int(arguments[0]) if arguments else 1_000_000
    failures = []
    for name in FLOATS:
        failures += differing(name, count // 2, "campaign")
        print(f"{name}: {count // 2} operations, {len(failures)} differ so far", flush=True)
    for rule in RULES:
        for p in (24, 48, 53):
            failures += disagreements(p, rule, count // 10, "campaign")
            print(
                f"{rule}, {p} bits: {count // 10} pairs, {len(failures)} differ so far", flush=True
            )
    print("\n".join(failures[:20]))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
