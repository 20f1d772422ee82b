"""The report of the command `rotations`."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from pyharness.checks.theory.rotations import Rates, SteadyRotation, SteadyRotations
from pyharness.checks.theory.rotations_picture import rotations_picture
from pyharness.model.assumptions import assumption_records
from pyharness.model.records import build_record, scene_record
from pyharness.model.report import Column, Report, Section, Table, digits, numbers, words
from pyharness.model.scene import Scene
from pyharness.model.scene_report import heading

_TIMES = ("doubling_time", "period", "flip_interval", "linear_until")
_FULL = (
    "place omega1 omega2 omega3 rate1_re rate1_im rate2_re rate2_im rate3_re rate3_im stable "
    + " ".join(_TIMES)
)
_KEY = (
    "w1 to w3: omega of the rotation, rad/s. stable: whether no perturbation grows, neither as "
    "exp(Q t) nor as t. doubling, period: time in which a perturbation doubles, and its period, s. "
    "flips: shortest time between flips, s. linear: time after which the linear approximation has "
    "an error of a tenth, s. Q: rates of equation 32, 1/s."
)


def rotations_report(scene: Scene, found: SteadyRotations) -> Report:
    """Return the report of a scene's steady rotations."""
    perturbed = f"perturbation: {found.disturbance:g} of the rotation"
    text: list[Section] = [[*heading(scene), perturbed], [found.told]]
    if found.rotations:
        text += [[_KEY], [_table(found.rotations)]]
    return Report(
        "rotations",
        text=text,
        record=lambda: {
            "scene": scene_record(scene),
            "told": found.told,
            "disturbance": found.disturbance,
            "rotations": [_record(each) for each in found.rotations],
            "build": build_record(),
            "assumptions": assumption_records([(scene, [])]),
        },
        data=numbers(_FULL, [_row(each) for each in found.rotations]),
        pictures={"rotations": partial(rotations_picture, scene)},
    )


def _table(rotations: Sequence[SteadyRotation]) -> Table:
    columns = [
        *words("rotation"),
        *(Column(f"w{axis}", digits(".4g")) for axis in (1, 2, 3)),
        Column("stable", lambda stable: "yes" if stable else "no", left=True),
        *(Column(head, digits(".3g")) for head in ("doubling", "period", "flips", "linear")),
        Column("Q", _rates, left=True, fit="wrap"),
    ]
    rows = [[each.place, *each.omega, each.stable, *_times(each), each.rates] for each in rotations]
    return Table(columns, rows)


def _rates(rates: Rates) -> str:
    """Return three rates (1/s) as text, with opposite or conjugate pairs as +-."""
    first, second, third = rates
    if not any(rates):
        return "0"
    if second == 0.0 and first == -third:
        return f"0, +-{_complex(first)}"
    if second == third.conjugate() and second.imag:
        return f"{first.real:.4g}, {_complex(second)}"
    if first == second.conjugate() and first.imag:
        return f"{_complex(first)}, {third.real:.4g}"
    return ", ".join(_complex(each) for each in rates)


def _complex(rate: complex) -> str:
    if rate.imag == 0.0:
        return f"{rate.real:.4g}"
    return f"{rate.real:.4g}+-{rate.imag:.4g}i" if rate.real else f"{rate.imag:.4g}i"


def _times(each: SteadyRotation) -> list[float | None]:
    return [getattr(each, name) for name in _TIMES]


def _row(each: SteadyRotation) -> list[Any]:
    parts = [part for rate in each.rates for part in (rate.real, rate.imag)]
    return [each.place, *each.omega, *parts, each.stable, *_times(each)]


def _record(each: SteadyRotation) -> dict[str, Any]:
    return {
        "place": each.place,
        "omega": list(each.omega),
        "rates": [[rate.real, rate.imag] for rate in each.rates],
        "stable": each.stable,
        **dict(zip(_TIMES, _times(each), strict=True)),
    }
