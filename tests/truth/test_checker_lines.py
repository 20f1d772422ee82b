"""Each line of the checker that carries out a part of the proof is necessary.

The file `weaker_lines.txt` has weaker forms of these lines. For each a forged certificate is made,
with the bounds of the weaker checker. The weaker checker accepts it, the real one refuses it.
"""

import ast
import itertools
import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from pyharness.truth import certificate_checker

Record = dict[str, Any]
Change = Callable[[Record], Any]
PATH = Path(certificate_checker.__file__)
SOURCE = PATH.read_text(encoding="utf-8")
ONE = 1 << certificate_checker.SCALE_BITS
FREE = {"constant": [0.0] * 3, "rate": [0.0] * 3, "sines": [], "cosines": []}
LAW = {
    "constant": [1.0, -2.0, 0.3], "rate": [0.1, 0.0, -70.0],
    "sines": [[[3.0, 0.0, 1.0], 5.0], [[-0.5, 1e-3, 0.7], 5.0]],
    "cosines": [[[0.0, 2.0, -1.0], -3.0], [[1.0, 0.2, -1.0], 5.0]],
}  # fmt: skip
WAVES: Record = {
    "name": "waves", "moments": [40.0, "30.25", 20.0], "omega": [0.3, -1.0, 2.0], "torque": LAW,
}  # fmt: skip
TOP: Record = {"name": "", "coefficients": [0.5, -0.25, 0.125], "omega": [0.1, 0.7, 1.3]}
TOP |= {"torque": {**FREE, "constant": [1.0, 2.0, 3.0]}}
# The symmetric part of its Jacobian has a negative factor of the first component of omega.
STABLE: Record = {"name": "", "coefficients": [0.1, -0.9, -0.8], "omega": [4.0, 0.1, 0.1]}
STABLE |= {"torque": FREE}
# The factor of its third component is less than a thousandth of the largest one.
NARROW: Record = {"name": "", "coefficients": [0.5, -0.4998, 0.1], "omega": [0.1, 0.1, 9.0]}
NARROW |= {"torque": FREE}


def weaker(old: str, new: str) -> ModuleType:
    """Return the checker with a part of its source replaced."""
    assert SOURCE.count(old) == 1
    module = ModuleType("weaker")
    exec(compile(SOURCE.replace(old, new), "weaker", "exec"), module.__dict__)
    return module


def begun(omega: list[int], waves: list[int], radius: int) -> Any:
    return omega, waves, radius


def ends_of(series: list[list[int]]) -> list[int]:
    return [sum(each) for each in series]


def advanced(omega: list[int], waves: list[int], radius: int, time: int, h: int) -> Any:
    return omega, waves, radius, time + h


