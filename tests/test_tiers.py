"""A long test without the mark fails in the fast tier alone, and says what to do."""

from pathlib import Path

import pytest

from tests import tiers
from tests.quick import MARK

TESTS = """
import pytest, time
def busy():
    begin = time.process_time()
    while time.process_time() < begin + 0.2: pass
def test_long(): busy()
@pytest.mark.campaign
def test_marked(): busy()
def test_short(): pass
first = []
def test_slow_once():
    if not first: first.append(busy())
@pytest.mark.sampled
@pytest.mark.parametrize("n", [1, 2])
def test_some(n): pass
"""


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("mark", "passed", "failed"),
    [(["-m", tiers.FAST], ["test_short", "test_slow_once", "test_some[1]"], ["test_long"]),
     ([], ["test_long", "test_marked", "test_short", "test_some[1]", "test_some[2]"], [])],
)  # fmt: skip
def test_a_long_test_is_marked(
    mark: list[str], passed: list[str], failed: list[str],
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(tiers, "LIMIT", 0.1)
    monkeypatch.setattr(tiers, "_slowness", lambda: 1.0)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n campaign\n sampled\n")
    (tmp_path / f"test_{len(mark)}.py").write_text(TESTS)
    if mark:  # it is not even imported
        (tmp_path / "test_marked_as_a_whole.py").write_text("import pytest\n" + MARK + "1 / 0\n")
    pytest.main(
        [str(tmp_path), "-p", "no:cacheprovider", "-p", "no:zarr", "-v", *mark], plugins=[tiers]
    )
    said = capsys.readouterr().out
    for outcome, names in (("PASSED", passed), ("FAILED", failed)):
        assert [name for name in names if f"{name} {outcome}" not in said] == []
    assert ("test_some[2]" in said) == (not mark)
    assert ("mark it with @pytest.mark.campaign" in said) == bool(failed)
