"""Single changes to Fortran, C and JavaScript: operators on their text, line by line."""

import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import PurePosixPath

# A function, and the function that replaces it.
PAIRS = {
    "min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "minval": "maxval",
    "maxval": "minval", "minloc": "maxloc", "maxloc": "minloc", "argmin": "argmax",
    "argmax": "argmin", "fmin": "fmax", "fmax": "fmin", "floor": "ceil", "ceil": "floor",
    "ceiling": "floor", "sin": "cos", "cos": "sin", "sine": "cosine", "cosine": "sine",
    "any": "all", "all": "any", "iand": "ior", "ior": "iand", "isnan": "isinf", "isinf": "isnan",
    "sum": "max", "hypot": "min", "sqrt": "abs",
}  # fmt: skip
FORTRAN, C, JAVASCRIPT = "Fortran", "C", "JavaScript"
_LANGUAGES = {".f90": FORTRAN, ".fypp": FORTRAN, ".c": C, ".js": JAVASCRIPT}
_STRINGS = r"\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*'"
_NOT_CODE = {
    FORTRAN: re.compile(r"\"[^\"\n]*\"|'[^'\n]*'|!.*|^[ \t]*#.*", re.M),
    C: re.compile(rf"{_STRINGS}|//.*|/\*[\s\S]*?\*/|^[ \t]*#(?:.*\\\n)*.*", re.M),
    JAVASCRIPT: re.compile(rf"{_STRINGS}|`[^`]*`|//.*|/\*[\s\S]*?\*/", re.M),
}
# Declarations, and lines that only divide the text.
_NO_STATEMENT = {
    FORTRAN: re.compile(
        r"\s*&?\s*(use|implicit|private|public|import|end|contains|module|submodule|interface|type|"
        r"class|pure|impure|elemental|recursive|subroutine|function|program|procedure|generic|"
        r"else$|select|case|do$|(real|integer|logical|character|complex)\b(?!.*=))\b",
        re.I,
    ),
    C: re.compile(r"\s*(static|extern|typedef|struct|enum|goto|case|default|\}|PyObject \*\w+;)"),
    JAVASCRIPT: re.compile(r"\s*(import|case|default|\}$)"),
}
_DECLARES = re.compile(r"(const|let|var|double|int|size_t|Py_ssize_t|char|void|long|return) ")


def constant(text: str) -> str:
    """Return ten times a number that has an exponent, 1.01 times any other; 1 beyond the range."""
    number = float(text.lower().replace("d", "e").replace("_", ""))
    factor = 10.0 if "e" in text.lower() or "d" in text.lower() else 1.01
    return repr(1.0 if number * factor == float("inf") else number * factor or 0.01)


def language_of(file: str) -> str:
    return _LANGUAGES.get(PurePosixPath(file).suffix, "Python")


def blanked(text: str, language: str) -> str:
    """Return the text with its comments and strings blanked."""
    return _NOT_CODE[language].sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)


def changes(text: str, language: str) -> Iterator[tuple[int, str, Callable[[], str]]]:
    """Yield the changes of a file in order: the line, the operator, the new text."""
    lines = text.split("\n")
    plain = blanked(text, language).split("\n")
    for i, line in enumerate(plain):
        if not line.strip() or _NO_STATEMENT[language].match(line):
            continue
        begin = line.find("::") + 2 if "::" in line and language == FORTRAN else 0
        for operator, start, end, new in _of_line(line, language):
            if start >= begin:
                whole = lines[i][:start] + new + lines[i][end:]
                yield i + 1, operator, _joined(lines, i, i + 1, whole)
        last = _statement_end(plain, i, language)
        if last is not None:
            empty = {FORTRAN: "continue", C: ";", JAVASCRIPT: ";"}[language]
            indent = line[: len(line) - len(line.lstrip())]
            yield i + 1, "dropped statement", _joined(lines, i, last, indent + empty)


def _joined(lines: list[str], begin: int, end: int, new: str) -> Callable[[], str]:
    return lambda: "\n".join([*lines[:begin], new, *[""] * (end - begin - 1), *lines[end:]])


def _statement_end(plain: list[str], i: int, language: str) -> int | None:
    """Return the line after a statement that begins in line i and can be dropped, else None."""
    line = plain[i].strip()
    if language == FORTRAN:
        if i and plain[i - 1].rstrip().endswith("&"):
            return None
        guarded = re.sub(r"^if \(.*?\) (?=call |\w+ = |return|exit|cycle)", "", line)
        is_step = re.match(r"call \w|[\w%]+(\([^=]*\))?(%\w+(\([^=]*\))?)* = ", guarded)
        if not is_step and (guarded == line or not re.match(r"return|exit|cycle", guarded)):
            return None
        while plain[i].rstrip().endswith("&"):
            i += 1
        return i + 1
    before = plain[i - 1].strip() if i else ""
    if not before.endswith((";", "{", "}")) and before:
        return None
    is_update = re.match(r"[\w.>\[\]\s*+-]+\s[-+*/|&^]?= |[\w.]+\(|if \(.*\) [^{]*;$", line)
    return i + 1 if line.endswith(";") and is_update and not _DECLARES.match(line) else None


