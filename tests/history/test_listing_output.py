"""A printed page, compared with the pages of every machine word; the pages that we ship."""

from pathlib import Path

import pytest

from pyharness import InputError, case_scene, run_program
from pyharness.cli.main import main
from pyharness.history.listing_output import fits, our_page, read_page
from pyharness.history.printed_page import Difference, printed_numbers, split_page
from pyharness.model.listing import Listing
from pyharness.original.decks import card_steps
from pyharness.original.printer import page

MACHINE = Path(__file__).parents[2] / "docs" / "machine"
PAGES = sorted(MACHINE.glob("*.txt"))


def printed(folder: Path, program: str, case: int, word: str, *, mended: bool = False) -> str:
    listing = (Listing.corrected if mended else Listing.original)(program)
    scene = case_scene(case)
    run = run_program(scene, listing, "python", word=word)
    path = folder / "page.txt"
    # As a printer prints it: with a banner, carriage control and a dayfile.
    text = page(scene, program, run)
    path.write_text("1JACOBS\n\n" + text.replace("\n", "  \n") + "\n 12.30.07.LGO.\n")
    return str(path)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("program", "case", "word", "mended", "alike"),
    [
        ("two-term", 2, "cdc48", False, {"cdc48", "binary32"}),
        ("two-term", 2, "binary64", True, {"binary64", "binary128", "cdc48-rounded"}),
        ("runge-kutta", 3, "cdc48-rounded", False, None),
    ],
)
def test_a_page_tells_its_word(
    tmp_path: Path, program: str, case: int, word: str, mended: bool, alike: set[str] | None
) -> None:
    found = fits(
        read_page(printed(tmp_path, program, case, word, mended=mended)), [program], [case]
    )
    whole = {each.word for each in found if each.is_whole}
    assert word in whole
    assert alike is None or whole == alike
    assert {(each.listing == "corrected") for each in found if each.is_whole} == {mended}


@pytest.mark.campaign
def test_every_program_and_case_is_tried(tmp_path: Path) -> None:
    lines = read_page(printed(tmp_path, "four-term", 4, "binary64"))
    best = fits(lines, ["two-term", "four-term", "runge-kutta"], range(1, 8))[0]
    assert (best.program, best.case, best.is_whole) == ("four-term", 4, True)


def test_a_digit_and_a_row_that_differ_are_told(tmp_path: Path) -> None:
    path = Path(printed(tmp_path, "two-term", 2, "cdc48"))
    lines = path.read_text().splitlines(keepends=True)
    row = next(i for i, line in enumerate(lines) if "0.0999" in line)
    lines[row] = lines[row].replace("0.0999", "0.0998")
    path.write_text("".join(lines))
    (best,) = (each for each in fits(read_page(str(path)), ["two-term"], [2])[:2]
               if each.word == "cdc48")  # fmt: skip
    assert best.differences == (Difference(2, 1, "0.0998", "0.0999"),)
    last = max(i for i, line in enumerate(lines) if line.split()[3:4] == ["100"])
    path.write_text("".join(lines[:last] + lines[last + 1 :]))
    best = next(e for e in fits(read_page(str(path)), ["two-term"], [2]) if e.word == "cdc48")
    assert {each.theirs for each in best.differences} == {"0.0998", "-"}


def test_moments_of_no_case_are_told(tmp_path: Path) -> None:
    path = Path(printed(tmp_path, "two-term", 2, "binary64"))
    path.write_text(path.read_text().replace("  40.00 ", "  41.00 "))
    with pytest.raises(InputError, match="moments"):
        fits(read_page(str(path)), ["two-term"], [2])


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_shipped_pages_are_what_is_printed(path: Path) -> None:
    """The pages are those of the cards, with the steps of their DO statements."""
    program, _, rest = path.stem.partition("-case-")
    case, _, word = rest.partition("-")
    steps = card_steps(program)
    text = path.read_text()
    assert text == our_page(Listing.original(program), int(case), steps, word)
    stopped = run_program(case_scene(int(case)), Listing.original(program)).stop
    _, rows = split_page(printed_numbers(text))
    assert len(rows) == (steps if stopped is None else stopped.step)


@pytest.mark.parametrize("rows", [300, 250, 100])
def test_page_of_the_cards_has_more_rows_than_the_text_says(tmp_path: Path, rows: int) -> None:
    """The DO statement says 300 steps, and the text 100; a page of another length is not whole."""
    assert card_steps("two-term") == 300
    text = our_page(Listing.original("two-term"), 2, 300, "cdc48")
    (tmp_path / "page").write_text("".join(text.splitlines(keepends=True)[: 4 + rows]))
    best = fits(read_page(str(tmp_path / "page")), ["two-term"], [2])[0]
    assert best.is_whole == (rows != 250)
    assert best.fields == 8 * max(rows, 100 if rows == 100 else 300)


def test_a_page_tells_its_reading(tmp_path: Path) -> None:
    """A compiler that adds 1 to the DO variable prints another page of the Runge-Kutta program."""
    text = our_page(Listing.original("runge-kutta", ["do-variable"]), 5, 100, "cdc48")
    (tmp_path / "page").write_text(text)
    found = fits(read_page(str(tmp_path / "page")), ["runge-kutta"], [5])
    assert {each.listing for each in found if each.is_whole} == {"original with do-variable"}


def test_command_exits_with_1_where_no_word_prints_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(PAGES) == 6
    path = printed(tmp_path, "two-term", 2, "cdc48")
    asked = ["verify", "--listing-output", path, "--program", "two-term", "--case", "2"]
    assert main(asked) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "printed so by two-term, case 2, original, in cdc48" in told
    Path(path).write_text(Path(path).read_text().replace("0.0999", "0.0998"))
    assert main(asked) == 1
    told = " ".join(capsys.readouterr().out.split())
    assert "by none; the nearest is two-term, case 2, original" in told
    assert "theirs ours 2 1 0.0998 0.0999" in told
