"""Single changes to Python: mutmut's operators, and some of our own, on libcst's nodes."""

import re
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import Any

import libcst as cst
from libcst.metadata import MetadataWrapper, PositionProvider
from mutmut.mutation.mutators import mutation_operators

from tests.campaigns.mutations.text_source import PAIRS, constant

# The line of the source, the operator, and a function that returns the whole changed text.
Change = tuple[int, str, Callable[[], str]]
# These nodes are not changed: annotations and texts for a type checker or a reader, imports, and
# messages of errors.
_LEFT_ALONE = (
    cst.Annotation, cst.Import, cst.ImportFrom, cst.Decorator, cst.FormattedString, cst.Raise,
    cst.TypeAlias, cst.ConcatenatedString, cst.Assert,
)  # fmt: skip
# A string that is a key or a name may decide something; all others are for readers.
_KEY = re.compile(r"[\"'][\w.-]+[\"']")
_MESSAGE = re.compile(r"\w*(Error|Refused|warn|progress|Note)")


def changes(text: str) -> Iterator[Change]:
    """Yield the changes of a file in order."""
    wrapper = MetadataWrapper(cst.parse_module(text), unsafe_skip_copy=True)
    lines = wrapper.resolve(PositionProvider)

    def replaced(old: cst.CSTNode, new: cst.CSTNode) -> Callable[[], str]:
        return lambda: cst.ensure_type(wrapper.module.deep_replace(old, new), cst.Module).code

    def visit(node: cst.CSTNode) -> Iterator[Change]:
        for operator, new in _of_node(node):
            yield lines[node].start.line, operator, replaced(node, new)
        if not isinstance(node, _LEFT_ALONE) and not _is_for_readers(node):
            for child in node.children:
                yield from visit(child)

    yield from sorted(visit(wrapper.module), key=lambda change: change[0])


def _is_for_readers(node: cst.CSTNode) -> bool:
    if isinstance(node, cst.Expr):
        return isinstance(node.value, cst.BaseString)
    if isinstance(node, cst.SimpleString):
        return _KEY.fullmatch(node.value) is None
    if isinstance(node, cst.If):
        return isinstance(node.test, cst.Name) and node.test.value == "TYPE_CHECKING"
    if isinstance(node, cst.Call):
        name = node.func.attr if isinstance(node.func, cst.Attribute) else node.func
        return isinstance(name, cst.Name) and _MESSAGE.fullmatch(name.value) is not None
    return False


def _of_node(node: cst.CSTNode) -> Iterator[tuple[str, cst.CSTNode]]:
    if not isinstance(node, _LEFT_ALONE) and not _is_for_readers(node):
        for kind, operator in mutation_operators:
            if isinstance(node, kind):
                name = operator.__name__.removeprefix("operator_").replace("_", " ")
                yield from ((f"mutmut {name}", new) for new in operator(node))
    for name, own in _OWN.items():
        yield from ((name, new) for new in own(node))


def _dropped(node: Any) -> Iterable[cst.CSTNode]:
    """Drop a call, an update or a refusal."""
    if isinstance(node, cst.SimpleStatementLine) and len(node.body) == 1:
        (statement,) = node.body
        is_call = isinstance(statement, cst.Expr) and isinstance(statement.value, cst.Call)
        if is_call or isinstance(statement, cst.AugAssign | cst.Raise):
            yield node.with_changes(body=[cst.Pass()])


def _swapped(node: Any) -> Iterable[cst.CSTNode]:
    """Swap two adjacent arguments."""
    if isinstance(node, cst.Call):
        for i, (a, b) in enumerate(pairwise(node.args)):
            if a.keyword is None and b.keyword is None and not a.star and not b.star:
                pair = [a.with_changes(value=b.value), b.with_changes(value=a.value)]
                yield node.with_changes(args=[*node.args[:i], *pair, *node.args[i + 2 :]])


def _order(node: Any) -> Iterable[cst.CSTNode]:
    """Swap the operands of a difference or a quotient."""
    ordered = cst.Subtract | cst.Divide | cst.FloorDivide | cst.Power
    if isinstance(node, cst.BinaryOperation) and isinstance(node.operator, ordered):
        yield node.with_changes(left=_enclosed(node.right), right=_enclosed(node.left))


def _enclosed(node: cst.BaseExpression) -> cst.BaseExpression:
    return node.with_changes(
        lpar=[cst.LeftParen(), *node.lpar], rpar=[*node.rpar, cst.RightParen()]
    )


def _constant(node: Any) -> Iterable[cst.CSTNode]:
    if isinstance(node, cst.Float):
        yield node.with_changes(value=constant(node.value))


def _condition(node: Any) -> Iterable[cst.CSTNode]:
    """Negate the condition."""
    if isinstance(node, cst.If | cst.While) and not _is_for_readers(node):
        yield node.with_changes(test=cst.UnaryOperation(cst.Not(), _enclosed(node.test)))


def _pair(node: Any) -> Iterable[cst.CSTNode]:
    if isinstance(node, cst.Call):
        name = node.func.attr if isinstance(node.func, cst.Attribute) else node.func
        if isinstance(name, cst.Name) and name.value in PAIRS:
            yield node.with_deep_changes(name, value=PAIRS[name.value])


_OWN = {
    "dropped statement": _dropped, "swapped arguments": _swapped, "order of operands": _order,
    "constant": _constant, "condition": _condition, "min/max": _pair,
}  # fmt: skip
