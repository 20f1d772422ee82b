"""Torques as three arithmetic expressions of time, omega and attitude, as in scene files.

Only permitted nodes of the syntax tree are evaluated.
"""

import ast
import itertools
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial, reduce
from keyword import iskeyword
from types import MappingProxyType
from typing import Any

from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.numpy_calls import ELEMENTARY
from pyharness.model.state_torque import StateTorque, law_of
from pyharness.model.symbols import Recorder, Symbol, negated, select
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import finite, number_list

# Names of the inputs of a tape, by slot.
INPUTS = ("t", "w1", "w2", "w3", "q0", "q1", "q2", "q3")
_OF_ONE = (
    "sqrt", "cbrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sinh", "cosh",
    "tanh", "abs", "sign", "floor", "heaviside",
)  # fmt: skip
# The number of arguments by name.
_COUNTS = dict.fromkeys(_OF_ONE, 1) | {"atan2": 2, "min": 2, "max": 2, "clip": 3, "where": 3}
FUNCTIONS = tuple(_COUNTS)
_LONGEST = 10_000
_DEEPEST = 500
_MOST_OPEN = 200  # the limit of Python's parser
_FOREIGN = re.compile(r"[^0-9A-Za-z_+\-*/%<>=()., \t\r\n]")
_NAME = re.compile(r"[A-Za-z_][0-9A-Za-z_]*")
_ALLOWED = (
    f"allowed: numbers, names, + - * / % ** and parentheses, {', '.join(FUNCTIONS)}; in where "
    "also < > <= >= and or not"
)
_THREE = "allowed: a list of three texts, as in ['-0.1*w1', '0', 'sin(t)']"
_SUM: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
}
_COMPARISONS: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.Gt: operator.gt,
    ast.LtE: operator.le,
    ast.GtE: operator.ge,
}


def parsed(
    expressions: object, constants: object, rates: Mapping[str, object] = MappingProxyType({})
) -> StateTorque | TorqueLaw:
    """Return the torque of three expressions about the body axes, if possible as a TorqueLaw.

    The unit is N m, or rad/s2 for a body with coefficients. `rates` has expressions for the
    derivatives of `Scene.states`.
    """
    values = _checked_constants(constants)
    texts = _three_texts(expressions)
    for name, text in rates.items():
        place = f"[states.{name}] rate"
        if name in (*INPUTS, "pi", *FUNCTIONS, *values):
            raise InputError(f"[states]: '{name}' has another meaning in expressions already")
        texts[place] = _checked_text(text, place)
    recorder = Recorder(has_lines=False, n_inputs=len(INPUTS) + len(rates))
    inputs = recorder.inputs()
    own = dict(zip(rates, inputs[len(INPUTS) :], strict=True))
    tape = recorder.tape(components(texts, inputs[: len(INPUTS)], {**values, **own}))
    torque = StateTorque(
        tape, None, tape.needs_attitude, tuple(texts.values()), tuple(values.items()),
        own=tuple(rates),
    )  # fmt: skip
    return law_of(torque) or torque


def components(
    texts: Mapping[str, str], inputs: Sequence[Any], constants: Mapping[str, Any]
) -> list[Any]:
    """Return checked expressions as symbols; `inputs` are the symbols of `INPUTS`."""
    names = {**dict(zip(INPUTS, inputs, strict=True)), "pi": math.pi, **constants}
    return [_component(text, names, place) for place, text in texts.items()]


def text_components(values: Mapping[str, object], inputs: Sequence[Any]) -> list[Any]:
    """Return numbers unchanged, and expressions as symbols."""
    found = []
    for place, value in values.items():
        if isinstance(value, str):
            value = components({place: _checked_text(value, place)}, inputs, {})[0]
        found.append(value if isinstance(value, Symbol) else finite(place, value))
    return found


def _checked_constants(constants: object) -> dict[str, float]:
    where = "[torque.constants]"
    if not isinstance(constants, Mapping):
        raise InputError(f"{where} is {kind_of(constants)}; allowed: names and numbers")
    values = {}
    for name, value in constants.items():
        if not isinstance(name, str):
            raise InputError(f"{where}: a name is {kind_of(name)}; allowed: text")
        if not _NAME.fullmatch(name) or iskeyword(name):
            raise InputError(
                f"{where}: '{_short(name)}' is no name; allowed: letters, digits and _, no digit "
                "first, and no word of Python's grammar"
            )
        if name in (*INPUTS, "pi", *FUNCTIONS):
            raise InputError(
                f"{where}: '{name}' has a meaning in expressions already; give the constant "
                "another name"
            )
        values[name] = finite(f"{where} {_short(name)}", value)
    return values


def _three_texts(expressions: object) -> dict[str, str]:
    where = "[torque] expression"
    given = list(itertools.islice(number_list(where, expressions, _THREE), 4))
    if len(given) != 3:
        count = "more than 3" if len(given) > 3 else len(given)
        raise InputError(f"{where}: {count} entries; {_THREE}")
    places = (f"{where} {number}" for number in (1, 2, 3))
    return {place: _checked_text(text, place) for place, text in zip(places, given, strict=True)}


def _checked_text(text: object, place: str) -> str:
    if not isinstance(text, str):
        raise InputError(f"{place} is {kind_of(text)}; it must be text, as in '-0.1*w1'")
    if len(text) > _LONGEST:
        raise InputError(f"{place}: {len(text)} characters; allowed: at most {_LONGEST} characters")
    if foreign := _FOREIGN.search(text):
        character = foreign[0]
        if character.isspace():  # a message shows white space as a blank
            character = character.encode("unicode_escape").decode()
        raise InputError(f"{place}: unknown character '{character}'; {_ALLOWED}")
    return " ".join(text.split())


