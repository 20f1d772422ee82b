"""The atlas of claims: which claims hold for which initial omega (start).

The starts have all directions at several magnitudes. A claim scores 1 point if reproduced, 1/2 if
reproduced in part. Verdict codes are as in `over_starts`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product, repeat
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pyharness.checks.compare.batch import Batch
from pyharness.history.claims.evidence import POINTS
from pyharness.history.claims.laboratory import starts
from pyharness.history.claims.ledger import claim
from pyharness.history.claims.over_starts import FAILS, FUNCTIONS, HOLDS, IN_PART, SILENT
from pyharness.history.claims.verdicts import IN_PART as PARTLY
from pyharness.history.claims.verdicts import REPRODUCED
from pyharness.model.errors import InputError
from pyharness.model.report import Column, Picture, Report, Table, digits, numbers, words
from pyharness.model.scene import Triple
from pyharness.model.trajectory import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WHERE = ("omega.magnitude", "height", "longitude")
CHOSEN = ("reading", "steps")
_CODES = (FAILS, HOLDS, IN_PART)
# Points by verdict code.
_POINTS = np.zeros(len(_CODES) + 1)
_POINTS[[HOLDS, IN_PART]] = POINTS[REPRODUCED], POINTS[PARTLY]
Codes = NDArray[np.int8]
_MAPS = 6
_KEYS = ("id", "whole", "in part", "not", "bits")
_PERCENT = digits(".2f", 100.0)
_VERDICTS = (Column("whole %", _PERCENT), Column("in part %", _PERCENT), Column("not %", _PERCENT))
_OMEGA = tuple(Column(f"omega{k}", digits(".3g"), unit="rad/s") for k in (1, 2, 3))


@dataclass(frozen=True, eq=False)
class Atlas:
    """The verdict codes of claims over readings, numbers of steps and initial omegas."""

    codes: Mapping[str, Codes]  # by claim; axes reading, steps, magnitude, height, longitude
    readings: Sequence[str]
    steps: Sequence[int]
    first: Batch  # scenes of the first reading and number of steps
    magnitudes: Array  # magnitudes of omega(0), rad/s
    heights: Array  # omega3 divided by the magnitude
    longitudes: Array  # angles about axis 3, from axis 1, rad

    def score(self, reading: int = 0, steps: int = 0) -> Array:
        """Return each start's points, for the indices of a reading and a number of steps."""
        return sum_of_points([codes[reading, steps] for codes in self.codes.values()])

    def none_fails(self, reading: int = 0, steps: int = 0) -> NDArray[np.bool_]:
        held = [codes[reading, steps] != FAILS for codes in self.codes.values()]
        return np.asarray(np.all(held, axis=0))

    def start(self, at: Sequence[int] | NDArray[Any]) -> Triple:
        """Return omega(0) (rad/s) at the indices `at` of magnitude, height and longitude."""
        size, height = self.magnitudes[at[0]], self.heights[at[1]]
        across, longitude = np.sqrt(1.0 - height * height), self.longitudes[at[2]]
        found = size * np.array([across * np.cos(longitude), across * np.sin(longitude), height])
        return (float(found[0]), float(found[1]), float(found[2]))


def atlas_of(codes: Mapping[str, Codes], axes: Mapping[str, Any], first: Batch) -> Atlas:
    """Return the atlas of a sweep, or raise InputError if it is incomplete or has other axes."""
    if tuple(axes) != (*CHOSEN, *WHERE) or not all(map(len, axes.values())) or not codes:
        allowed = ", ".join((*CHOSEN, *WHERE))
        raise InputError(
            f"--atlas: the sweep must store verdicts on claims, and have the axes {allowed}"
        )
    if any((each < 0).any() for each in codes.values()):
        raise InputError(
            "--atlas: chunks of the store are missing; 'pyharness sweep' computes them"
        )
    for name, each in codes.items():
        if (each == SILENT).any():
            raise InputError(
                f"--atlas: {name} does not concern all scenes of the sweep; allowed: a case of the "
                "thesis, listing original or corrected, no other step_size, lipschitz or may_stop"
            )
    readings, steps = [*map(str, axes["reading"])], [*map(int, axes["steps"])]
    return Atlas(codes, readings, steps, first, *(axes[name] for name in WHERE))


