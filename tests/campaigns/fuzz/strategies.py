"""Random inputs, by one generator for each kind, for the test suite and the campaign.

A generator takes a `random.Random`. Hypothesis passes one that it can shrink; the campaign passes
one that a seed and a number reproduce.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from random import Random
from typing import Any

from pyharness import InputError, Scene, TorqueLaw
from pyharness.checks.scenes.random_scenes import Draw, draw
from pyharness.engine.plan.registry import METHODS, PREPARED
from pyharness.model.listing import PROGRAMS, names_of
from pyharness.model.scene import Triple
from pyharness.model.torque_law import Wave

_CORNERS = (
    0.0, -0.0, 1.0, -1.0, 0.5, 1 / 3, 5e-324, -5e-324, 2.2250738585072014e-308, 1e-300, 1e-160,
    1e-155, 2.0**-53, 1e15, 1e16, 1e154, 1e155, 1e300, 1e308, 1.7976931348623157e308, -1e308,
)  # fmt: skip
_WORDS = (
    "", "text", "ü", "日本", "\U0001f600", "a b", "0", "-", "--", "None", "é" * 40, "x" * 3000,
)  # fmt: skip


def _sign(random: Random) -> float:
    return random.choice((-1.0, 1.0))


def violent(random: Random) -> float:
    """Return a finite number of any size."""
    kinds: tuple[Callable[[], float], ...] = (
        lambda: random.choice(_CORNERS),
        lambda: _sign(random) * math.pow(10.0, random.uniform(-308.0, 308.0)),
        lambda: _sign(random) * math.pow(10.0, random.uniform(-9.0, 9.0)),
        lambda: float(struct.unpack("<d", random.randbytes(8))[0]),
    )
    value = random.choice(kinds)()
    return value if math.isfinite(value) else 0.0


def tame(random: Random) -> float:
    """Return a number that a user might give."""
    kind = random.randrange(3)
    if kind == 0:
        return float(random.randint(-10, 10))
    return random.uniform(-10.0, 10.0) * (1.0 if kind == 1 else 10.0 ** random.uniform(-3.0, 3.0))


def number(random: Random, violence: float) -> float:
    """Return a finite number, violent with probability `violence`."""
    return violent(random) if random.random() < violence else tame(random)


def _triple(random: Random, violence: float) -> Triple:
    if random.random() < 0.15:
        return 0.0, 0.0, 0.0
    first, second, third = (number(random, violence) for _ in range(3))
    if random.random() < 0.15:
        second = first
    return first, second, third


def _waves(random: Random, violence: float) -> tuple[Wave, ...]:
    count = random.choice((0, 0, 0, 1, 1, 2, 5))
    return tuple((_triple(random, violence), number(random, violence)) for _ in range(count))


def scene(random: Random, most_steps: int = 12) -> Scene:
    """Return a valid scene, with numbers that are tame, partly violent or all violent."""
    while True:
        violence = random.choice((0.0, 0.1, 0.3, 1.0))
        law = TorqueLaw()
        if random.random() < 0.6:
            law = TorqueLaw(_triple(random, violence))
            if random.random() < 0.5:
                law = replace(law, rate=_triple(random, violence))
            if random.random() < 0.5:
                sines, cosines = _waves(random, violence), _waves(random, violence)
                law = replace(law, sines=sines, cosines=cosines)
        body = _triple(random, violence)
        step_size = 0.01 if random.random() < 0.5 else abs(number(random, violence)) or 0.1
        start, steps = _triple(random, violence), random.randint(1, most_steps)
        try:
            if random.random() < 0.6:
                moments = [abs(x) or 1.0 for x in body]
                return Scene("random", start, moments, None, law, step_size=step_size, steps=steps)
            return Scene("random", start, None, body, law, step_size=step_size, steps=steps)
        except InputError:
            continue


# A run of a program in both languages.
ProgramInput = Draw


def program_input(random: Random) -> ProgramInput:
    """Return a scene, any listing and a stop test, most often more violent than from `draw`."""
    drawn = draw("fuzz", random.randrange(10**6))
    if random.random() < 0.2:
        return drawn
    return replace(drawn, scene=scene(random), lipschitz=abs(number(random, 0.5)) or 500.0)


@dataclass(frozen=True)
class MethodInput:
    """A call of `solve` by a method of the registry."""

    scene: Scene
    times: tuple[float, ...]
    method: str
    tolerance: float
    attitude: bool


def tolerance(random: Random) -> float:
    """Return a tolerance, most often one that is allowed."""
    if random.random() < 0.1:
        return random.choice((violent(random), float("nan"), float("inf"), 1.0, 1e-15, 1e-16))
    return math.pow(10.0, random.uniform(-15.0, 0.0))


def times(random: Random) -> tuple[float, ...]:
    """Return times, most often in order, on one side of 0 or on both."""
    violence = random.choice((0.0, 0.0, 0.2, 1.0))
    values = [abs(number(random, violence)) for _ in range(random.choice((1, 1, 2, 5)))]
    if random.random() < 0.05:
        return random.choice(
            ((), (1.0, 1.0), (-1.0, 1.0), (float("nan"),), (float("inf"),), (1.0, 3.0, 2.0))
        )
    sign = _sign(random)
    turned = random.random() < 0.1
    if random.random() < 0.2:
        values = [_sign(random) * t for t in values]
    return tuple(sign * t for t in sorted(set(values), reverse=turned))


def method_input(random: Random) -> MethodInput:
    """Return a scene, times, and any method with any tolerance."""
    method = random.choice(list(METHODS))
    asked = tolerance(random)
    if METHODS[method].finest == 1.0 and random.random() < 0.9:
        asked = 1.0
    found, wanted = scene(random), times(random)
    rate = max(map(abs, found.euler_coefficients)) * max(map(abs, found.omega))
    longest = max(map(abs, wanted), default=0.0)
    if random.random() < 0.85 and 0.0 < rate * longest < float("inf"):
        # Most often so short that no method exceeds its work limit, which takes some methods ten
        # seconds.
        shrink = min(1.0, 10.0 ** random.uniform(-3.0, 3.0) / (rate * longest))
        wanted = tuple(t * shrink for t in wanted)
    found, attitude = _pointing(random, found)
    return MethodInput(found, wanted, method, asked, attitude)


def _pointing(random: Random, found: Scene) -> tuple[Scene, bool]:
    """Return the scene, perhaps with attitude or space torque, and whether to request attitudes."""
    if random.random() < 0.6:
        return found, False
    if random.random() < 0.5:
        q = tuple(number(random, 0.2) for _ in range(4))
        found = replace(found, attitude=(q[0], q[1], q[2], q[3]) if any(q) else None)
    if found.moments is not None and random.random() < 0.3:
        found = replace(found, torque=replace(found.law, frame="space"))
    return found, random.random() < 0.9


@dataclass(frozen=True)
class PreparedInput:
    """A prepared solver and a call of it."""

    scene: Scene
    method: str
    tolerance: float
    effort: float
    omega0: Triple
    t_end: float
    attitude: bool


def prepared_input(random: Random) -> PreparedInput:
    """Return a scene, any method that can be prepared, and the arguments of its call."""
    found = scene(random)
    omega0 = found.omega if random.random() < 0.5 else _triple(random, 0.3)
    t_end = number(random, random.choice((0.0, 0.3, 1.0)))
    if random.random() < 0.05:
        odd = random.choice((float("nan"), float("inf"), -float("inf")))
        omega0, t_end = random.choice((((odd, 1.0, 2.0), t_end), (omega0, odd)))
    # Sines of huge phases take ten times as long, and in a build with every check 50 times.
    effort = random.choice((1e-6, 1e-3, 0.1))
    found, attitude = _pointing(random, found)
    method = random.choice(PREPARED)
    return PreparedInput(found, method, tolerance(random), effort, omega0, t_end, attitude)


@dataclass(frozen=True)
class ListingInput:
    """Values of --program, --listing, --fix, --keep and --reading."""

    program: str
    base: str | None
    fix: tuple[str, ...]
    keep: tuple[str, ...]
    readings: tuple[str, ...]


def listing_input(random: Random) -> ListingInput:
    """Return names, known or not, in any combination."""

    def known(kind: str) -> tuple[str, ...]:
        return (*names_of("defect"), *names_of("reading")) if kind == "any" else names_of(kind)

    def one(names: tuple[str, ...], mistakes: float) -> str:
        name = random.choice(names)
        return mutated_word(random, name) if random.random() < mistakes else name

    def several(kind: str) -> tuple[str, ...]:
        return tuple(one(known(kind), 0.15) for _ in range(random.choice((0, 0, 1, 1, 2, 3))))

    kind = random.choice(("defect", "defect", "defect", "any"))
    return ListingInput(
        one(PROGRAMS, 0.05), random.choice((None, None, "original", "corrected", "", "corrected")),
        several(kind), several(kind), several("reading" if kind == "defect" else kind),
    )  # fmt: skip


def mutated_word(random: Random, word: str) -> str:
    """Return a word with a typing error, or another one, never with a path separator."""
    kinds: tuple[Callable[[int], str], ...] = (
        lambda place: word[:place] + word[place + 1 :],
        lambda place: word[:place] + chr(random.choice((32, 0x2C, 0xFC, 27, 10, 0x2028))) + word,
        lambda _: word.upper(),
        lambda _: random.choice(_WORDS),
        lambda _: "".join(chr(random.randrange(1, 0x3000)) for _ in range(random.randrange(12))),
        lambda _: word + chr(random.choice((0xDC80, 0xDCFF, 0x301, 0x1F600))),
    )
    return random.choice(kinds)(random.randrange(len(word) + 1)).replace("/", "|")


def scene_text(random: Random) -> str:
    """Return a valid scene file."""
    found = scene(random, 200)
    body = "moments" if found.moments else "coefficients"
    lines = [f'name = "{random.choice(("brick", "ü", "a b", ""))}"'] * (random.random() < 0.5)
    lines += ["[body]", f"{body} = {_list(found.moments or found.coefficients or ())}"]
    if random.random() < 0.1:
        x, y, z = found.moments or (3.0, 2.0, 1.0)
        lines[-1] = f"inertia = [[{x!r}, 0.1, 0], [0.1, {y!r}, 0], [0, 0, {z!r}]]"
    lines += ["[initial]", f"omega = {_list(found.omega)}"]
    if random.random() < 0.2:
        lines.append(f"attitude = {_list([number(random, 0.2) for _ in range(4)])}")
    elif random.random() < 0.1:
        lines += [f"angles_deg = {_list(found.omega)}", 'sequence = "3-2-1"']
    if random.random() < 0.6:
        law = found.law
        frame = ['frame = "space"'] * (random.random() < 0.1)
        lines += [
            "[torque]", *frame, f"constant = {_list(law.constant)}", f"rate = {_list(law.rate)}",
        ]  # fmt: skip
        for kind, waves in (("sines", law.sines), ("cosines", law.cosines)):
            entries = [f"{{ amplitude = {_list(a)}, frequency = {f!r} }}" for a, f in waves]
            lines.append(f"{kind} = [{', '.join(entries)}]")
    if random.random() < 0.6:
        lines += ["[run]", f"step_size = {found.step_size!r}", f"steps = {found.steps}"]
    return "\n".join(lines) + "\n"


def _list(values: Any) -> str:
    return "[" + ", ".join(map(repr, values)) + "]"


_VALUES = (
    "1e400", "-1e400", "1e-400", "inf", "-inf", "nan", "1979-05-27", "07:32:00",
    "1979-05-27T07:32:00Z", "true", '"text"', "'x'", "[]", "{}", "[[1]]", "[1,2]", "[1,2,3,4]",
    "{a=1}", "[{}]", "[1,[2],3]", "0x10", "0b1", "0o7", "1_000", "-0.0", "5e-324", "+1",
    "01", "1.", ".5", "1e", "", "''' '''", '"\\u0000"', '"\\ud800"', "0", "-1", "1.5", "[0,0,0]",
)  # fmt: skip
_KEYS = (
    "name", "body", "initial", "torque", "run", "moments", "coefficients", "omega", "constant",
    "rate", "sines", "cosines", "amplitude", "attitude", "angles_deg", "sequence", "inertia",
    "frame", "frequency", "step_size", "steps", "x", '""', '"ü"',
)  # fmt: skip


def scene_bytes(random: Random) -> bytes:
    """Return a scene file with faults in its values, its keys, its syntax or its bytes."""
    text = scene_text(random)
    for _ in range(random.choice((0, 1, 1, 1, 2, 4))):
        text = _mutated_text(random, text)
    content = text.encode("utf-8", "surrogatepass")
    for _ in range(random.choice((0, 0, 0, 1, 1, 3))):
        content = _mutated_bytes(random, content, text)
    return content


def _value(random: Random) -> str:
    kinds: tuple[Callable[[], str], ...] = (
        lambda: random.choice("123456789") + "0" * random.choice((20, 309, 400, 4000, 5000)),
        lambda: "0x" + "F" * random.choice((16, 300, 5000)),
        lambda: "[" * random.choice((3, 200, 5000)) + "1",
        lambda: random.choice(["[" * depth + "1" + "]" * depth for depth in (3, 100, 400)]),
        lambda: "{a=" * 50 + "1" + "}" * 50,
        lambda: "[" + "1.0," * random.choice((4, 3000)) + "]",
        lambda: repr(number(random, 0.7)),
    )
    plain = (lambda: random.choice(_VALUES),) * 5
    return random.choice(kinds + plain)()


def _mutated_text(random: Random, text: str) -> str:
    lines = text.split("\n")
    place = random.randrange(len(lines))
    before, line, after = lines[:place], lines[place], lines[place + 1 :]
    key, separator, _ = line.partition(" = ")
    other = random.choice(_KEYS)
    kinds: tuple[Callable[[], list[str]], ...] = (
        *(lambda: [*before, f"{key} = {_value(random)}" if separator else line, *after],) * 4,
        lambda: [*before, random.choice(lines), line, *after],
        lambda: before + after,
        lambda: [*before, f"{other} = {_value(random)}", line, *after],
        lambda: [*before, f"[{'.'.join([other] * random.choice((1, 2, 500)))}]", line, *after],
        lambda: [*before, f"[[{other}]]", line, *after],
        lambda: random.sample(lines, len(lines)),
    )
    return "\n".join(random.choice(kinds)())


def _mutated_bytes(random: Random, content: bytes, text: str) -> bytes:
    place = random.randrange(len(content) + 1)
    before, after = content[:place], content[place:]
    kinds: tuple[Callable[[], bytes], ...] = (
        lambda: before,
        lambda: before + random.randbytes(1) + after[1:],
        lambda: before + random.randbytes(random.randrange(20)) + after,
        lambda: before + b"\0" + after,
        lambda: b"\xef\xbb\xbf" + content,
        lambda: text.encode(random.choice(("utf-16", "utf-32", "utf-7")), "replace"),
        lambda: text.replace("brick", "ü").encode("latin-1", "replace"),
        lambda: content.replace(b"\n", random.choice((b"\r\n", b"\r", b"\n\n", b"\0"))),
        lambda: before + content,
        lambda: content + b"#" * random.choice((10, 999_000, 1_100_000)),
        lambda: b"",
    )
    return random.choice(kinds)()
