"""The pages of the decks: printed pages, notes, brackets, corrected cards, and the comparison."""

import re
from collections import Counter

import numpy as np
import pytest

from pyharness.edition import decks, parallel_decks
from pyharness.history.ablation import case_truth
from pyharness.history.identifiers import text_digest
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, names_of, switches
from pyharness.model.scene_file import case_numbers, case_scene
from pyharness.thesis.cards import deck, tight
from pyharness.thesis.collation import expected_lines, witness_lines
from pyharness.thesis.decks import corrections
from pyharness.thesis.programs import run_program
from tests.edition.pages import pages
from tests.tables import tables


def view_of(program: str, number: int) -> decks.CardView:
    (view,) = [each for each in decks.card_views(program) if each.number == number]
    return view


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_page_has_48_cards_but_the_last(program: str) -> None:
    sheets = decks.sheets(program)
    counts = [len(sheet.cards) for sheet in sheets]
    assert counts[:-1] == [48] * (len(counts) - 1)
    assert 0 < counts[-1] <= 48
    assert [each.number for sheet in sheets for each in sheet.cards] == list(deck(program).cards)
    moved = {"runge-kutta": [None, None, None, "noise-order"]}
    assert [sheet.moved for sheet in sheets] == moved.get(program, [None] * len(sheets))


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_note_is_shown_once_for_its_range_of_cards(program: str) -> None:
    views = decks.card_views(program)
    shown_notes = [(each.entry["id"], each.cards) for view in views for each in view.begins]
    wanted = [
        (each["id"], cards)
        for each in facts("apparatus")["entry"]
        for cards in each["cards"].get(program, "").split(", ")
        if cards
    ]
    assert sorted(shown_notes) == sorted(wanted)
    for view in views:
        assert {each.entry["id"] for each in view.notes} == set(
            deck(program).cards[view.number].entries
        )
        kinds = [each.kind for each in view.notes]
        assert kinds == sorted(kinds, key=decks._ORDER.index)
        assert view.kinds == sorted(set(kinds), key=decks._ORDER.index)


@pytest.mark.parametrize("program", PROGRAMS)
def test_defects_have_the_first_notes(built_site: dict[str, bytes], program: str) -> None:
    found = decks.notes(program)
    assert [each.number for each in found] == list(range(1, len(found) + 1))
    kinds = [decks._ORDER.index(each.kind) for each in found]
    assert kinds == sorted(kinds)
    anchors = pages(built_site)[f"listing/{program}.html"].anchors
    shown = [each for each in anchors if each.startswith("note-")]
    assert shown == [f"note-{each.number}" for each in found]


@pytest.mark.parametrize("program", PROGRAMS)
def test_defects_that_change_most_are_first(program: str) -> None:
    """The order follows from runs with one defect corrected at a time."""
    defects = [each.entry["id"] for each in decks.notes(program) if each.kind == "defect"]
    changes = []
    for name in defects:
        largest = 0.0
        for case in case_numbers() if name in names_of("defect", program) else ():
            scene, truth = case_scene(case), case_truth(case).omega
            errors = []
            for active in (switches(program), set(switches(program)) - {name}):
                run = run_program(scene, Listing(program, active), "fortran")
                errors.append(float(np.abs(run.omega - truth[: run.steps]).max()))
            if np.isfinite(errors).all():
                largest = max(largest, abs(errors[0] - errors[1]))
            elif np.isfinite(errors).any():
                largest = np.inf
        changes.append(float(f"{largest:.2e}"))
    assert changes == sorted(changes, reverse=True)
    assert changes[0] > 0.0


def test_the_witness_has_its_own_names_and_lines() -> None:
    (view,) = [each for each in decks.card_views("runge-kutta") if each.number == 1050]
    assert [each.text for each in view.after][1] == "630-      END DETERMINATION OF K'S."
    views = {each.number: each for each in decks.card_views("four-term")}
    assert views[460].witness == "      M1=M1/I1"
    assert views[970].witness == ""
    assert views[450].witness is None
    scanned = [text for text, name in expected_lines() if name == "phantom"]
    shown = [tight(r.text) for p in PROGRAMS for v in decks.card_views(p) for r in v.after]
    assert sorted(shown) == sorted(scanned)


