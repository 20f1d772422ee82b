"""The atlas of history: a coarse version is computed and described, its parts have their names."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pyharness import InputError, case_scene
from pyharness.checks.compare.batch import Batch, Solver
from pyharness.cli.main import main
from pyharness.history.claims.atlas import atlas_of, bits, shares, sum_of_points
from pyharness.history.claims.evidence import POINTS
from pyharness.history.claims.laboratory import Assumptions, Laboratory, starts
from pyharness.history.claims.ledger import claim, outcome
from pyharness.history.claims.over_starts import FAILS, FUNCTIONS, HOLDS, IN_PART, JUDGED, SILENT
from pyharness.sweep.batches import solve_chunk
from pyharness.sweep.sweep_file import read_sweep
from tests.conftest import Printed
from tests.refused import refused

pytestmark = pytest.mark.claims
ATLAS = Path(__file__).parents[2] / "docs" / "atlas"
# Counts of 24 starts: reproduced, in part, not reproduced.
COARSE = {
    "v2-case-1-agree": (24, 0, 0), "v2-case-3-concur": (8, 8, 8),
    "v2-case-3-diverging": (12, 8, 4), "v2-case-3-omega3": (16, 0, 8),
    "v2-case-4-concur": (12, 4, 8), "v2-case-4-fails": (16, 4, 4),
    "v2-case-6-concur": (16, 0, 8), "v2-case-6-diverged": (22, 0, 2),
    "v2-case-6-dynamic": (24, 0, 0), "v2-case-7-concur": (3, 13, 8),
    "v3-small-step-collocation": (0, 16, 8), "v3-small-step-runge-kutta": (8, 8, 8),
}  # fmt: skip


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> str:
    pytest.importorskip("zarr")
    folder = tmp_path_factory.mktemp("atlas")
    text = (ATLAS / "history.toml").read_text()
    for before, after in ((25, 3), (48, 2), (96, 4)):
        assert f"count = {before}\n" in text
        text = text.replace(f"count = {before}\n", f"count = {after}\n")
    sweep, store = folder / "coarse.toml", folder / "store"
    sweep.write_text(text)
    assert main(["sweep", str(sweep), "--out", str(store)]) == 0
    return f"--atlas {store} --sweep {sweep}"


@pytest.mark.campaign
def test_a_coarse_atlas_has_the_shares_that_were_seen(coarse: str, printed: Printed) -> None:
    rows = list(csv.DictReader(printed(f"claims {coarse} --format csv").splitlines()))
    assert {row["claim"] for row in rows} == set(JUDGED)
    keys = ("whole %", "in part %", "not %")
    counted = {row["claim"]: tuple(round(24 * float(row[key])) for key in keys) for row in rows}
    assert counted == COARSE
    told = [float(row["bits"]) for row in rows]
    assert told == sorted(told, reverse=True)


def _stored() -> dict[str, dict[float, float]]:
    found: dict[str, dict[float, float]] = {}
    for row in csv.DictReader((ATLAS / "history.csv").read_text().splitlines()):
        of_claim = found.setdefault(row["claim"], {})
        of_claim[float(row["omega.magnitude"])] = float(row["mean_points"])
    return found


def test_numbers_beside_the_page_are_those_beside_its_picture() -> None:
    text = (ATLAS / "history-claims.csv").read_text()
    shares_of = {row["claim"]: row for row in csv.DictReader(text.splitlines())}
    for name, means in _stored().items():
        whole, part = (float(shares_of[name][key]) for key in ("whole (%)", "in part (%)"))
        assert len(means) == 25
        due = (whole + part / 2.0) / 100.0
        assert np.mean(list(means.values())) == pytest.approx(due, abs=1e-4)


@pytest.mark.campaign
def test_a_chunk_of_the_atlas_has_the_stored_means() -> None:
    sweep = read_sweep(ATLAS / "history.toml", FUNCTIONS)
    magnitude = 10
    chunks = [solve_chunk(sweep, 2 * magnitude + half) for half in (0, 1)]
    for name, means in _stored().items():
        codes = np.concatenate([each[f"claim-{name}"] for each in chunks], axis=3)
        assert codes.shape == (1, 1, 1, 48, 96)
        # A few verdicts may be so near to a threshold that another processor changes them.
        told = list(means.values())[magnitude]
        assert sum_of_points([codes]).mean() == pytest.approx(told, abs=1e-3)


@pytest.mark.campaign
def test_an_atlas_is_told_and_drawn(coarse: str, printed: Printed, tmp_path: Path) -> None:
    picture = tmp_path / "atlas.svg"
    text = printed(f"claims {coarse} --plot {picture}")
    assert "24 starts with 9 choices" in text
    assert max(map(len, text.splitlines())) <= 100
    assert picture.stat().st_size < 300_000
    rows = list(csv.DictReader(picture.with_suffix(".csv").read_text().splitlines()))
    assert len(rows) == 3 * len(JUDGED)
    record = json.loads(printed(f"claims {coarse} --format json"))
    assert len(record["claims"]) == len(JUDGED)
    assert np.shape(record["starts"])[1] == 3


def test_points_shares_and_bits_are_counted_by_hand() -> None:
    codes = np.array([HOLDS, HOLDS, IN_PART, FAILS], np.int8)
    assert shares(codes) == (0.5, 0.25, 0.25)
    assert bits(codes) == pytest.approx(1.5)
    assert bits(np.full(4, HOLDS, np.int8)) == 0.0
    assert sum_of_points([codes, codes[::-1]]).tolist() == [1.0, 1.5, 1.5, 1.0]


def test_an_atlas_lacks_nothing() -> None:
    axes = {
        "reading": np.array(["adopted"], dtype=object), "steps": np.array([100.0]),
        "omega.magnitude": np.array([2.0]), "height": np.array([0.6]), "longitude": np.zeros(1),
    }  # fmt: skip
    codes = np.full((1, 1, 1, 1, 1), IN_PART, np.int8)
    first = Batch(case_scene(4), Solver(), None, np.ones(1), {})
    atlas = atlas_of({"v2-case-4-fails": codes}, axes, first)
    assert atlas.score().tolist() == [[[0.5]]]
    assert atlas.start((0, 0, 0)) == pytest.approx((1.6, 0.0, 1.2))
    refused("are missing", atlas_of, {"v2-case-4-fails": codes - 4}, axes, first)
    with pytest.raises(InputError, match="v2-case-4-fails does not concern all scenes"):
        atlas_of({"v2-case-4-fails": np.full_like(codes, SILENT)}, axes, first)
    # A dimension without a field of its name has no values.
    for lacking in ({**axes, "reading": ()}, {**axes, "body.moments.1": np.ones(1)}):
        refused("reading, steps", atlas_of, {"v2-case-4-fails": codes}, lacking, first)


@pytest.mark.parametrize(("listing", "steps"), [("original", 300), ("corrected", 100)])
def test_an_atlas_is_of_the_listing_reading_and_steps_of_its_sweep(
    listing: str, steps: int, printed: Printed, tmp_path: Path
) -> None:
    pytest.importorskip("zarr")
    names, sweep, store = ("v2-case-4-fails", "v2-case-3-concur"), tmp_path / "s", tmp_path / "z"
    reading = "do-variable" if listing == "original" else "adopted"
    asked = ", ".join(f'{{ name = "claim", id = "{name}" }}' for name in names)
    axes = {
        # Another field comes first along the dimension of the readings.
        'program"\ndimension = "reading': ["runge-kutta"], "reading": [reading],
        "steps": [steps], "omega.magnitude": [1.0], "height": [0.5], "longitude": [0.1],
    }  # fmt: skip
    told = "".join(f'[[axis]]\nfield = "{name}"\nvalues = {x}\n' for name, x in axes.items())
    head = f'reductions = [{asked}]\n[scene]\ncase = 4\n[solve]\nlisting = "{listing}"\n'
    sweep.write_text(head + told)
    assert main(["sweep", str(sweep), "--out", str(store)]) == 0
    text = printed(f"claims --atlas {store} --sweep {sweep}")
    assert f"Starts by points (reading {reading}, {steps} steps):" in text
    chosen = Assumptions(readings=frozenset({reading} - {"adopted"}), steps=steps)
    _, _, table = text.partition("which is ours:\n")
    for row, start in zip(table.splitlines()[1:], starts(), strict=False):
        lab = Laboratory(listing == "original", replace(chosen, start=start))
        points = sum(POINTS.get(outcome(claim(name), lab).verdict, 0.0) for name in names)
        assert [float(each) for each in row.split()[:4]] == [*start, points]
