"""`python -m tests.messages`: write `messages.txt`, which lists every error message for users.

The list has all messages side by side, so that they can be read as a whole. A test compares it with
the sources, so that a new message is read beside the others.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
CATALOGUE = ROOT / "tests" / "messages.txt"
_ERRORS = ("InputError", "NotBuiltError", "TimedError", "ImpossibleBodyWarning", "unknown")


def catalogue() -> str:
    """Return one line for each message: its file and its text, with expressions in braces."""
    lines = {
        f"{path.relative_to(ROOT / 'pyharness')}: {message}"
        for path, tree in _trees().items()
        for message in _messages(tree, {**_constants(), **_of_module(tree)})
    }
    return "".join(f"{line}\n" for line in sorted(lines))


def _messages(tree: ast.Module, constants: dict[str, ast.expr]) -> Iterator[str]:
    for node in ast.walk(tree):
        name = getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""
        if isinstance(node, ast.Call) and name in _ERRORS and node.args:
            if name == "unknown":
                what, name, allowed, *where = (_text(each, constants) for each in node.args)
                place = "".join(f"{each}: " for each in where)
                yield f"{place}unknown {what} '{name}'; allowed: {allowed}"
                continue
            text = _text(node.args[0], constants)
            # A message that another function composed is listed where it is composed.
            if not (text.startswith("{") and text.endswith("}") and text.count("{") == 1):
                yield text


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
def _trees() -> dict[Path, ast.Module]:
    texts = {path: path.read_text() for path in (ROOT / "pyharness").rglob("*.py")}
    # Most files have neither a message nor a text with a name in capitals.
    kept = re.compile(rf"(?m)\b({'|'.join(_ERRORS)})\(|^[A-Z_]+ = [f(\"]")
    return {path: ast.parse(text) for path, text in texts.items() if kept.search(text)}


@cache
def _constants() -> dict[str, ast.expr]:
    """Return the texts that modules give to a name in capitals, which others may import."""
    return {name: text for tree in _trees().values() for name, text in _of_module(tree).items()}


def _of_module(tree: ast.Module) -> dict[str, ast.expr]:
    return {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
        and target.id.isupper()
        and isinstance(node.value, (ast.Constant, ast.JoinedStr))
        and not (isinstance(node.value, ast.Constant) and not isinstance(node.value.value, str))
    }


if __name__ == "__main__":
    CATALOGUE.write_text(catalogue())
