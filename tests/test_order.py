"""A seed gives one order of the tests, and another seed another."""

from pathlib import Path

import pytest

from tests import order


@pytest.mark.campaign
def test_a_seed_gives_one_order_of_all_tests(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    for name in ("a", "b"):
        text = "import pytest\n@pytest.mark.parametrize('n', range(9))\ndef test(n): pass\n"
        (tmp_path / f"test_{name}.py").write_text(text)

    def run(*more: str) -> list[str]:
        words = ["-p", "no:cacheprovider", "-p", "no:zarr", "-v", *more]
        assert pytest.main([str(tmp_path), *words], plugins=[order]) == 0
        said = capsys.readouterr().out
        assert f"random order: {' '.join(more)}" in said or not more
        return [line.split()[0] for line in said.splitlines() if " PASSED" in line]

    plain, first, again, second = (run(*more) for more in ((), ("--order", "1"),
                                   ("--order", "1"), ("--order", "2")))  # fmt: skip
    assert first == again
    assert sorted(plain) == sorted(first) == sorted(second)
    assert plain != first != second
    assert {"test_a.py" in line for line in first[:9]} == {True, False}
