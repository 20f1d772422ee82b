"""`python -m tests.campaigns.integrator_campaign COUNT SEED`: judge wrong and right integrators.

COUNT wrong integrators of each kind are drawn. Their source is the guide's example, of order 4, or
the example with a method of order 2 or 1. It is changed by late numbers that are 0 or not finite,
by a wrong sign, a wrong index or a wrong quaternion. The right integrators are the example, two
with other signs of quaternions, and SciPy's RK45. The command prints a table of the faults that
are named, and the change of conserved quantities in COUNT scenes without torque. It returns exit
status 1 if a wrong integrator passes, a right one fails, a change is above its limit, or a fault
is named that an integrator does not have.
"""

import ast
import functools
import itertools
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any, Self
from unittest.mock import patch

from pyharness.checks.integrators import judging
from pyharness.checks.integrators.judging import Verdict, judge_integrator
from pyharness.checks.integrators.problem import Problem, problems
from pyharness.checks.integrators.recognition import FIRST_ORDER, UNKNOWN
from tests.campaigns import driver

FOLDER = Path(__file__).parents[2] / "docs/how-to/integrator"
KINDS = ("late", "sign", "index", "quaternion")
SOURCE = (FOLDER / "rk4.py").read_text().partition("for line in sys.stdin:")[0]
# Methods of other orders: the order, and the sum that is a step.
METHODS = (
    (4.0, "a + h / 6 * (p + 2 * q + 2 * r + s)"), (2.0, "a + h * q"), (1.0, "a + h * p"),
)  # fmt: skip
_INDICES = (("i1", "i2", "i3"), ("n1", "n2", "n3"), ("x", "y_", "z"), ("a", "b", "c", "d"))
_UNPACKED = "(i1, i2, i3), (n1, n2, n3) = "
_ROWS = "[y[3:] for y in rows]"
Solve = Callable[[dict[str, Any]], dict[str, Any]]


@dataclass(frozen=True)
class Drawn:
    """An integrator with a description of its change.

    `fault` is the name of its fault, or "unknown"; it is empty for a right integrator.
    """

    says: str
    solve: Solve
    fault: str
    order: float = 4.0


def _solve(source: str) -> Solve:
    names: dict[str, Any] = {}
    exec(compile(source, "<drawn>", "exec"), names)
    return names["solve"]  # type: ignore[no-any-return]


def _replaced(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def solve_of(*changes: tuple[str, str]) -> Solve:
    """Return the function of the example with changes of its source."""
    return _solve(_replaced(SOURCE, *changes))


def _late(random: Random, source: str) -> Drawn:
    value = random.choice((float("nan"), float("inf"), 0.0))
    fields = random.choice((["omega"], ["attitude"], ["omega", "attitude"]))
    time = 10.0 ** random.uniform(0.5, 2.6)
    solve = _solve(source)

    def late(asked: dict[str, Any]) -> dict[str, Any]:
        answer = solve(asked)
        for row, t in enumerate(asked["times"]):
            for field in fields if t > time else ():
                answer[field][row] = [value] * len(answer[field][row])
        return answer

    return Drawn(f"{value:g} in {' and '.join(fields)} after {time:.0f} s", late, UNKNOWN)


def _places(source: str, wanted: Callable[[ast.AST], bool]) -> list[tuple[ast.Module, Any]]:
    """Return a parsed source for each wanted node of the equations, together with the node."""
    found: list[tuple[ast.Module, Any]] = []
    while True:
        tree = ast.parse(source)
        equations = [
            each for each in tree.body
            if isinstance(each, ast.FunctionDef) and each.name in ("torque", "slopes")
        ]  # fmt: skip
        nodes = [node for each in equations for node in ast.walk(each) if wanted(node)]
        if len(found) == len(nodes):
            return found
        found.append((tree, nodes[len(found)]))


def _line(node: ast.AST) -> str:
    return SOURCE.split("\n")[node.lineno - 1].strip().rstrip(",")  # type: ignore[attr-defined]


def _sign(random: Random, source: str) -> Drawn:
    tree, node = random.choice(
        _places(
            source, lambda each: isinstance(getattr(each, "op", None), ast.Add | ast.Sub | ast.USub)
        )
    )
    says = f"a sign in {_line(node)}"
    fault = UNKNOWN
    for axis in range(3):
        if ast.unparse(node).startswith(f"n{axis + 1} + "):
            fault, says = f"gyroscopic-sign-{axis + 1}", f"the sign after n{axis + 1} in slopes"
    node.op = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.USub: ast.UAdd}[type(node.op)]()
    return Drawn(says, _solve(ast.unparse(tree)), fault)


