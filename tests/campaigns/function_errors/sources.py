"""Constants and straight-line routines of our Fortran and JavaScript sources, as Python objects."""

import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[3]
LANES = ROOT / "fortran/many/many_circular.f90"
WIDE = ROOT / "fortran/original/wide_functions.f90"
TWO_WORDS = ROOT / "fortran/modern/two_words.f90"
WORD_PAIRS = ROOT / "fortran/modern/word_pairs.f90"
JAVASCRIPT = ROOT / "web/programs/circular.js"

_LITERAL = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")


class Pair:
    """The sum of two numbers, `high` and `low`."""

    def __init__(self, high: Any, low: Any) -> None:
        """Store the two numbers."""
        self.high, self.low = high, low


def rounded(x: Fraction, digits: int) -> Fraction:
    """Return the number of `digits` bits that is nearest to x; of two such numbers, the even one.

    The exponent has no limit.
    """
    if not x:
        return x
    exponent = x.numerator.bit_length() - x.denominator.bit_length() - digits
    unit = Fraction(2) ** exponent
    while abs(x) >= unit * 2**digits:
        unit *= 2
    while abs(x) < unit * 2 ** (digits - 1):
        unit /= 2
    return round(x / unit) * unit


def fortran_lines(text: str) -> list[str]:
    """Return the statements of a Fortran source without comments; continued lines are joined."""
    found: list[str] = []
    continued = False
    for raw in text.splitlines():
        line = raw.split("!")[0].strip()
        if not line:
            continue
        if continued:
            found[-1] += " " + line.removeprefix("&").strip()
        else:
            found.append(line)
        continued = found[-1].endswith("&")
        found[-1] = found[-1].removesuffix("&").strip()
    return found


def fortran_numbers(text: str, name: str, digits: int) -> list[Fraction]:
    """Return the value, or the values, of a constant, each literal rounded to `digits` bits."""
    start = re.compile(rf".*parameter.*::\s*{name}(\([\d:]+\))?\s*=\s*(.*)")
    for line in fortran_lines(text):
        if match := start.fullmatch(line):
            literals = re.sub(r"_(dp|wp)\b", "", match[2])
            if "*" in literals:
                return [Fraction(eval(literals, {}))]
            return [rounded(Fraction(each), digits) for each in _LITERAL.findall(literals)]
    raise LookupError(f"no constant {name}")


def javascript_numbers(text: str, name: str) -> list[Fraction]:
    """Return the value, or the values, of a constant of a JavaScript source."""
    match = re.search(rf"^const {name} = ([^;]*);", text, re.MULTILINE)
    if not match:
        raise LookupError(f"no constant {name}")
    if "**" in match[1]:
        base, power = (int(part) for part in match[1].split("**"))
        return [Fraction(base) ** power]
    return [Fraction(float(each)) for each in _LITERAL.findall(match[1])]


def expressions(text: str, routine: str, last: str) -> list[tuple[str, str]]:
    """Return the assignments of a routine up to the one of `last`: names and Python code."""
    found = []
    for line in _body(text, routine)[1]:
        name, value = line.split(" = ", 1)
        found.append((name, _as_python(value)))
        if name == last:
            break
    return found


def _as_python(expression: str) -> str:
    expression = re.sub(r"_(dp|wp)\b", "", expression).replace("%", ".")
    return re.sub(r"(?<![\w.])(\d+\.\d+(?:e[-+]?\d+)?)", r"number('\1')", expression)


def _body(text: str, routine: str) -> tuple[list[str], list[str]]:
    """Return the declarations and the assignments and calls of a routine."""
    lines = fortran_lines(text)
    head = re.compile(rf"(?:\S+ )*(subroutine|function) {routine}\(.*")
    begin = next(n for n, line in enumerate(lines) if head.fullmatch(line))
    kind = "end function" if "function " in lines[begin] else "end subroutine"
    end = next(n for n in range(begin, len(lines)) if lines[n].startswith(kind))
    inside = lines[begin + 1 : end]
    declarations = [lines[begin]] + [line for line in inside if "::" in line]
    return declarations, [line for line in inside if " = " in line or line.startswith("call ")]


def translate(text: str, routine: str, known: dict[str, Any]) -> Callable[..., Any]:
    """Return a straight-line Fortran routine as a Python function, and add it to `known`.

    `known` has the functions and constants that the routine uses. The arguments may be any objects
    with the operators of arithmetic. Outputs of a subroutine are the results of the function.
    """
    declarations, statements = _body(text, routine)
    head = declarations[0]
    found = re.search(rf"{routine}\(([^)]*)\)(?: result\((\w+)\))?", head)
    assert found
    arguments = [name.strip() for name in found[1].split(",")]
    inputs = arguments
    result = found[2]
    begin = []
    arrays: set[str] = set()
    for line in declarations[1:]:
        kind, names = line.split("::")
        each = re.findall(r"(\w+)(\(\d\))?", names)
        arrays |= {name for name, size in each if size}
        if "intent(out)" in kind:
            inputs = [name for name in inputs if name not in {other for other, _ in each}]
            result = ", ".join(name for name in arguments if name not in inputs)
        if "pair_t" in kind and "intent" not in kind:
            begin += [f"{name} = pair_t(None, None)" for name, _ in each]
        begin += [f"{name} = [None]*3" for name, size in each if size and "intent" not in kind]
    if "type(pair_t) function" in head:
        begin.append(f"{result} = pair_t(None, None)")
    lines = begin + [_statement(line, known) for line in statements]
    body = "\n".join(f"    {_indexed(line, arrays)}" for line in lines)
    source = f"def {routine}({', '.join(inputs)}):\n{body}\n    return {result}\n"
    exec(compile(source, routine, "exec"), known)
    known.setdefault("inputs", {})[routine] = len(inputs)
    function: Callable[..., Any] = known[routine]
    return function


def _statement(line: str, known: dict[str, Any]) -> str:
    call = re.fullmatch(r"call (\w+)\((.*)\)", line)
    if call:
        arguments = [part.strip() for part in re.split(r",(?![^(]*\))", call[2])]
        n = known["inputs"][call[1]]
        line = f"{', '.join(arguments[n:])} = {call[1]}({', '.join(arguments[:n])})"
    return _as_python(line)


def _indexed(line: str, arrays: set[str]) -> str:
    for name in arrays:
        line = re.sub(rf"\b({name})\((\d)\)", lambda m: f"{m[1]}[{int(m[2]) - 1}]", line)
    return line
