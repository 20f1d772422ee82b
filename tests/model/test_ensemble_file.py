"""Tests of saving, loading and plotting ensembles."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from pyharness import Ensemble, InputError, Scene, load, solve_many
from pyharness.model.archive import archive_of
from tests.refused import refused

mpl.use("Agg")
SCENE = Scene(omega=(1.0, 0.2, 0.1), moments=(3.0, 2.0, 1.0), attitude=(1, 0, 0, 0))
STARTS = np.array([[1.0, 0.2, 0.1], [0.1, 1.0, 0.2], [0.3, 0.1, 2.0], [1e200, 1e200, 1.0]])


def crossing(t: float, y: Any) -> float:
    return float(y[0])


def ensembles() -> dict[str, Ensemble]:
    return {
        "final": solve_many(SCENE, 2.0, omega=STARTS),
        "times": solve_many(SCENE, times=[1.0, 2.0, 5.0], omega=STARTS, estimates=True),
        "events": solve_many(SCENE, 9.0, omega=STARTS[:3], events=[crossing, lambda t, y: y[1]]),
        "sensitivities": solve_many(SCENE, 1.0, omega=STARTS[:2], sensitivities=["moments"]),
        "both": solve_many(SCENE, times=[1.0, 2.0], omega=STARTS[:2], sensitivities=["moments"]),
        "omega alone": solve_many(Scene(omega=(1, 2, 3), moments=(3, 2, 1)), 2.0, omega=STARTS),
    }


def same(first: Any, second: Any) -> bool:
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(same(first[x], second[x]) for x in first)
    if isinstance(first, list):
        return len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, np.ndarray):
        return first.dtype == second.dtype and np.array_equal(
            first, second, equal_nan=first.dtype.kind == "f"
        )
    return bool(first == second)


@pytest.mark.parametrize(
    "name", ["final", "times", "events", "sensitivities", "both", "omega alone"]
)
def test_files_restore_every_bit(name: str, tmp_path: Path) -> None:
    found = ensembles()[name]
    found.save(tmp_path / "bodies")
    again = Ensemble.load(tmp_path / "bodies.npz")
    for each in fields(Ensemble):
        assert same(getattr(found, each.name), getattr(again, each.name)), each.name
    assert (again.ended == found.ended).all()
    again.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "bodies.npz").read_bytes()


def test_bodies_without_events_are_kept(tmp_path: Path) -> None:
    none: list[list[Any]] = [[np.array([1.0, 2.0]), None, np.zeros(0)]]
    states: list[list[Any]] = [[np.ones((2, 3)), None, np.zeros((0, 3))]]
    found = Ensemble(
        np.ones((3, 3)), np.zeros(3, np.int8), t_events=none, y_events=states, refusals={1: "why"},
        leaves="compiled",
    )  # fmt: skip
    found.save(tmp_path / "x.npz")
    again = Ensemble.load(tmp_path / "x.npz")
    assert same(again.t_events, none)
    assert same(again.y_events, states)
    assert (again.refusals, again.leaves) == ({1: "why"}, "compiled")


def test_wrong_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bodies.npz"
    ensembles()["times"].save(path)
    refused("no trajectory, or damaged", load, path)
    with np.load(path) as file:
        arrays = dict(file)
    changes: list[dict[str, Any]] = [
        {"omega": arrays["omega"][:2]},
        {"status": arrays["status"] + np.int8(100)},
        {"times": arrays["times"][:2]},
        {"estimates": arrays["estimates"].astype("f4")},
        {"event_counts": np.zeros((1, 4), "i8")},
        {"header": str(arrays["header"]).replace('"refusals": null', '"refusals": [[9, "x"]]')},
        {"header": str(arrays["header"]).replace('ties": null', 'ties": ["moments"]')},
        {
            "header": str(arrays["header"]).replace(
                '"refusals": null', '"refusals": [[1, "x"], [1, "y"]]'
            )
        },
        {
            "header": str(arrays["header"]).replace('"names": []', '"names": ["a", "a"]'),
            "own": np.zeros((*arrays["status"].shape, 3, 2)),
        },
        {
            "header": str(arrays["header"]).replace('ties": null', 'ties": ["a", "a"]'),
            **{f"sensitivity_{k}": np.zeros((4, 3, 7, 1)) for k in range(2)},
        },
    ]
    for change in changes:
        path.write_bytes(archive_of({**arrays, **change}))
        refused("a value is missing or damaged", Ensemble.load, path)
    path.write_bytes(archive_of(arrays)[:-40])
    refused("no ensemble, or damaged", Ensemble.load, path)
    np.savez(path, **{**arrays, "omega": arrays["omega"] + 1.0})
    refused("changed after it was written", Ensemble.load, path)
    with pytest.raises(InputError, match=r"\.npz"):
        ensembles()["final"].save(tmp_path / "bodies.csv")


def test_plots_show_distributions_and_bands() -> None:
    axes = ensembles()["final"].plot()
    assert axes.get_ylabel() == "fraction of the bodies"
    # The last body has no result.
    assert [np.size(line.get_xdata()) for line in axes.lines] == [3, 3, 3]
    found = ensembles()["times"]
    axes = found.plot()
    middle = np.median(found.omega[found.has_result.all(axis=1)], axis=0)
    assert np.array_equal(np.array([np.asarray(line.get_ydata()) for line in axes.lines]), middle.T)
    assert len(axes.collections) == 3
    for wrong in (object(), "ax"):
        refused("Axes", found.plot, wrong)
    refused("no body has a result", solve_many(SCENE, 2.0, omega=STARTS[3:]).plot)
