"""Messages about switches (jumps) of a recorded torque that end or spoil an integration."""

import re

from pyharness.model.errors import SLIDING, TimedError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import SWITCHES, Tape

_INPUTS = ("t", "w1", "w2", "w3", "q0", "q1", "q2", "q3")
_FUNCTIONS = {"sine": "sin", "cosine": "cos"}
_OPERATORS = {"product": "*", "quotient": "/"}
_LONGEST = 80
_TOUCHED = (
    "a switch (where, sign, a comparison) is touched at t = {time} s, where an error decides "
    "whether it changes"
)
_SIMPLE = re.compile(r"\w+(\([^()]*\))?")  # a name, or a function of something simple
# `solve` replaces this text by the switch's formula, because a method's tape has other axes.
_NUMBER = re.compile(r"\[switch (\d+)\]")


def reason_of(ended: str, time: float, number: int) -> str | None:
    """Return the reason if a switch (its `number` counts from 1; 0 is unknown) caused an ending."""
    if ended != "sliding" and not (ended == "sensitive" and number):
        return None
    message = str(TimedError(SLIDING if ended == "sliding" else _TOUCHED, time))
    return f"{message} [switch {number}]" if number else message


def with_text(reason: str | None, scene: Scene) -> str | None:
    """Return a reason with its switch's formula in the scene's axes and names."""
    torque = scene.torque
    found = _NUMBER.search(reason or "")
    if reason is None or found is None:
        return reason
    bare = reason[: found.start()].rstrip()
    if not isinstance(torque, StateTorque) or torque.tape is None:
        return bare
    switches = [each for each in torque.tape.operations if each.kind in SWITCHES]
    number = int(found[1])
    if number > len(switches):
        return bare
    operation = switches[number - 1]
    names = (*_INPUTS, *(each.name for each in scene.states))
    text = _text(torque.tape, operation.operands[0], names)
    what = "floor of" if operation.kind == "floor" else "sign of"
    return bare if text is None else f"{bare}; it is the {what} {text}"


def _text(tape: Tape, slot: int, names: tuple[str, ...]) -> str | None:
    if slot < tape.n_inputs:
        return names[slot]
    kind, operands, linear, _ = tape.operations[slot - tape.n_inputs]
    if linear is not None:
        found = ""
        for each, factor in linear.terms:
            part = _text(tape, each, names)
            if part is None:
                return None
            sign = (" - " if found else "-") if factor < 0.0 else (" + " if found else "")
            size = "" if abs(factor) == 1.0 else f"{abs(factor):.6g}*"
            found += f"{sign}{size}{_bracketed(part) if size else part}"
        if linear.constant:
            found += f" {'-' if linear.constant < 0.0 else '+'} {abs(linear.constant):.6g}"
        return found if len(found) <= _LONGEST else None
    if kind == "table":
        return "a table of t"
    parts = [_text(tape, each, names) for each in operands]
    if any(each is None or len(each) > _LONGEST for each in parts):
        return None
    words = [str(each) for each in parts]
    if kind in _OPERATORS:
        found = _OPERATORS[kind].join(map(_bracketed, words))
    elif kind == "select":
        found = f"where({', '.join(words)})"
    else:
        found = f"{_FUNCTIONS.get(kind, kind)}({words[0]})"
    return found if len(found) <= _LONGEST else None


def _bracketed(text: str) -> str:
    return text if _SIMPLE.fullmatch(text) else f"({text})"
