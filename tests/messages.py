"""`python -m tests.messages`: write `messages.txt`, which lists every error message for users.

The list has all messages side by side, so that they can be read as a whole. A test compares it with
the sources, so that a new message is read beside the others.
"""

import ast
import contextlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
CATALOGUE = ROOT / "tests" / "messages.txt"
_ERRORS = (
    "InputError", "NotBuiltError", "TimedError", "WorkLimitError", "ImpossibleBodyWarning",
    "unknown",
)  # fmt: skip
_CALL = re.compile(rf"(?<!class )(?<!def )(?<![\w`])(?P<begin>(?:{'|'.join(_ERRORS)})\()")
_CONSTANT = re.compile(r'(?m)^(?P<name>[A-Z_][A-Z0-9_]*) = (?P<begin>(?:\(\s*)?f?")')


def catalogue() -> str:
    """Return one line for each message: its file and its text, with expressions in braces."""
    lines = {
        f"{path.relative_to(ROOT / 'pyharness')}: {message}"
        for path, text in _texts().items()
        for message in _messages(text)
    }
    return "".join(f"{line}\n" for line in sorted(lines))


def _messages(text: str) -> Iterator[str]:
    constants: dict[str, ast.expr] = {}
    for _, call in _expressions(text, _CALL):
        if not (isinstance(call, ast.Call) and call.args):
            continue
        constants = constants or {**_constants(), **_of_module(text)}
        if isinstance(call.func, ast.Name) and call.func.id == "unknown":
            what, name, allowed, *where = (_text(each, constants) for each in call.args)
            place = "".join(f"{each}: " for each in where)
            yield f"{place}unknown {what} '{name}'; allowed: {allowed}"
            continue
        message = _text(call.args[0], constants)
        # A message that another function composed is listed where it is composed.
        if not (message.startswith("{") and message.endswith("}") and message.count("{") == 1):
            yield message


def _expressions(text: str, pattern: re.Pattern[str]) -> Iterator[tuple[re.Match[str], ast.expr]]:
    """Yield matches of a pattern and the expressions there; to parse all files takes long."""
    for match in pattern.finditer(text):
        begin = match.start("begin")
        for end in re.finditer(r"[)\"]", text[begin:]):
            with contextlib.suppress(SyntaxError):
                yield match, ast.parse(text[begin : begin + end.end()], mode="eval").body
                break


def _text(node: ast.expr, constants: dict[str, ast.expr]) -> str:
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(each, constants) for each in node.values)
    if isinstance(node, ast.FormattedValue):
        return _text(node.value, constants)
    if isinstance(node, ast.BinOp) and _is_text(node.left):
        return _text(node.left, constants) + _text(node.right, constants)
    if isinstance(node, ast.Name) and node.id in constants:
        return _text(constants[node.id], constants)
    return f"{{{ast.unparse(node)}}}"


def _is_text(node: ast.expr) -> bool:
    if isinstance(node, ast.BinOp):
        return _is_text(node.left)
    return isinstance(node, (ast.Constant, ast.JoinedStr))


@cache
def _texts() -> dict[Path, str]:
    return {path: path.read_text() for path in (ROOT / "pyharness").rglob("*.py")}


@cache
def _constants() -> dict[str, ast.expr]:
    """Return the texts that modules give to a name in capitals, which others may import."""
    return {name: each for text in _texts().values() for name, each in _of_module(text).items()}


def _of_module(text: str) -> dict[str, ast.expr]:
    return {match["name"]: each for match, each in _expressions(text, _CONSTANT) if _is_text(each)}


if __name__ == "__main__":
    CATALOGUE.write_text(catalogue())