def test_conjectured_cards_are_in_brackets_and_no_other() -> None:
    bracketed, lost = {}, set()
    for program in PROGRAMS:
        lost |= {(program, number) for number, card in deck(program).cards.items() if card.lost}
        for view in decks.card_views(program):
            text = "".join(run.text for run in view.card)
            if re.match(r" *\[.*\]$", text):
                bracketed[program, view.number] = text
    assert set(bracketed) == lost
    # The statement stays in column 7; the C of a comment has no blank before it.
    assert bracketed["four-term", 970] == "     [A(4,1)=1.]"
    assert bracketed["runge-kutta", 1010] == "[C]"


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_line_of_the_scan_has_its_blanks(program: str) -> None:
    for view in decks.card_views(program):
        line = witness_lines().get(f"{program}:{view.number}")
        told = None if view.scan is None else "".join(run.text for run in view.scan)
        assert told == line
        for run in view.scan or ():
            assert run.entry is None or run.text == run.text.strip()


def test_the_scan_has_one_three_or_six_blanks_before_a_statement() -> None:
    """The page says so, and that the number depends on the page."""
    for program in PROGRAMS:
        for sheet in decks.sheets(program):
            found = Counter(
                len(match[1])
                for view in sheet.cards
                if re.match(" {6}[A-Z]", deck(program).cards[view.number].text)
                and (line := witness_lines().get(f"{program}:{view.number}"))
                and (match := re.search(r"-( *)\S", line))
            )
            if found.total() < 5:  # one page has only cards with statement numbers, and END
                assert (program, sheet.number) == ("runge-kutta", 4)
                continue
            usual, count = found.most_common(1)[0]
            assert usual in (1, 3, 6), (program, sheet.number)
            assert count > 0.8 * found.total(), (program, sheet.number, found)
    named = {name: text for text, name in expected_lines() if ":" in name}
    assert {name: tight(line) for name, line in witness_lines().items()} == named


@pytest.mark.parametrize("program", PROGRAMS)
def test_corrected_cards_differ_where_a_defect_is_corrected(program: str) -> None:
    changed = {}
    for view in decks.card_views(program):
        corrected = view.corrected
        assert corrected.changes == (
            corrected.text != deck(program).cards[view.number].text.rstrip()
        )
        if corrected.changes or corrected.inserted:
            changed[view.number] = corrected
        else:
            assert corrected.defects == []
    named = {name for each in changed.values() for name in each.defects}
    assert named == set(switches(program)) & Listing.original(program).defects
    inserted = {n for each in changed.values() for n, _ in each.inserted}
    # 930: the corrected program does not depend on the value of I after the loop (do-variable).
    without = {930} if program == "runge-kutta" else set()
    assert {*changed, *inserted} - without == {
        *(n for n in corrections(program) if n in deck(program).cards or n in inserted),
        *(n for n, each in changed.items() if each.inserted),
    }


def test_side_by_side_of_three_cards() -> None:
    found = view_of("runge-kutta", 860)
    assert found.corrected.text == "      U1(I)=UU1+.5*DT*KF(I)"
    assert found.corrected.defects == ["stage-base"]
    assert [(place.text, switch, active) for place, switch, active in found.port] == [
        ("U1(I) = U1(J) + 0.5_wp*DT*KF(I)", "stage-base", True),
        ("U1(I) = UU1 + 0.5_wp*DT*KF(I)", "stage-base", False),
    ]
    deleted = view_of("two-term", 1660)
    assert deleted.corrected.text is None
    assert [(switch, active) for _, switch, active in deleted.port] == [("dt-accumulates", True)]
    before = view_of("runge-kutta", 1530)
    assert not before.corrected.changes
    assert before.corrected.inserted[0] == (1531, "      U1(1)=U1(I)")
    # A statement after a branch, at the depth of the branch, does not depend on it.
    assert [switch for _, switch, _ in view_of("runge-kutta", 930).port] == [None]


