"""Random command lines: declared verbs and options, with right, wrong and absurd values."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

from pyharness.cli.main import VERBS
from pyharness.cli.options import FORMATS
from pyharness.cli.parser import Parser
from pyharness.engine.plan.registry import METHODS, PREPARED
from pyharness.history.ablation import entries
from pyharness.model.listing import PROGRAMS, names_of
from tests.campaigns.fuzz.strategies import mutated_word, number, scene_bytes, scene_text, tolerance

# Verbs of which a valid command takes milliseconds. Every command line of another verb, also of a
# future one, gets a mistake, which the verb must report.
QUICK_VERBS = ("run", "plan", "rotations", "defects", "doctor")

# Files of every folder in which a command line is tried; the other paths are missing on purpose.
GOOD, BAD, LONG_NAME = "good.toml", "bad.toml", "n" * 300
_SPECIAL = (
    "", ".", "..", "folder", "missing/x", "\0", "a\0b", "-", "--", LONG_NAME, "\udcff.toml",
    "/dev/null", "/dev/full", "/dev/zero", "/dev/stdin", "pipe", "locked", "/proc/self/mem",
)  # fmt: skip
_NUMBERS = (
    "", " ", "0", "-0", "1", "-1", "1e400", "-1e400", "nan", "inf", "-inf", "1e-400", "5e-324",
    "1e308", "0x10", "1_0", "\uff11", "٣", "1,2,3", "1,,2", ",", "1e", "--1", "1.5", "9" * 400,
    "9" * 5000, "1" + "0" * 4000, "true", "NULL", "1;2;3", "1 2 3",
)  # fmt: skip


@dataclass(frozen=True)
class CommandLine:
    """Arguments, the scene file that they may name, and whether they contain a certain mistake."""

    arguments: tuple[str, ...]
    scene: bytes
    mistaken: bool


def command_line(random: Random) -> CommandLine:
    """Return a command line with a few options, most often of an existing verb."""
    verb = random.choice(list(VERBS))
    if random.random() < 0.5:
        verb = random.choice(QUICK_VERBS)
    content = scene_bytes(random) if random.random() < 0.5 else scene_text(random).encode()
    if random.random() < 0.03:
        words = [mutated_word(random, verb), *(mutated_word(random, "x") for _ in range(2))]
        return CommandLine(tuple(each for each in words if each not in VERBS), content, False)
    arguments = [verb]
    parser = Parser(verb)
    for option in _usual(random, verb):
        arguments += _given(random, parser, option)
    names = [name for name in parser.option_names() if name != "--help"]
    for _ in range(random.choice((0, 0, 0, 1, 1, 2, 6))):
        arguments += _given(random, parser, random.choice(names))
    if random.random() < 0.1:
        place = random.randrange(1, len(arguments) + 1)
        arguments.insert(place, mutated_word(random, random.choice((*names, "x", "--help"))))
    if random.random() < 0.03:
        arguments[1:] = random.sample(arguments[1:], len(arguments) - 1)
    mistaken = verb not in QUICK_VERBS
    if mistaken:
        arguments.append(random.choice(("--no-such-option", "--format=no-such-format")))
    # Commands must not write by chance to other paths of the machine.
    harmless = [each for each in arguments if "/" not in each or each in _SPECIAL]
    # `--help` prints the help, whatever else is on the command line.
    mistaken = mistaken and harmless[-1] == arguments[-1] and "--help" not in harmless
    return CommandLine(tuple(harmless), content, mistaken)


def furnish(folder: Path, content: bytes) -> None:
    """Create the files that command lines name."""
    (folder / GOOD).write_text("[body]\nmoments=[4,3,2]\n[initial]\nomega=[0,1,2]\n[run]\nsteps=3")
    (folder / BAD).write_bytes(content)
    if not (folder / "folder").exists():
        (folder / "folder").mkdir()
        os.mkfifo(folder / "pipe")
        (folder / "locked").touch(mode=0)


def _usual(random: Random, verb: str) -> list[str]:
    """Return the options that a verb needs to do anything."""
    usual = {
        "run": ["--scene", "--program"], "plan": ["--scene"], "rotations": ["--scene"],
        "compare": ["--case"],
    }  # fmt: skip
    options = usual.get(verb, [])
    if random.random() < 0.4:
        options = [each.replace("--scene", "--case") for each in options]
    if random.random() < 0.4:
        options = [each.replace("--program", "--method") for each in options]
    return options if random.random() < 0.95 else []


def _given(random: Random, parser: Parser, option: str) -> list[str]:
    if parser._option_string_actions[option].nargs == 0:
        return [option]
    value = _plausible(random, option)
    kind = random.random()
    if kind < 0.10:
        value = mutated_word(random, value)
    elif kind < 0.18:
        value = random.choice(_NUMBERS)
    elif kind < 0.20:
        return [option]
    return [f"{option}={value}"] if random.random() < 0.2 else [option, value]


def _plausible(random: Random, option: str) -> str:
    """Return a value that the option might take."""

    def listed(names: tuple[str, ...] | list[str]) -> str:
        return ",".join(random.choice(names) for _ in range(random.choice((1, 1, 2, 3))))

    def numbers(count: int) -> str:
        return ",".join(f"{number(random, 0.2):.6g}" for _ in range(count))

    defects, readings = names_of("defect"), names_of("reading")
    choices: dict[str, Callable[[], str]] = {
        "--case": lambda: str(random.randint(0, 8)),
        "--scene": lambda: random.choice((GOOD, GOOD, BAD, BAD, random.choice(_SPECIAL))),
        "--omega": lambda: numbers(random.choice((3, 3, 3, 2))),
        "--step-size": lambda: numbers(1),
        "--steps": lambda: str(random.choice((1, 2, 3, 7, 30, 0, -1))),
        "--program": lambda: random.choice(PROGRAMS),
        "--method": lambda: random.choice((*METHODS, *METHODS, *PREPARED)),
        "--implementation": lambda: random.choice(("fortran", "python")),
        "--listing": lambda: random.choice(("original", "corrected")),
        "--fix": lambda: listed(defects),
        "--keep": lambda: listed(defects),
        "--reading": lambda: listed(readings),
        "--format": lambda: random.choice((*FORMATS, "printer", "tape5")),
        "--out": lambda: random.choice(("out.txt", "out.txt", *_SPECIAL)),
        "--plot": lambda: random.choice(("x.gif", "x", ".png", *_SPECIAL)),
        "--tolerance": lambda: f"{tolerance(random):.3g}",
        "--times": lambda: numbers(random.choice((1, 2, 3))),
        "--kind": lambda: str(random.choice(entries())["kind"]),
    }
    return choices.get(option, lambda: random.choice(("1", "2", "x")))()