_OPERAND = r"[A-Za-z_][\w%.]*(?:\([^()]*\)|\[[^\[\]]*\])*"
_OTHER = {
    "+": "-", "-": "+", "*": "/", "/": "*", "<": "<=", "<=": "<", ">": ">=", ">=": ">",
    "==": "!=", "!=": "==", "===": "!==", "!==": "===", ".and.": ".or.", ".or.": ".and.",
    "&&": "||", "||": "&&", ".true.": ".false.", ".false.": ".true.", "true": "false",
    "false": "true", **PAIRS,
}  # fmt: skip
_REAL = r"(?<![\w.])(?:\d+\.\d*(?:[eEdD][+-]?\d+)?|\d+[eEdD][+-]?\d+)"
# An operator, the passage it changes, and the new text or a function that makes it.
_TOKENS: list[tuple[str, re.Pattern[str], Callable[[str], str]]] = [
    (operator, re.compile(pattern), new)
    for operator, pattern, new in (
        ("sign", r"(?<=[\w)\]}$] )[+-](?= \S)", _OTHER.__getitem__),
        ("sign", r"(?:(?<=[=(,\[?:&])|(?<=[=(,\[?:&] ))-(?=[\w(])", lambda _: ""),
        (
            "product",
            r"(?:(?<=[\w)\]])|(?<=[\w)\]] ))[*/](?![*/=)])(?= ?[\w($])",
            _OTHER.__getitem__,
        ),
        ("bound", r"(?<![<>=!/-])(?:<=|>=|<|>)(?![<>=])", _OTHER.__getitem__),
        ("constant", _REAL, lambda text: constant(text)),
        ("constant", r"(?<![\w.$%])\d+(?![\w.$])", lambda text: str(int(text) + 1)),
        ("logical", r"\.and\.|\.or\.|&&|\|\||\.true\.|\.false\.", _OTHER.__getitem__),
        ("logical", r"(?<![.\w])(?:true|false)(?![.\w])", _OTHER.__getitem__),
        ("logical", r"\.not\. ?|(?<![\w!])!(?=[\w(])", lambda _: ""),
        ("min/max", rf"\b(?:{'|'.join(PAIRS)})(?=\()", _OTHER.__getitem__),
    )
]
_EQUALITY = {
    FORTRAN: re.compile(r"==|/=(?= )"),
    C: re.compile(r"[=!]="),
    JAVASCRIPT: re.compile(r"[=!]==?"),
}
_DIFFERENCE = re.compile(rf"(?<![\w.%*])(?=({_OPERAND})( - |/| / )({_OPERAND}))")
_IF = re.compile(r"\s*(?:(?:\} else |else )?if|while) (?=\()")
_LOOP = re.compile(r"\s*(?:\w+: )?do \w+ = [^,]+, ([^,&]+?)\s*$")
_NO_CALL = re.compile(r"\b(if|for|while|switch|real|integer|character|do)\($")

Piece = tuple[str, int, int, str]  # the operator, begin and end in the line, the new text


def _of_line(line: str, language: str) -> Iterator[Piece]:
    for operator, pattern, new in _TOKENS:
        yield from ((operator, *each.span(), new(each[0])) for each in pattern.finditer(line))
    for each in _EQUALITY[language].finditer(line):
        other = {"==": "/=", "/=": "=="} if language == FORTRAN else _OTHER
        yield "equality", *each.span(), other[each[0]]
    for each in _DIFFERENCE.finditer(line):
        yield "order of operands", each.start(1), each.end(3), each[3] + each[2] + each[1]
    for begin, end in _calls(line):
        for (a, b), (c, d) in pairwise(_split(line, begin, end)):
            if "=" not in line[a:b] + line[c:d] and line[a:b] != line[c:d]:
                yield "swapped arguments", a, d, line[c:d] + line[b:c] + line[a:b]
    if (found := _IF.match(line)) and (last := _closing(line, found.end())):
        negation = ".not. " if language == FORTRAN else "!"
        yield "condition", found.end(), last, f"({negation}{line[found.end() : last]})"
    if language == FORTRAN and (found := _LOOP.match(line)):
        yield "index", found.end(1), found.end(1), " - 1"


def _closing(line: str, begin: int) -> int | None:
    """Return the place after the parenthesis that closes the one at `begin`."""
    depth = 0
    for i in range(begin, len(line)):
        depth += (line[i] in "([") - (line[i] in ")]")
        if depth == 0:
            return i + 1
    return None


def _calls(line: str) -> Iterator[tuple[int, int]]:
    """Yield where the arguments of calls, or the indices of arrays, begin and end."""
    for found in re.finditer(r"(?<=\w)\((?=.)", line):
        last = _closing(line, found.start())
        if last and not _NO_CALL.search(line[: found.end()]):
            yield found.end(), last - 1


def _split(line: str, begin: int, end: int) -> list[tuple[int, int]]:
    """Return where the arguments between two places begin and end."""
    found, depth, start = [], 0, begin
    for i in range(begin, end + 1):
        if i == end or (line[i] == "," and depth == 0):
            stripped = line[start:i].strip()
            if stripped:
                at = line.index(stripped, start)
                found.append((at, at + len(stripped)))
            start = i + 1
        else:
            depth += (line[i] in "([{") - (line[i] in ")]}")
    return found
