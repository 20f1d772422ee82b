"""A printed page is compared with our pages in every arithmetic."""

from pathlib import Path

import pytest

from pyharness import InputError, case_scene, run_program
from pyharness.history.listing_output import fits, our_page, read_page
from pyharness.history.printed_page import Difference, Fit, printed_numbers, split_page
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.thesis.decks import card_steps
from pyharness.thesis.printer import page
from tests.conftest import ResultOf

MACHINE = Path(__file__).parents[2] / "docs" / "machine"
PAGES = sorted(MACHINE.glob("*.txt"))


def printed(folder: Path, program: str, case: int, word: str, listing: str = "original") -> Path:
    """Return the path of a page as a printer prints it: with banner, carriage control, dayfile."""
    scene = case_scene(case)
    run = run_program(scene, getattr(Listing, listing)(program), "python", word=word)
    text = page(scene, program, run).replace("\n", "  \n")
    path = folder / "page.txt"
    path.write_text(f"1JACOBS\n\n{text}\n 12.30.07.LGO.\n")
    return path


def judged(path: Path, program: str, case: int) -> list[Fit]:
    return fits(read_page(str(path)), [program], [case])


@pytest.mark.campaign
@pytest.mark.parametrize(("program", "case", "word", "listing", "alike"), [
    ("two-term", 2, "cdc48", "original", {"cdc48", "binary32"}),
    ("two-term", 2, "binary64", "corrected", {"binary64", "binary128", "cdc48-rounded"}),
    ("runge-kutta", 3, "cdc48-rounded", "original", None),
])  # fmt: skip
def test_a_page_tells_its_word(
    tmp_path: Path, program: str, case: int, word: str, listing: str, alike: set[str] | None
) -> None:
    found = judged(printed(tmp_path, program, case, word, listing), program, case)
    whole = {each.word for each in found if each.is_whole}
    assert word in whole
    assert alike is None or whole == alike
    corrected = {(each.listing == "corrected") for each in found if each.is_whole}
    assert corrected == {listing == "corrected"}


@pytest.mark.campaign
def test_every_program_and_case_is_tried(tmp_path: Path) -> None:
    lines = read_page(str(printed(tmp_path, "four-term", 4, "binary64")))
    best = fits(lines, PROGRAMS, range(1, 8))[0]
    assert (best.program, best.case, best.is_whole) == ("four-term", 4, True)


def test_a_digit_and_a_row_that_differ_are_told(tmp_path: Path) -> None:
    path = printed(tmp_path, "two-term", 2, "cdc48")
    lines = path.read_text().replace("0.0999", "0.0998", 1).splitlines(keepends=True)
    path.write_text("".join(lines))
    (best,) = (each for each in judged(path, "two-term", 2)[:2] if each.word == "cdc48")
    assert best.differences == (Difference(2, 1, "0.0998", "0.0999"),)
    path.write_text("".join(line for line in lines if line.split()[3:4] != ["100"]))
    best = next(each for each in judged(path, "two-term", 2) if each.word == "cdc48")
    assert {each.theirs for each in best.differences} == {"0.0998", "-"}
    path.write_text("".join(lines).replace("  40.00 ", "  41.00 "))
    with pytest.raises(InputError, match="moments"):
        judged(path, "two-term", 2)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_shipped_pages_are_what_is_printed(path: Path) -> None:
    program, _, rest = path.stem.partition("-case-")
    case, _, word = rest.partition("-")
    steps = card_steps(program)
    text = path.read_text()
    assert text == our_page(Listing.original(program), int(case), steps, word)
    stopped = run_program(case_scene(int(case)), Listing.original(program)).stop
    _, rows = split_page(printed_numbers(text))
    assert len(rows) == (steps if stopped is None else stopped.step)


@pytest.mark.parametrize("rows", [pytest.param(300, marks=pytest.mark.campaign), 250, 100])
def test_page_of_the_cards_has_more_rows_than_the_text_says(tmp_path: Path, rows: int) -> None:
    """The DO statement says 300 steps, and the text 100; a page of another length is not whole."""
    assert card_steps("two-term") == 300
    text = our_page(Listing.original("two-term"), 2, 300, "cdc48")
    (tmp_path / "page").write_text("".join(text.splitlines(keepends=True)[: 4 + rows]))
    best = judged(tmp_path / "page", "two-term", 2)[0]
    assert best.is_whole == (rows != 250)
    assert best.fields == 8 * max(rows, 100 if rows == 100 else 300)


def test_a_page_tells_its_reading(tmp_path: Path) -> None:
    """A compiler that adds 1 to the DO variable prints another page of the Runge-Kutta program."""
    text = our_page(Listing.original("runge-kutta", ["do-variable"]), 5, 100, "cdc48")
    (tmp_path / "page").write_text(text)
    found = judged(tmp_path / "page", "runge-kutta", 5)
    assert {each.listing for each in found if each.is_whole} == {"original with do-variable"}


def test_command_exits_with_1_for_no_word(tmp_path: Path, result_of: ResultOf) -> None:
    assert len(PAGES) == 6
    path = printed(tmp_path, "two-term", 2, "cdc48")
    asked = ["verify", "--listing-output", str(path), "--program", "two-term", "--case", "2"]
    told = " ".join(result_of(asked).out.split())
    assert "printed so by two-term, case 2, original, in cdc48" in told
    path.write_text(path.read_text().replace("0.0999", "0.0998"))
    told = " ".join(result_of(asked, 1).out.split())
    assert "by none; the nearest is two-term, case 2, original" in told
    assert "theirs ours 2 1 0.0998 0.0999" in told
