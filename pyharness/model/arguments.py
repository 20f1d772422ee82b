"""The arguments that a user's function takes: those without defaults."""

from collections.abc import Callable
from inspect import Parameter, signature
from typing import Any

from pyharness.model.errors import InputError

_POSITIONAL = (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)


def count_inputs(
    function: Callable[..., Any], where: str, allowed: str, least: int, of_many: int
) -> int:
    """Return the number of a function's arguments, `least` or one more.

    An argument with a default is a constant. `of_many` is the number for ``*args``.
    """
    try:
        parameters = signature(function).parameters.values()
    except (TypeError, ValueError):
        raise InputError(f"{where}: the function's arguments are unknown; {allowed}") from None
    needed = [each for each in parameters if each.default is Parameter.empty]
    for each in needed:
        if each.kind is Parameter.KEYWORD_ONLY:
            raise InputError(f"{where}: the argument {each.name} has no default; {allowed}")
    count = sum(each.kind in _POSITIONAL for each in needed)
    if count < least and any(each.kind is Parameter.VAR_POSITIONAL for each in needed):
        return of_many
    if count not in (least, least + 1):
        raise InputError(f"{where}: the function has {count} arguments without defaults; {allowed}")
    return count


def has_argument(function: Callable[..., Any], name: str) -> bool:
    return has_signature(function) and name in signature(function).parameters


def third_argument(function: Callable[..., Any]) -> list[str]:
    """Return the name of a third argument by position without default, in a list."""
    if not has_signature(function):
        return []
    found = list(signature(function).parameters.values())[2:3]
    return [x.name for x in found if x.kind in _POSITIONAL and x.default is Parameter.empty]


def has_signature(function: Callable[..., Any]) -> bool:
    try:
        signature(function)
    except (TypeError, ValueError):
        return False
    return True


def defaults_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the defaults of arguments that can be passed by name."""
    return {
        each.name: each.default
        for each in signature(function).parameters.values()
        if each.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
        and each.default is not Parameter.empty
    }