def forged(
    module: Any,
    scene: Record,
    *,
    bits: int = 100,
    clock: int = 40,
    order: int = 14,
    scales: tuple[int, ...] = (ONE, ONE // 2, ONE * 3 // 4),
    length: float = 0.125,
    tube: int = 1 << 90,
    first: Callable[..., Any] = begun,
    end: Callable[[list[list[int]]], list[int]] = ends_of,
    moved: int = 0,
    after: Callable[..., Any] = advanced,
    row: Callable[[int, float], float] = lambda number, h: (number + 0.5) * h,
    place: Fraction = Fraction(1, 2),
    miss: int = 0,
) -> Record:
    """Return a certificate of three steps with the least radii that a checker accepts.

    Each row is at the half of a step, and the distance of its middle from the ball of the step is
    the largest that its radius allows.
    """
    system = module.System(scene, bits, clock, list(scales))
    unit, h = 1 << bits, int(length * 2**clock)
    omega = [int(Fraction(x) * unit) for x in scene["omega"]]
    waves = [0, unit] * len(system.frequencies)
    omega, waves, radius = first(omega, waves, system.norm([1, 1, 1]))
    wave_radius, time, steps, rows = 0, 0, [], []
    for number in range(3):
        expansion = system.expand([*omega, *waves], time, h, order)
        radius, wave_radius = system.radii(radius, wave_radius, expansion, tube, h)
        middle, size = system.ball(expansion[0], place, radius)
        stated = 2.0 * float(size / unit) + 1e-300
        away = Fraction(stated) * unit - size + miss * size
        texts = [decimal((x + away) / unit) for x in middle]
        rows.append({"time": row(number, h / 2**clock), "omega": texts, "radius": stated})
        ends = end(expansion[0])
        omega = [x + moved for x in ends[:3]]
        radius += system.norm([0, 0, 0])
        steps.append([h, tube, radius, omega])
        omega, waves, radius, time = after(omega, ends[3:], radius, time, h)
    record = {"format": module.FORMAT, "scene": scene, "bits": bits, "clock": clock}
    return record | {"order": order, "scales": list(scales), "steps": steps, "rows": rows}


def decimal(x: Fraction) -> str:
    """Return a fraction over a power of two as a decimal number with all of its digits."""
    digits = min(x.denominator.bit_length() - 1, 4000)
    text = str(int(abs(x) * 10**digits)).rjust(digits + 1, "0")
    return f"{'-' if x < 0 else ''}{text[: len(text) - digits]}.{text[len(text) - digits :] or 0}"


def accepts(module: Any, record: Record | str, folder: Path) -> bool:
    """Return whether a checker accepts a certificate, or the text of one."""
    path = folder / "certificate.json"
    path.write_text(record if isinstance(record, str) else json.dumps(record))
    return module.check_file(str(path))[0] is not None


def negative(record: Record) -> Record:
    """Return a certificate of the same equations, with negative moments."""
    scene, torque = record["scene"], record["scene"]["torque"]
    vectors = {key: [-x for x in torque[key]] for key in ("constant", "rate")}
    waves = {key: [[[-x for x in a], f] for a, f in torque[key]] for key in ("sines", "cosines")}
    moments = [-float(x) for x in scene["moments"]]
    return {**record, "scene": {**scene, "moments": moments, "torque": vectors | waves}}


def edited(old: str, new: str) -> Change:
    """Return a change of the text of a certificate."""

    def change(record: Record) -> str:
        text = json.dumps(record)
        assert old in text
        return text.replace(old, new, 1)

    return change


def put(*keys: Any) -> Change:
    """Return a change that puts the last of `keys` at the place that the others name."""

    def change(record: Record) -> Record:
        *path, last, value = keys
        copy: Record = json.loads(json.dumps(record))
        holder: Any = copy
        for key in path:
            holder = holder[key]
        holder[last] = value(holder[last]) if callable(value) else value
        return copy

    return change


def twice(values: list[Any]) -> list[Any]:
    return [*values, values[-1]]


def without_last_step(record: Record) -> Record:
    """Return a certificate whose rows are proved by the first two steps, and with a false third."""
    steps = [*record["steps"][:2], [1, 1, 0, [0] * 3]]
    return {**record, "rows": record["rows"][:2], "steps": steps}


OTHERS = ("check_file", "main")  # functions that read and print
# A `raise` has a condition, which is weakened.
NO_LINES = (ast.FunctionDef, ast.ClassDef, ast.Import, ast.ImportFrom, ast.Raise, ast.Try)


def is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


# Arguments of `forged` for the lines with the bounds of a step.
TRIALS: list[Record] = [
    *({"scene": scene, **more} for scene in (WAVES, TOP) for more in ({}, {"length": -0.25})),
    {"scene": STABLE},
    {"scene": NARROW, "scales": (ONE, ONE, ONE)},
    *(
        {"scene": scene, "length": 0.4, "tube": tube << 100}
        for scene in (WAVES, TOP)
        for tube in (1, 3)
    ),
]
REST: Record = {**TOP, "omega": [0.0] * 3, "torque": FREE}
SHORT = {"clock": 1, "length": 0.5, "scene": {**TOP, "torque": FREE}}
# For other lines: arguments of `forged`, and a change of the certificate.
FORGERIES: dict[str, tuple[Record, Change]] = {
    # Keys, lengths and types.
    "omega-as-text": ({}, put("scene", "omega", 2, "2.0")),
    "row-as-number": ({}, put("rows", 0, "omega", 2, float)),
    "digits-with-underscore": ({}, put("scene", "moments", 1, "3_0.25")),
    "exponent": ({}, put("scene", "moments", 1, "3025e-2")),
    "true-for-1": (SHORT, put("clock", True)),
    "false-for-0": ({"scene": REST}, put("steps", 2, 3, 0, False)),
    "four-numbers": ({"scene": TOP}, put("scene", "torque", "constant", twice)),
    "four-rates": ({}, put("scene", "torque", "rate", twice)),
    "name-of-no-text": ({}, put("scene", "name", 5)),
    "unknown-key": ({}, put("scene", "torque", "frame", "space")),
    "key-twice": ({}, edited('"omega": [', '"omega": [9.0, 9.0, 9.0], "omega": [')),
    "long-number": ({}, edited("0.0625", f"0.0625{'0' * 4300}")),
    "another-format": ({}, put("format", "another")),
    "no-rows": ({}, put("rows", [])),
    "many-bits": ({"bits": 12_001, "tube": 1 << 11_990, "miss": -1}, dict),
    "order-1": ({"order": 1, "scene": REST}, dict),
    "another-order": ({}, put("order", 13)),
    # The equations, and the state at time 0.
    "negative-moments": ({}, negative),
    "another-body": ({"scene": TOP}, put("scene", "coefficients", 0, 0.4)),
    "another-start": ({"first": lambda omega, waves, r: ([x + 9 for x in omega], waves, r)}, dict),
    "waves-exchanged": ({"first": lambda omega, waves, r: (omega, waves[::-1], r)}, dict),
    "ball-of-no-radius": ({"first": lambda omega, waves, r: (omega, waves, 0)}, dict),
    # From step to step.
    "time-stays": ({"after": lambda omega, waves, r, t, h: (omega, waves, r, 0)}, dict),
    "radius-not-passed": ({"after": lambda omega, waves, r, t, h: (omega, waves, 0, t + h)}, dict),
    "radius-lost": ({"after": lambda w, q, r, t, h: (w, q, 0, t + h)}, put("steps", 2, 2, 9)),
    "step-of-no-radius": ({}, put("steps", 1, 2, 0)),
    "last-step-false": ({}, without_last_step),
    "last-terms-omitted": ({"end": lambda series: [sum(x[:-1]) for x in series]}, dict),
    "middle-moved": ({"moved": 9}, dict),
    "large-growth": ({"scene": STABLE, "length": 0.4, "tube": 3 << 100}, dict),
    "tube-too-narrow": ({"tube": 1}, dict),
    # Rows.
    "second-row-false": ({}, put("rows", 1, "radius", 0.0)),
    "radius-too-small": ({}, put("rows", 0, "radius", lambda x: x * 0.9)),
    "another-omega": ({}, put("rows", 0, "omega", 0, "99.0")),
    "row-too-far": ({"miss": 1}, dict),
    "row-in-no-step": ({}, put("rows", 2, "time", 99.0)),
    "row-at-another-time": ({"row": lambda number, h: (0.5 - number) * h}, dict),
    "row-after-its-step": ({"row": lambda n, h: (n + 1.5) * h, "place": Fraction(3, 2)}, dict),
    "row-before-its-step": ({"row": lambda n, h: (n - 0.5) * h, "place": Fraction(-1, 2)}, dict),
}
# Lines that only name values, or of which no weaker form runs.
EXEMPT = (
    "self.bits, self.clock, self.scales = bits, clock, scales", 'if "coefficients" in scene:',
    "self.frequencies = sorted(", "self.rows = []", "pushes = []", 'scene = certificate["scene"]',
    'return len(certificate["steps"])',
)  # fmt: skip


def entries() -> list[tuple[str, str, str]]:
    """Return each part of a line, the weaker one, and the name of a forgery or an empty text."""
    found, name, old = [], "", ""
    for line in Path(__file__).with_name("weaker_lines.txt").read_text().splitlines()[2:]:
        text = line[2:].replace("\\n", "\n")
        if line[0] == "=":
            name = text
        elif line[0] == "-":
            old = text
        else:
            found.append((old, text, name))
    return found


WEAKER = entries()


@pytest.mark.parametrize("trial", TRIALS, ids=range(len(TRIALS)))
def test_certificate_with_the_least_radii_is_accepted(trial: Record, tmp_path: Path) -> None:
    assert accepts(certificate_checker, forged(certificate_checker, **trial), tmp_path)


@pytest.mark.sampled
@pytest.mark.parametrize(("old", "new", "name"), WEAKER, ids=range(len(WEAKER)))
def test_weaker_line_accepts_a_certificate_that_is_refused(
    old: str, new: str, name: str, tmp_path: Path
) -> None:
    module = weaker(old, new)
    given, change = FORGERIES[name] if name else ({}, dict)
    for trial in [{"scene": WAVES, **given}] if name else TRIALS:
        try:
            record = change(forged(module, **trial))
        except Exception:  # no certificate of this scene is accepted
            continue
        if accepts(module, record, tmp_path) and not accepts(certificate_checker, record, tmp_path):
            return
    pytest.fail("the weaker line accepts no certificate that the checker refuses")


def test_every_line_with_a_part_of_the_proof_is_weakened() -> None:
    weakened = set()
    for old, _, _ in WEAKER:
        line = SOURCE[: SOURCE.index(old)].count("\n") + 1
        weakened |= set(range(line, line + old.count("\n") + 1))
    lines, left = SOURCE.splitlines(), set(EXEMPT)
    parts = [x for x in ast.parse(SOURCE).body if getattr(x, "name", "main") not in OTHERS]
    for node in itertools.chain(*map(ast.walk, parts)):
        if not isinstance(node, ast.stmt) or isinstance(node, NO_LINES) or is_text(node):
            continue
        inner = getattr(node, "body", None)
        last = inner[0].lineno - 1 if inner else node.end_lineno or node.lineno
        if not weakened & set(range(node.lineno, last + 1)):
            exempt = [each for each in EXEMPT if lines[node.lineno - 1].strip().startswith(each)]
            assert exempt, lines[node.lineno - 1]
            left -= {*exempt}
    assert not left
    assert {name for _, _, name in WEAKER} == {"", *FORGERIES}