def _component(text: str, names: Mapping[str, Any], place: str) -> Any:
    found: dict[ast.AST, Any] = {}
    # A loop, unlike recursion, is not limited by the stack. Nodes follow their parents in the list.
    for node, operands, function in reversed(_operations(text, names, place)):
        try:
            value = function(*(found[each] for each in operands))
        except OverflowError:
            raise _overflow(place) from None
        except ZeroDivisionError:
            raise InputError(f"{place}: division by the constant 0") from None
        except InputError as error:
            # Messages of symbols do not name the expression.
            message = str(error)
            if message.startswith("[torque]: "):
                raise InputError(f"{place}: {message.removeprefix('[torque]: ')}") from None
            raise
        if isinstance(value, Symbol) and not value.linear().terms:
            value = value.linear().constant
        if isinstance(value, float) and not math.isfinite(value):
            raise _overflow(place)
        found[node] = value
    return value


def _tree(text: str, place: str) -> ast.expr:
    if not text:
        raise InputError(f"{place} is empty; write '0' for no torque about this axis")
    steps = ((letter == "(") - (letter == ")") for letter in text)
    if max(itertools.accumulate(steps)) > _MOST_OPEN:
        raise InputError(f"{place}: nested too deeply; allowed: at most {_MOST_OPEN} parentheses")
    try:
        with warnings.catch_warnings():
            # Python warns of text such as "2(t)", which is refused below.
            warnings.simplefilter("ignore")
            return ast.parse(text, mode="eval").body
    except (RecursionError, MemoryError):
        raise _too_deep(place) from None
    except (SyntaxError, ValueError) as error:
        # Python's message would mislead.
        at = getattr(error, "offset", None) or 1
        near = text[max(at - 1, 0) :] or text
        raise InputError(
            f"{place}: not an arithmetic expression, at '{_short(near)}'; {_ALLOWED}"
        ) from None


def _operations(
    text: str, names: Mapping[str, Any], place: str
) -> list[tuple[ast.expr, Sequence[ast.expr], Callable[..., Any]]]:
    found, waiting = [], [(_tree(text, place), 1)]
    while waiting:
        node, depth = waiting.pop()
        if depth > _DEEPEST:
            raise _too_deep(place)
        operands, function = _operation(node, text, names, place)
        found.append((node, operands, function))
        waiting += [(each, depth + 1) for each in operands]
    return found


def _operation(
    node: ast.expr, text: str, names: Mapping[str, Any], place: str
) -> tuple[Sequence[ast.expr], Callable[..., Any]]:
    match node:
        case ast.BinOp(left, ast.Pow(), right):
            return [left, right], partial(_power, place)
        case ast.BinOp(left, op, right) if type(op) in _SUM:
            return [left, right], _SUM[type(op)]
        case ast.UnaryOp(ast.UAdd(), operand):
            return [operand], lambda x: x
        case ast.UnaryOp(ast.USub(), operand):
            return [operand], operator.neg
        case ast.Compare(left, [op], [right]) if type(op) in _COMPARISONS:
            return [left, right], _COMPARISONS[type(op)]
        case ast.BoolOp(op, conditions) if all(map(_is_condition, conditions)):
            join = operator.and_ if isinstance(op, ast.And) else operator.or_
            return conditions, lambda *values: reduce(join, values)
        case ast.UnaryOp(ast.Not(), condition) if _is_condition(condition):
            return [condition], negated
        case ast.Call(ast.Name(name), arguments, keywords):
            if name not in FUNCTIONS:
                raise unknown("function", name, FUNCTIONS, place)
            count = _COUNTS[name]
            if len(arguments) != count or keywords:
                raise InputError(f"{place}: {name} of {len(arguments)} arguments; allowed: {count}")
            return arguments, partial(_called, place, name)
        case ast.Name(name):
            return [], partial(_named, name, names, place)
        case ast.Constant(value) if type(value) in (int, float):
            return [], partial(float, value)  # type: ignore[arg-type]
    shown = _short(text[node.col_offset : node.end_col_offset])
    raise InputError(f"{place}: '{shown}' is not allowed; {_ALLOWED}")


def _is_condition(node: ast.expr) -> bool:
    is_not = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    return isinstance(node, (ast.Compare, ast.BoolOp)) or is_not


def _named(name: str, names: Mapping[str, Any], place: str) -> Any:
    if name in names:
        return names[name]
    if name in FUNCTIONS:
        raise InputError(f"{place}: {name} without an argument; write {name}(...)")
    raise unknown("name", name, [*names, *FUNCTIONS], place)


def _power(place: str, base: Any, exponent: Any) -> Any:
    if isinstance(base, Symbol) or isinstance(exponent, Symbol):
        return base**exponent
    try:
        return math.pow(base, exponent)
    except ValueError:
        if base == 0.0:
            raise ZeroDivisionError from None
        raise InputError(f"{place}: the constant {base:g} has no real power {exponent:g}") from None


def _called(place: str, name: str, *arguments: Any) -> Any:
    if name == "where":
        return select(*arguments)
    if any(isinstance(each, Symbol) for each in arguments):
        return ELEMENTARY[name](*arguments)
    try:
        return ELEMENTARY[name](*map(float, arguments))
    except ValueError:
        (argument,) = arguments
        what = "square root" if name == "sqrt" else name
        raise InputError(f"{place}: {what} of the constant {argument:g}") from None


def _overflow(place: str) -> InputError:
    return InputError(f"{place}: a constant is too large for binary64")


def _too_deep(place: str) -> InputError:
    return InputError(
        f"{place}: nested too deeply; allowed: at most {_DEEPEST} levels, where each term of a sum "
        "is one more (parentheses make a long sum less deep)"
    )


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."