def sum_of_points(codes: Sequence[Codes]) -> Array:
    return np.asarray(sum(_POINTS[each] for each in codes))


def shares(codes: Codes) -> tuple[float, float, float]:
    whole, part, not_at_all = (float((codes == each).mean()) for each in (HOLDS, IN_PART, FAILS))
    return whole, part, not_at_all


def bits(codes: Codes) -> float:
    """Return the entropy (bits) of a claim's verdict over the starts."""
    parts = np.array([(codes == code).mean() for code in _CODES])
    parts = parts[parts > 0.0]
    return float(-(parts * np.log2(parts)).sum()) + 0.0


def about(names: Sequence[str]) -> dict[int, list[str]]:
    """Return by case the claims in `names` that concern only this case."""
    found: dict[int, list[str]] = {}
    for name in names:
        case = claim(name)["parameters"].get("case")
        if case is not None:
            found.setdefault(case, []).append(name)
    return found


def shown_starts(names: Sequence[str], first: Batch) -> dict[Triple, dict[str, int]]:
    """Return verdict codes by claim for each of `starts`, otherwise with the scenes of `first`."""
    given = starts()
    batch = replace(first, arrays={"omega": np.array(given)})
    found = {name: FUNCTIONS[name](batch) for name in names}
    return {start: {name: int(x[k]) for name, x in found.items()} for k, start in enumerate(given)}


def atlas_report(atlas: Atlas) -> Report:
    claims = _claims(atlas)
    score = atlas.score()
    first = f"reading {atlas.readings[0]}, {atlas.steps[0]} steps"
    best, n_choices = float(score.max()), len(atlas.readings) * len(atlas.steps)
    places = np.argwhere(score == best)
    sections: list[list[Any]] = [
        [
            f"{score.size} starts with {n_choices} choices of reading and steps: "
            f"{score.size * n_choices} scenes, {len(atlas.codes)} claims. A claim "
            "counts 1 where it is reproduced, 1/2 in part, 0 otherwise."
        ],
        [f"Claims, those first that tell most of a start ({first}; shares of all starts):", claims],
        [f"Starts by points ({first}):", _by_points(score)],
        [
            f"The most points are {best:g}, from {len(places)} starts; from "
            f"{int(atlas.none_fails().sum())} no claim fails. By magnitude:",
            _by_magnitude(atlas, score),
        ],
        ["Starts from which all claims about one case hold, at least in part:", _by_case(atlas)],
        ["Starts that the thesis shows, and (1, 1, 1), which is ours:", _shown(atlas, score)],
    ]
    if n_choices > 1:
        sections.append(["Readings and steps:", _by_choice(atlas)])
        turned = "Starts whose verdict another reading turns, or other steps:"
        sections.append([turned, _percentage_turned(atlas)])

    def record() -> dict[str, Any]:
        found = [dict(zip(_KEYS, row, strict=True)) for row in claims.rows]
        return {"claims": found, "best": best, "starts": [list(atlas.start(at)) for at in places]}

    pictures = {"atlas": partial(atlas_picture, atlas)}
    return Report("claims", sections, record, claims, pictures=pictures)


def _claims(atlas: Atlas) -> Table:
    rows = [(name, *shares(codes[0, 0]), bits(codes[0, 0])) for name, codes in atlas.codes.items()]
    columns = [*words("claim"), *_VERDICTS, Column("bits", digits(".3f"))]
    return Table(columns, sorted(rows, key=lambda row: -row[-1]))


def _by_points(score: Any) -> Table:
    values, counts = np.unique(score, return_counts=True)
    rows = [
        (float(value), int(count), count / score.size, counts[k:].sum() / score.size)
        for k, (value, count) in enumerate(zip(values, counts, strict=True))
    ]
    columns = [Column("points", digits("g")), Column("starts"), Column("%", _PERCENT)]
    return Table([*columns, Column("as many or more %", _PERCENT)], rows[::-1])


