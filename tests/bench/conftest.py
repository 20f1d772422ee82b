"""Shared by the tests of benchmarks."""

import pytest

from pyharness.bench import ensemble_measure, measure


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure each run time once."""
    for module, name, value in (
        (measure, "_ROUNDS", 1), (measure, "_BATCH", 1e-5),
        (ensemble_measure, "ROUNDS", 1), (ensemble_measure, "SAMPLE", 20),
        (ensemble_measure, "_BATCH", 0.0),
        (ensemble_measure, "_GROWTH_ROUNDS", 1),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)
