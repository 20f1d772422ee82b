"""Single changes to Fortran, C and JavaScript: operators on their text, line by line."""

import re
from collections.abc import Callable, Iterator
from pathlib import PurePosixPath

PAIRS = {
    a: b
    for pair in (
        "min max", "floor ceil", "floor ceiling", "sin cos", "any all", "minimum maximum",
        "argmin argmax", "minval maxval", "minloc maxloc", "iand ior", "fmin fmax", "sine cosine",
        "isnan isinf", "fmin fmax", "sum max", "hypot min", "sqrt abs",
    )
    for a, b in (pair.split(), pair.split()[::-1])
    if a not in ("max", "abs") or (a, b) == ("max", "min")
}  # fmt: skip
FORTRAN, C, JAVASCRIPT = "Fortran", "C", "JavaScript"
_LANGUAGES = {".f90": FORTRAN, ".fypp": FORTRAN, ".c": C, ".js": JAVASCRIPT}
_STRINGS = r"\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*'"
_NOT_CODE = {
    FORTRAN: re.compile(r"\"[^\"\n]*\"|'[^'\n]*'|!.*|^\s*#.*", re.M),
    C: re.compile(rf"{_STRINGS}|//.*|/\*.*?\*/|^\s*#(?:.*\\\n)*.*", re.M | re.S),
    JAVASCRIPT: re.compile(rf"{_STRINGS}|`[^`]*`|//[^\n]*|/\*.*?\*/", re.M | re.S),
}
_NOT_CODE[C] = re.compile(rf"{_STRINGS}|//[^\n]*|/\*[\s\S]*?\*/|^\s*#(?:[^\n]*\\\n)*[^\n]*", re.M)
# Declarations, and what only divides the text.
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
_REAL = re.compile(r"(?<![\w.])\d+\.\d*(?:[ed][+-]?\d+)?|(?<![\w.])\d+[ed][+-]?\d+", re.I)
_OPERAND = r"[A-Za-z_][\w%.]*(?:\([^()]*\)|\[[^\[\]]*\])*"
_EQUAL = {"==": "!=", "!=": "==", "===": "!==", "!==": "==="}


def constant(text: str) -> str:
    """Return another number: ten times a limit, written as a power of ten; else a hundredth more."""
    number = float(text.lower().replace("d", "e").replace("_", ""))
    factor = 10.0 if "e" in text.lower() or "d" in text.lower() else 1.01
    return repr(number * factor if number else 0.01)


def language_of(file: str) -> str:
    """Return the language of a file by its ending."""
    return _LANGUAGES.get(PurePosixPath(file).suffix, "Python")


def blanked(text: str, language: str) -> str:
    """Return the text with blanks for its comments and strings."""
    return _NOT_CODE[language].sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)


def changes(text: str, language: str) -> Iterator[tuple[int, str, Callable[[], str]]]:
    """Return the changes of a file in its order: the line, the operator, the new text."""
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
    """Return the line after a statement that can be dropped, and that begins in line i."""
    line = plain[i].strip()
    if language == FORTRAN:
        if i and plain[i - 1].rstrip().endswith("&"):
            return None
        guarded = re.sub(r"^if \(.*?\) (?=call |\w+ = |return|exit|cycle)", "", line)
        if not re.match(r"call \w|[\w%]+(\([^=]*\))?(%\w+(\([^=]*\))?)* = ", guarded):
            if guarded == line or not re.match(r"return|exit|cycle", guarded):
                return None
        while plain[i].rstrip().endswith("&"):
            i += 1
        return i + 1
    before = plain[i - 1].strip() if i else ""
    if not before.endswith((";", "{", "}")) and before:
        return None
    is_update = re.match(r"[\w.>\[\]\s*+-]+\s[-+*/|&^]?= |[\w.]+\(|if \(.*\) [^{]*;$", line)
    declares = re.match(r"(const|let|var|double|int|size_t|Py_ssize_t|char|void|long|return) ", line)
    return i + 1 if line.endswith(";") and is_update and not declares else None


def _of_line(line: str, language: str) -> Iterator[tuple[str, int, int, str]]:
    for found in re.finditer(r"(?<=[\w)\]}$]) ([+-])(?= \S)", line):
        yield "sign", found.start(1), found.end(1), "-" if found[1] == "+" else "+"
    for found in re.finditer(r"(?<=[=(,\[?:&]) ?(-)(?=[\w(])", line):
        yield "sign", found.start(1), found.end(1), ""
    for found in re.finditer(r"(?<=[\w)\]]) ?(?<!\*)([*/])(?![*/=)]) ?(?=[\w($])", line):
        yield "product", found.start(1), found.end(1), "*" if found[1] == "/" else "/"
    for found in re.finditer(r"(?<![<>=!/-])(<=|>=|<|>)(?![<>=])", line):
        yield "bound", found.start(), found.end(), found[1][0] if "=" in found[1] else found[1] + "="
    for found in re.finditer(r"[=!]==?|/=(?= )", line):
        if language == FORTRAN and found[0] in ("==", "/="):
            yield "equality", found.start(), found.end(), "/=" if found[0] == "==" else "=="
        elif found[0] in _EQUAL and language != FORTRAN:
            yield "equality", found.start(), found.end(), _EQUAL[found[0]]
    for found in re.finditer(rf"(?<![\w.%*])(?=({_OPERAND})( - |/| / )({_OPERAND}))", line):
        swapped = f"{found[3]}{found[2]}{found[1]}"
        yield "order of operands", found.start(1), found.end(3), swapped
    for found in _REAL.finditer(line):
        yield "constant", found.start(), found.end(), constant(found[0])
    for found in re.finditer(r"(?<![\w.$%])\d+(?![\w.$]|\.)", line):
        yield "constant", found.start(), found.end(), str(int(found[0]) + 1)
    for old, new in ((".and.", ".or."), ("&&", "||"), (".true.", ".false."), ("true", "false")):
        for a, b in ((old, new), (new, old)):
            pattern = re.escape(a) if "." in a or "&" in a or "|" in a else rf"(?<![.\w]){a}(?![.\w])"
            for found in re.finditer(pattern, line):
                yield "logical", found.start(), found.end(), b
    for found in re.finditer(r"\.not\. ?|(?<![\w!])!(?=[\w(])", line):
        yield "logical", found.start(), found.end(), ""
    for found in re.finditer(r"\b([A-Za-z_]+)(?=\()", line):
        if found[1] in PAIRS:
            other = "ceil" if found[1] == "floor" and language != FORTRAN else PAIRS[found[1]]
            yield "min/max", found.start(), found.end(), other
    for begin, end in _calls(line):
        inside = _split(line, begin, end)
        for (a, b), (c, d) in zip(inside, inside[1:], strict=False):
            if "=" not in line[a:b] + line[c:d] and line[a:b] != line[c:d]:
                yield "swapped arguments", a, d, line[c:d] + line[b:c] + line[a:b]
    if found := re.match(r"\s*(?:\} else |else )?if (?=\()|\s*while (?=\()", line):
        if end := _closing(line, found.end()):
            not_ = ".not. " if language == FORTRAN else "!"
            inner = line[found.end() : end]
            yield "condition", found.end(), end, f"({not_}{inner})"
    if language == FORTRAN and (found := re.match(r"\s*(?:\w+: )?do \w+ = [^,]+, ([^,&]+?)\s*$", line)):
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
    for found in re.finditer(r"(?<=\w)\((?=.)", line):
        if not re.search(r"\b(if|for|while|switch|real|integer|character|do)\($", line[: found.end()]):
            if end := _closing(line, found.start()):
                yield found.end(), end - 1


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