def _by_magnitude(atlas: Atlas, score: Any) -> Table:
    best, none = score.max(), atlas.none_fails()
    rows = []
    for k, magnitude in enumerate(atlas.magnitudes):
        most = np.argwhere(score[k] == best)
        one = atlas.start((k, *most[0])) if len(most) else (None, None, None)
        mean, largest = float(score[k].mean()), float(score[k].max())
        rows.append((float(magnitude), mean, largest, int(none[k].sum()), len(most), *one))
    points = digits(".4g")
    columns = [
        Column("magnitude", points, unit="rad/s"), Column("mean", points),
        Column("most", points), Column("none fails"), Column("of the best"), *_OMEGA,
    ]  # fmt: skip
    return Table(columns, rows)


def _by_case(atlas: Atlas) -> Table:
    rows = []
    for case, names in sorted(about(list(atlas.codes)).items()):
        points = np.stack([sum_of_points([atlas.codes[name][0, 0]]) for name in names])
        row: list[Any] = [case, len(names)]
        for least in (0.5, 1.0):
            held = (points >= least).all(axis=0)
            sizes = atlas.magnitudes[np.any(held, axis=(1, 2))]
            ends = (float(sizes[0]), float(sizes[-1])) if len(sizes) else (None, None)
            row += [float(held.mean()), *ends]
        rows.append(row)
    size = digits(".3g")
    columns = [Column("case"), Column("claims")]
    for head in ("hold %", "whole %"):
        columns += [Column(head, _PERCENT), Column("from rad/s", size), Column("to rad/s", size)]
    return Table(columns, rows)


def _shown(atlas: Atlas, score: Any) -> Table:
    rows = []
    for start, codes in shown_starts(list(atlas.codes), atlas.first).items():
        points = float(sum_of_points([np.array(code, np.int8) for code in codes.values()]))
        failing = [name for name, code in codes.items() if code == 0]
        rows.append((*start, points, float((score > points).mean()), ", ".join(failing) or "none"))
    columns = [
        *_OMEGA, Column("points", digits("g")), Column("more %", _PERCENT),
        Column("fail", left=True, fit="wrap"),
    ]  # fmt: skip
    return Table(columns, rows)


def _by_choice(atlas: Atlas) -> Table:
    rows = []
    for (k, reading), (m, steps) in product(enumerate(atlas.readings), enumerate(atlas.steps)):
        score = atlas.score(k, m)
        most = float(score.max())
        best, none = int((score == most).sum()), int(atlas.none_fails(k, m).sum())
        rows.append((reading, steps, float(score.mean()), most, best, none))
    columns = [
        *words("reading"), Column("steps"), Column("mean", digits(".4f")),
        Column("most", digits("g")), Column("starts with it"), Column("none fails"),
    ]  # fmt: skip
    return Table(columns, rows)


def _percentage_turned(atlas: Atlas) -> Table:
    """Return a table of the percentage of each claim's verdicts that other choices change."""
    places = [(k, 0) for k in range(1, len(atlas.readings))]
    places += [(0, m) for m in range(1, len(atlas.steps))]
    rows = []
    for name, codes in atlas.codes.items():
        turned = [float((codes[at] != codes[0, 0]).mean()) for at in places]
        if any(turned):
            rows.append((name, *turned))
    heads = [f"{atlas.readings[k]} %" if k else f"{atlas.steps[m]} steps %" for k, m in places]
    return Table([*words("claim"), *(Column(head, _PERCENT) for head in heads)], rows)


