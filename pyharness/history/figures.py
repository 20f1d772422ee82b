"""Figures 6 to 12 of the thesis as findings: curves, reference, caption; nothing is drawn here."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pyharness.model.facts import facts
from pyharness.model.listing import Listing, corrected, original
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Trajectory
from pyharness.original.programs import PROGRAM_REGISTRY
from pyharness.truth.reference import Reference, reference

SETS = {"original": original, "corrected": corrected}
ENDINGS = ("svg", "png", "csv")


@dataclass(frozen=True)
class FigurePlan:
    """One figure of one set, before anything is computed for it.

    Attributes
    ----------
    number, part : int, str
        As the thesis numbers it; the part is `A`, `B` or empty.
    set : str
        A name in `SETS`.
    case : int
        The case that it shows.
    programs : tuple of str
        The programs whose curves it holds.
    caption, source : str
        What it shows, in our words, and where the thesis says so.
    """

    number: int
    part: str
    set: str
    case: int
    programs: tuple[str, ...]
    caption: str
    source: str

    @property
    def stem(self) -> str:
        """The name of its files without their endings."""
        return f"figure-{self.number:02d}{self.part.lower()}" + (
            "-corrected" if self.set == "corrected" else ""
        )

    @property
    def files(self) -> list[str]:
        """The names of its files: pictures, and the plotted numbers."""
        return [f"{self.stem}.{ending}" for ending in ENDINGS]

    @property
    def title(self) -> str:
        """Its number, as in `Figure 10, part A`."""
        return f"Figure {self.number}" + (f", part {self.part}" if self.part else "")


@dataclass(frozen=True, eq=False)
class Curve:
    """What one program made of the scene."""

    listing: Listing
    trajectory: Trajectory


@dataclass(frozen=True, eq=False)
class FigureFinding:
    """A figure with its numbers."""

    plan: FigurePlan
    scene: Scene
    reference: Reference
    curves: tuple[Curve, ...]


def plans() -> list[FigurePlan]:
    """Return all figures, those from the original programs first."""
    return [_plan(entry, each) for each in SETS for entry in facts("figures")["figure"]]


def findings() -> Iterator[FigureFinding]:
    """Compute figure after figure, in the order of `plans`.

    Yields
    ------
    FigureFinding
        Its curves end where the program ended.

    Raises
    ------
    NotBuiltError
        Where the extension is not built.
    """
    truths: dict[int, Reference] = {}
    for plan in plans():
        scene = case_scene(plan.case)
        if plan.case not in truths:
            truths[plan.case] = reference(scene, scene.times())
        curves = []
        for program in plan.programs:
            listing = SETS[plan.set](program)
            curves.append(Curve(listing, PROGRAM_REGISTRY[program].run(scene, listing)))
        yield FigureFinding(plan, scene, truths[plan.case], tuple(curves))


def _plan(entry: dict[str, Any], which: str) -> FigurePlan:
    return FigurePlan(
        number=entry["number"],
        part=entry.get("part", ""),
        set=which,
        case=entry["case"],
        programs=tuple(entry[which]),
        caption=entry["caption"],
        source=entry["source"],
    )