def test_the_corrected_statement_is_that_of_the_port() -> None:
    def plain(text: str) -> str:
        return re.sub(r"_wp\b|(?<![\d.])0(?=\.\d)|(?<=\d\.)0\b", "", tight(text))

    compared = 0
    for program in PROGRAMS:
        for view in decks.card_views(program):
            for place, switch, active in view.port:
                if switch and not active and switch in view.corrected.defects:
                    port = plain(place.text)
                    wanted = tight(view.corrected.text or "")
                    if "change_u" in port:  # FL2 to ZL2 and P1 to P6 are arrays; J is 3
                        port = re.sub(r"change_u\(\d\)", wanted.partition("=")[0], port)
                        port = re.sub(r"P\((\d)\)", r"P\1", port.replace("(J)", "(3)")).upper()
                    assert port == wanted
                    compared += 1
    assert compared == 19


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_page_says_how_to_cite_a_card(built_site: dict[str, bytes], program: str) -> None:
    assert f"text {text_digest()}" in built_site["listing/index.html"].decode()
    text = " ".join(built_site[f"listing/{program}.html"].decode().split())
    assert set(re.findall(r"text [0-9a-f]{12}\b", text)) == {f"text {text_digest()}"}
    cited = f"{program} deck, card {{0}}; in: pyharness"
    assert cited.format("N") in text
    for number in deck(program).cards:
        assert cited.format(number) in text
        assert f"text {text_digest()}, listing/{program}.html#{number}</p>" in text


def test_every_card_but_comments_is_compared_once() -> None:
    rows = (row for operation in parallel_decks.operations() for row in operation.aligned)
    found = Counter(cell.card for row in rows for cell in row.cells.values() if cell)
    cards = (card for program in PROGRAMS for card in deck(program).cards.values())
    assert found == dict.fromkeys((card for card in cards if not card.is_comment), 1)
    # A row names no difference only if its cards agree; continuation marks are not compared.
    for operation in parallel_decks.operations():
        for row in operation.aligned:
            cells = [each for each in row.cells.values() if each]
            texts = {(tight(each.card.text[:5]), tight(each.card.text[6:])) for each in cells}
            assert bool(row.differences) == (len(texts) > 1), cells
            for cell in cells:
                assert tight("".join(run.text for run in cell.runs)) == tight(cell.card.text)


def test_the_apparatus_explains_its_kinds(built_site: dict[str, bytes]) -> None:
    page = built_site["apparatus.html"].decode()
    told = re.findall(r'<dt class="kind ([\w-]+)">([\w ]+)</dt>', page)
    assert {name for _, name in told} == {each["kind"] for each in facts("apparatus")["entry"]}
    assert all(name.replace(" ", "-") == style for style, name in told)


def compared(program: str, number: int) -> tuple[dict[str, list[str]], list[str]]:
    """Return the marked parts of each deck in the row of a card, and the kinds of differences."""
    rows = (row for operation in parallel_decks.operations() for row in operation.aligned)
    (row,) = (row for row in rows if (cell := row.cells[program]) and cell.card.number == number)
    cells = {name: each.runs for name, each in row.cells.items() if each}
    marked = {name: [run.text for run in runs if run.entry] for name, runs in cells.items()}
    return marked, row.differences


@pytest.mark.parametrize(
    ("program", "number", "parts", "kinds"), tables(__file__)["what_differs_is_marked_and_named"]
)
def test_what_differs_is_marked_and_named(
    program: str, number: int, parts: dict[str, list[str]], kinds: list[str]
) -> None:
    assert compared(program, number) == (parts, kinds)


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_note_is_a_sentence_before_its_cards(built_site: dict[str, bytes], program: str) -> None:
    page = built_site[f"listing/{program}.html"].decode()
    assert re.findall(r'(.) <span class="muted">Cards: ', page) == ["."] * len(decks.notes(program))