def atlas_picture(atlas: Atlas) -> Picture:
    """Return maps of the score over directions of omega(0), and claims' means by magnitude."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 7.2), dpi=100, layout="constrained")
    parts: Any = figure.subfigures(1, 2, width_ratios=[1.15, 1.0])
    maps, claims = parts
    score = atlas.score()
    _draw_maps(maps, atlas, score)
    names = [row[0] for row in _claims(atlas).rows]
    means = np.array(
        [[sum_of_points([each]).mean() for each in atlas.codes[name][0, 0]] for name in names]
    )
    _draw_claims(claims, atlas, names, means)
    rows: list[tuple[Any, ...]] = []
    for name, points in zip(names, means.tolist(), strict=True):
        shares = [float((each != FAILS).mean()) for each in atlas.codes[name][0, 0]]
        rows += zip(repeat(name), atlas.magnitudes.tolist(), points, shares, strict=False)
    title = f"reading {atlas.readings[0]}, {atlas.steps[0]} steps"
    data = numbers("claim omega.magnitude mean_points share_not_failing", rows)
    return Picture(figure, data, [f"claims of section V over starts omega(0) ({title})"])


def _draw_maps(figure: "Figure", atlas: Atlas, score: Any) -> None:
    import matplotlib as mpl

    # Omit the first and last maps, which resemble their neighbours.
    count = len(atlas.magnitudes)
    inside = np.linspace(0, count - 1, _MAPS + 2)[1:-1].round()
    chosen = np.unique(inside) if count > _MAPS else np.arange(count)
    plots = figure.subplots(-(-len(chosen) // 2), 2, squeeze=False, sharex=True, sharey=True)
    none = atlas.none_fails()
    least, largest = float(score.min()), float(score.max())
    count = max(1, round(2.0 * (largest - least)))
    colours = mpl.colormaps["viridis"].resampled(count + 1)
    drawn: Any = None
    for plot, k in zip(plots.ravel(), chosen.astype(int), strict=False):
        drawn = plot.pcolormesh(
            np.degrees(atlas.longitudes), atlas.heights, score[k], cmap=colours,
            vmin=least - 0.25, vmax=largest + 0.25, shading="nearest", rasterized=True,
        )  # fmt: skip
        if none[k].any() and not none[k].all():
            plot.contour(
                np.degrees(atlas.longitudes), atlas.heights, none[k].astype(float), [0.5],
                colors="#b02018", linewidths=0.8,
            )  # fmt: skip
        for start in starts():
            size = math.hypot(*start)
            if math.isclose(size, atlas.magnitudes[k], rel_tol=1e-3):
                longitude = math.degrees(math.atan2(start[1], start[0])) % 360.0
                plot.plot(longitude, start[2] / size, "w+", markersize=9, markeredgewidth=2.0)
        plot.set_title(f"|omega(0)| = {atlas.magnitudes[k]:.3g} rad/s", fontsize=9)
        plot.set_xticks([0, 90, 180, 270, 360])
    for plot in plots.ravel()[len(chosen) :]:
        plot.set_axis_off()
    plots[0, 0].set_xlim(0.0, 360.0)
    step = float(np.ptp(atlas.heights)) / max(1, len(atlas.heights) - 1)
    plots[0, 0].set_ylim(atlas.heights[0] - step / 2.0, atlas.heights[-1] + step / 2.0)
    for plot in plots[-1]:
        plot.set_xlabel("longitude from axis 1 (degrees)", fontsize=8)
    for plot in plots[:, 0]:
        plot.set_ylabel("omega3 / |omega|", fontsize=8)
    figure.colorbar(
        drawn, ax=list(plots.ravel()), location="bottom", aspect=40,
        label=f"points of {len(atlas.codes)}; red: the edge of where no claim fails",
    )  # fmt: skip


def _draw_claims(figure: "Figure", atlas: Atlas, names: Sequence[str], means: Any) -> None:
    plot = figure.subplots()
    drawn = plot.pcolormesh(
        _edges(atlas.magnitudes), np.arange(len(names) + 1) - 0.5, means, cmap="gray_r", vmin=0.0,
        vmax=1.0, rasterized=True,
    )  # fmt: skip
    plot.set_xscale("log")
    plot.set_yticks(range(len(names)), names, fontsize=8)
    plot.invert_yaxis()
    plot.set_xlabel("|omega(0)| (rad/s)", fontsize=8)
    plot.set_title("claims, those first that tell most of a start", fontsize=9)
    figure.colorbar(
        drawn, ax=plot, location="bottom", aspect=40, label="mean points over the sphere"
    )


def _edges(values: Array) -> Array:
    if len(values) < 2:
        return np.array([values[0] / 2.0, values[0] * 2.0])
    middles = np.sqrt(values[1:] * values[:-1])
    first, last = values[0] ** 2 / middles[0], values[-1] ** 2 / middles[-1]
    return np.array([first, *middles, last])