def _index(random: Random, source: str) -> Drawn:
    if random.random() < 0.3:
        order = random.choice(list(itertools.permutations((1, 2, 3)))[1:])
        # Moment order[k] of the request must be the moment k + 1 of the equations.
        places = ", ".join(f"i{order.index(axis) + 1}" for axis in (1, 2, 3))
        name = f"moments-{''.join(map(str, order))}"
        text = _replaced(source, (_UNPACKED, _UNPACKED.replace("i1, i2, i3", places)))
        return Drawn(f"moments in the order {order}", _solve(text), name)
    groups = {name: group for group in _INDICES for name in group}
    tree, node = random.choice([
        (tree, node)
        for tree, node in _places(
            source, lambda each: isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load)
        )
        if node.id in groups and _line(node)[0] in "(0"
    ])  # fmt: skip
    new = random.choice([name for name in groups[node.id] if name != node.id])
    says = f"{new} for {node.id} in {_line(node)}"
    node.id = new
    return Drawn(says, _solve(ast.unparse(tree)), UNKNOWN)


_QUATERNIONS = (
    ("the initial attitude ignored", "attitude-from-identity",
     ('asked["omega"] + asked["attitude"]', 'asked["omega"] + [1.0, 0.0, 0.0, 0.0]')),
    ("no factor 1/2", "attitude-rate", ("        0.5 * (", "        (")),
    ("omega about the axes of space", "attitude-frame",
     ("c * z - d * y_", "d * y_ - c * z"), ("d * x - b * z", "b * z - d * x"),
     ("b * y_ - c * x", "c * x - b * y_")),
    ("half the rate", UNKNOWN, ("        0.5 * (", "        0.25 * (")),
    ("twice the norm", UNKNOWN, (_ROWS, "[[2.0 * x for x in y[3:]] for y in rows]")),
)  # fmt: skip


def _quaternion(random: Random, source: str) -> Drawn:
    # Also the right output, the conjugate, and the scalar as the last component.
    if random.random() < 0.4:
        says, fault, *pairs = random.choice(_QUATERNIONS)
        return Drawn(says, _solve(_replaced(source, *pairs)), fault)
    order = random.choice([(0, 1, 2, 3), (1, 2, 3, 0), random.sample(range(4), 4)])
    signs = random.choice([(1, 1, 1, 1), (1, -1, -1, -1), random.choices((-1, 1), k=4)])
    row = ", ".join(f"{sign * signs[0]} * y[{3 + k}]" for sign, k in zip(signs, order, strict=True))
    if row == _OUTPUTS[0]:
        return _quaternion(random, source)
    names = dict(zip(_OUTPUTS[1:], ("quaternion-transposed", "scalar-last"), strict=True))
    text = _replaced(source, (_ROWS, f"[[{row}] for y in rows]"))
    return Drawn(f"quaternion [{row}]", _solve(text), names.get(row, UNKNOWN))


_OUTPUTS = (
    "1 * y[3], 1 * y[4], 1 * y[5], 1 * y[6]",
    "1 * y[3], -1 * y[4], -1 * y[5], -1 * y[6]",
    "1 * y[4], 1 * y[5], 1 * y[6], 1 * y[3]",
)

_DRAW = {"late": _late, "sign": _sign, "index": _index, "quaternion": _quaternion}


