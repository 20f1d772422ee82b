"""Write the methods with a fixed step from pyharness/model/fixed_steps.py, with fypp."""

import math
import sys
from fractions import Fraction
from pathlib import Path

import fypp

from pyharness.model.fixed_steps import FIXED_STEPS, Row

SOURCE = Path(__file__).resolve().parent / "modern/fixed_step.fypp"


def texts() -> dict[str, str]:
    """Return the text of the file by its name."""
    options = fypp.FyppOptions()
    options.modules, options.no_folding = [Path(__file__).stem], True
    places = sys.path  # fypp leaves out the folder of the script
    text = str(fypp.Fypp(options).process_text(SOURCE.read_text()))
    sys.path = places
    return {f"{SOURCE.stem}.f90": text}


def constant(name: str) -> str:
    return name.upper().replace("-", "_")


def number(value: Fraction | int) -> str:
    """Return a real number in Fortran."""
    top, bottom = Fraction(value).as_integer_ratio()
    return f"{top}.0_dp" + (f"/{bottom}.0_dp" if bottom > 1 else "")


def inner_nodes() -> list[Fraction | int]:
    """Return the times of all methods' stages inside a step."""
    return sorted({node for each in FIXED_STEPS for node in each.nodes} - {0, 1})


def torque(node: Fraction | int) -> str:
    """Return the variable that has the torque at a node."""
    return {Fraction(0): "m", Fraction(1): "m_end"}.get(
        Fraction(node)
    ) or f"m_inner(:, {inner_nodes().index(node) + 1})"


def argument(row: Row) -> str:
    """Return the omega of a stage."""
    terms = [(value, k) for k, value in enumerate(row, 1) if value]
    if not terms:
        return "y"
    if len(terms) > 1:
        return f"y + h*({' + '.join(f'({number(value)})*k{k}' for value, k in terms)})"
    ((value, k),) = terms
    return f"y + h*k{k}" if value == 1 else f"y + (({number(value)})*h)*k{k}"


def increment(weights: Row) -> str:
    """Return the change of omega in a step; rates of equal weight are added first."""
    bottom = math.lcm(*(Fraction(each).denominator for each in weights))
    groups: dict[int, list[str]] = {}
    for k, weight in enumerate(weights, 1):
        groups.setdefault(int(weight * bottom), []).append(f"k{k}")
    sums = [
        f"({' + '.join(rates)})" if top == 1 else f"{top}.0_dp*({' + '.join(rates)})"
        for top, rates in sorted(groups.items())
        if top
    ]
    return f"(h/{bottom}.0_dp)*({' + '.join(sums)})"
