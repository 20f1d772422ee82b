"""Ranges of the motions that were requested from an integrator, answered and judged."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from pyharness.checks.integrators.protocol import CONTROLS, Motion
from pyharness.model.report import Report, counted
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array

Range = tuple[float, float] | None
"""The smallest and the largest value; None without values."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A motion that was requested with each of `settings`."""

    scene: Scene
    times: Array  # requested times, s
    omega: Array  # true angular velocities at these times, rad/s, shape (n, 3)
    settings: Sequence[float]  # step sizes (s) or tolerances
    answer: Motion


@dataclass(frozen=True)
class Coverage:
    """Ranges over all motions that were tried."""

    omega: Range  # magnitude at time 0 and at all requested times, rad/s
    moments: Range  # kg m2
    moment_ratio: Range  # largest moment divided by the smallest
    duration: Range  # s
    torque_duration: Range  # of motions with a torque, s
    torques: tuple[str, ...]  # the parts of each torque
    frequency: Range  # of sines and cosines, rad/s
    step_size: Range  # s
    tolerance: Range
    attitude: bool  # whether attitudes were judged too

    def __str__(self) -> str:
        parts = [
            _format("|omega|", self.omega, "rad/s"),
            _format("moments", self.moments, "kg m2"),
            _format("ratio of largest to smallest", self.moment_ratio),
            _format("last times", self.duration, "s"),
            _format("under torque", self.torque_duration, "s"),
            f"torques: {', '.join(self.torques)}",
            _format("frequencies", self.frequency, "rad/s"),
            _format("steps", self.step_size, "s"),
            _format("tolerances", self.tolerance),
            f"{'with' if self.attitude else 'without'} attitude",
        ]
        return f"{'; '.join(filter(None, parts))}. Nothing else was tried."


def covered(tried: Sequence[Tried]) -> Coverage | None:
    """Return the ranges of what was tried; None if nothing was."""
    if not tried:
        return None
    laws = [each.scene.law for each in tried]
    bodies = [each.scene.moments or () for each in tried]
    ends = [float(each.times[-1]) for each in tried]
    states = np.vstack([x for each in tried for x in ([each.scene.omega], each.omega)])
    steps, tolerances = (
        _range(x for each in tried if each.answer.control == control for x in each.settings)
        for control in CONTROLS
    )
    return Coverage(
        _range(np.linalg.norm(states, axis=1).tolist()),
        _range(moment for body in bodies for moment in body),
        _range(max(body) / min(body) for body in bodies),
        _range(ends),
        _range(end for law, end in zip(laws, ends, strict=True) if not law.is_zero),
        tuple(dict.fromkeys(map(_parts, laws))),
        _range(frequency for law in laws for _, frequency in law.sines + law.cosines),
        steps,
        tolerances,
        any(each.answer.attitude is not None for each in tried),
    )


def with_coverage(report: Report, tried: Sequence[Tried]) -> Report:
    """Return a report that also states the ranges of what was tried, before its last section."""
    found, record = covered(tried), report.record
    told = [f"covered: {found or 'nothing'}"]
    return report._replace(
        text=[*report.text[:-1], told, *report.text[-1:]],
        page=[*(report.page or ()), told],
        record=lambda: {**record(), "covered": None if found is None else asdict(found)},
        properties={**report.properties, "covered": str(found or "nothing")},
    )


def _range(values: Iterable[float]) -> Range:
    found = list(values)
    return (min(found), max(found)) if found else None


def _parts(law: TorqueLaw) -> str:
    found = [name for name in ("constant", "rate") if any(getattr(law, name))]
    waves = {"sine": law.sines, "cosine": law.cosines}
    found += [counted(len(each), name) for name, each in waves.items() if each]
    return " + ".join(found) or "none"


def _format(name: str, values: Range, unit: str = "") -> str:
    texts = dict.fromkeys(f"{x:.3g}" for x in values or ())
    return f"{name} {' to '.join(texts)} {unit}".rstrip() if texts else ""