def right(seed: str) -> Iterator[Drawn]:
    """Yield four right integrators."""
    random = Random(f"{seed}/right")
    solve = _solve(SOURCE)

    def signed(sign: Callable[[list[float]], float]) -> Solve:
        def answer(asked: dict[str, Any]) -> dict[str, Any]:
            found = solve(asked)
            pairs = [(sign(q), q) for q in found["attitude"]]
            return {**found, "attitude": [[s * x for x in q] for s, q in pairs]}

        return answer

    yield Drawn("the example", solve, "")
    yield Drawn("random signs of quaternions", signed(lambda q: random.choice((-1.0, 1.0))), "")
    yield Drawn("positive scalars", signed(lambda q: -1.0 if q[0] < 0.0 else 1.0), "")
    text = (FOLDER / "scipy_ivp.py").read_text().partition("name, *fixed =")[0]
    names: dict[str, Any] = {}
    exec(compile(text, "<scipy>", "exec"), names)

    def scipy(asked: dict[str, Any]) -> dict[str, Any]:
        rows, control = names["by_tolerance"](asked, "RK45")
        found = {"omega": rows[:, :3].tolist(), "attitude": rows[:, 3:].tolist()}
        return {**found, "control": control}

    yield Drawn("RK45 of SciPy", scipy, "", 1.0)


def drawn(kind: str, seed: str, number: int) -> Drawn:
    """Return wrong integrator `number` of a kind in `KINDS`."""
    random = Random(f"{seed}/{kind}/{number}")
    # The long motion of a method of order 1 is short, or has no limit.
    order, step = random.choice(METHODS[:2] if kind == "late" else METHODS)
    found = _DRAW[kind](random, _replaced(SOURCE, (METHODS[0][1], step)))
    return replace(found, says=f"order {order:g}: {found.says}", order=order)


class _InProcess:
    """A function in place of the process of an integrator."""

    def __init__(self, solve: Solve) -> None:
        self._solve = solve

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def ask(self, line: bytes) -> bytes:
        """Return the answer to a request, with numbers as text."""
        return json.dumps(_texts(self._solve(json.loads(line)))).encode()


def _texts(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _texts(each) for name, each in value.items()}
    if isinstance(value, list):
        return [*map(_texts, value)]
    return repr(value) if isinstance(value, float) else value


def judged(each: Drawn, chosen: Sequence[Problem]) -> Verdict:
    """Return the results of the checks of an integrator in the chosen scenes."""
    with patch.object(judging, "PortProcess", lambda *options: _InProcess(each.solve)):
        return judge_integrator(each.says, chosen, lambda name: "", each.order)


def named(found: Verdict) -> set[str]:
    """Return the names of the faults that are found."""
    return {finding.name for finding in found.findings}


def is_right(each: Drawn, found: Verdict) -> bool:
    """Return whether the verdict is right, and no wrong fault is named."""
    passed = all(check.passed for check in found.checks)
    if not each.fault:
        return passed and not found.findings
    names = named(found) - (FIRST_ORDER.keys() if each.order == 1.0 else set())
    # The line about an invalid answer, as about a quaternion of 0, is in place of a name.
    return not passed and names <= {each.fault, UNKNOWN} and bool(names or not found.judged)


def _bare(solve: Solve) -> Solve:
    return lambda asked: {"omega": solve(asked)["omega"]}


def try_scene(tally: driver.Tally) -> None:
    """Judge one wrong integrator of each kind, and right methods of three orders.

    With the first number the right integrators are judged too.
    """
    chosen = _problems(tally.seed)
    rows = [(kind, drawn(kind, tally.seed, tally.number)) for kind in KINDS]
    rows += [("right", each) for each in right(tally.seed) if tally.number == 0]
    for kind, each in rows:
        found = judged(each, chosen)
        names = ", ".join(sorted(named(found))) or "none"
        tally.counts[f"{kind}: named {names}"] += 1
        if not is_right(each, found):
            tally.fault(f"{kind}, {each.says}, fault {each.fault or 'none'}, named {names}")
    # Methods of three orders, with and without attitude, in a scene without torque.
    free = problems(f"{tally.seed}/{tally.number}", 1, ["free"])
    for order, step in METHODS:
        solve = solve_of((METHODS[0][1], step))
        for answer in (solve, _bare(solve)):
            checks = judged(Drawn("", answer, "", order), free).checks
            (check,) = (each for each in checks if each.name.subject == "conserved")
            if check.limit is not None and check.value is not None:
                tally.judge("change of a conserved quantity", check.value, check.limit)


@functools.cache
def _problems(seed: str) -> Sequence[Problem]:
    return problems(seed, 1)


if __name__ == "__main__":
    sys.exit(driver.run("tests.campaigns.integrator_campaign", try_scene, sys.argv[1:]))
