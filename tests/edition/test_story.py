"""The story has the numbers and curves of the programs, and its words agree with them."""

import html
import random
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import case_scene, run_program
from pyharness.edition import story
from pyharness.edition.ledger import assumption
from pyharness.history.claims.ledger import judgement, judgements
from pyharness.history.claims.stories import prose
from pyharness.history.claims.verdicts import FALSE, REPRODUCED
from pyharness.history.figures import TERMS
from pyharness.model import assumptions
from pyharness.model.assumptions import open_starts
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, subset, switches
from pyharness.model.scene_file import case_numbers
from pyharness.thesis.cards import deck
from pyharness.truth.reference import reference
from tests.edition.pages import pages
from tests.ports import WEB, run_javascript

ROOT = Path(__file__).parents[2]
EDITION = facts("account")["edition"]


Slots = dict[str, float]
# Slot, digits, value and text of a number of the page.
_SLOT = r'<data data-slot="([\w-]+)" data-digits="(\d+)" value="([^"]+)">([^<]*)<'


@pytest.fixture(scope="module")
def slots(built_site: dict[str, bytes]) -> Slots:
    found = re.findall(_SLOT, built_site["index.html"].decode())
    numbers = {slot: float(value) for slot, _, value, _ in found}
    assert len(numbers) == len(found) == built_site["index.html"].count(b"<data ") > 25
    return numbers


def _error(case: int, program: str, listing: str, components: slice = slice(None)) -> float:
    scene = case_scene(case)
    run = run_program(scene, getattr(Listing, listing)(program), "python")
    truth = reference(scene, scene.times()).omega[: run.steps]
    return float(np.abs(run.omega - truth)[:, components].max())


def test_numbers_of_the_first_states_are_those_of_the_twins(slots: Slots) -> None:
    found = slots
    first = slice(0, 1)
    stopped: Any = run_program(case_scene(2), subset("runge-kutta"), "python")
    assert found["run-step"] == found["at-step"] == stopped.stop.step == 25
    assert found["quotient"] == found["at-quotient"] == stopped.stop.quotient
    assert found["peak"] == stopped.velocity[23, 1] == stopped.velocity[:, 1].max()
    assert found["after"] == found["at-velocity"] == stopped.velocity[24, 1]
    assert found["sine"] == _error(2, "two-term", "original", first)
    assert found["sine"] == pytest.approx(_error(2, "four-term", "original", first), rel=1e-9)
    assert found["stop-error"] == _error(2, "runge-kutta", "original", first)
    assert found["sine-corrected"] == _error(2, "runge-kutta", "corrected", first)
    assert found["lipschitz"] == facts("cases")["deck"]["lipschitz"]
    in_48_bits: Any = run_program(case_scene(2), subset("runge-kutta"), "python", word="cdc48").stop
    assert in_48_bits == story.context()["in_48_bits"].stop
    rounded = run_program(case_scene(2), subset("runge-kutta"), "python", word="cdc48-rounded").stop
    for stop in (in_48_bits, rounded):
        assert stop is not None
        assert (stop.step, stop.variable) == (25, "V2")
        assert isinstance(stop.quotient, float)
    for case in (1, 2, 5):
        run = run_program(case_scene(case), subset("runge-kutta"), "python")
        assert found[f"blind-steps-{case}"] == run.steps
        assert found[f"blind-error-{case}"] == _error(case, "runge-kutta", "original", first)


def test_what_ends_a_run_whose_omega_is_right(slots: Slots, built_site: dict[str, bytes]) -> None:
    alone, right = (
        run_program(case_scene(2), subset("runge-kutta", fix=fix), "python")
        for fix in (["lipschitz-tests-velocity"], ["stage-base", "base-not-restored"])
    )
    # The page says that both variables are at a turning point there.
    for name, run in (("alone", alone), ("right", right)):
        assert run.stop is not None
        assert slots[f"{name}-step"] == run.stop.step
        assert run.stop.variable == "U1"
        change = np.abs(np.diff(run.omega[:, 0]))
        assert change[-1] == change.min() < 0.02 * change.max()
    assert np.abs(right.omega - reference(case_scene(2), list(right.time)).omega).max() < 1e-5
    assert b'data-text="alone-variable">U1<' in built_site["index.html"]


CARDS_OF_POINTS = {
    "two-term": ("T1=DT/3.", "T2=2.*DT/3."),
    "four-term": ("T1=DT*.2", "T2=DT*.4", "T3=DT*.6", "T4=DT*.8"),
}


def test_the_points_leave_the_step(slots: Slots) -> None:
    """The points are those of the twin, and only the two-term program suffers."""
    scene, step = case_scene(6), story.POINTS_STEP
    assert slots["points-at"] == step
    run = run_program(scene, subset("two-term"), "python")
    assert (run.ended, run.steps) == ("overflow", step - 1)
    assert slots["points-steps"] == run.steps
    assert slots["points-error"] == _error(6, "two-term", "original", slice(0, 1))
    for program, terms in TERMS.items():
        fractions = [n / (terms + 1) for n in range(1, terms + 1)]
        assert story.data()["fractions"][program] == fractions
        cards = {card.text.strip() for card in deck(program).cards.values()}
        assert set(CARDS_OF_POINTS[program]) <= cards
    assert slots["point-first"] == pytest.approx(step * 0.01 / 3)
    assert slots["point-last"] == pytest.approx(2 * step * 0.01 / 3)
    # A quadratic is determined by three points: four terms do not suffer under constant torques.
    for case in range(2, 7):
        one, other = (
            run_program(case_scene(case), listing, "python").omega
            for listing in (subset("four-term"), subset("four-term", fix=["dt-accumulates"]))
        )
        assert np.abs(one - other).max() < 1e-13


def test_what_is_assumed_is_marked(built_site: dict[str, bytes]) -> None:
    assumed = open_starts()
    for case in case_numbers():
        assert bool(assumption(case)) == (case in assumed)
    assert "cards" in assumption(7)
    (text,) = [each["text"] for each in facts("account")["statement"] if each["id"] == "supplied"]
    for page in ("index", "laboratory", "figures", "claims", "thesis"):
        told = " ".join(html.unescape(built_site[f"{page}.html"].decode()).split())
        assert told.count("* assumed") >= 2, page
        assert text in told
    assert assumption(2, ["runge-kutta"]).startswith("I after the DO loop")
    assert assumption(2, ["runge-kutta"], "corrected") == ""
    for scene in ("claim", "half-speed", "blind", "points", "corrected"):
        part = (
            built_site["index.html"].decode().partition(f'<section class="scene" id="{scene}"')[2]
        )
        assert "* assumed" in part.partition("</section>")[0], scene
    # From both starts that the thesis shows, Case 1 ends before.
    home = " ".join(built_site["index.html"].decode().split())
    steps = []
    for start in ((0.0, 1.0, 10.0), (0.0, 1.0, 1.0)):
        steps.append(run_program(replace(case_scene(1), omega=start), subset("runge-kutta")).steps)
    assert f"at steps {steps[0]} and {steps[1]}." in home
    for part in built_site["figures.html"].decode().split("<figcaption>")[1:]:
        caption = part.partition("</fig")[0]
        address = r"laboratory.html#case=(\d)&amp;program=([\w-]+)&amp;listing=(\w+)"
        runs = re.findall(address, caption)
        on = {
            each["on"]
            for case, program, base in runs
            for each in assumptions.assumed(case_scene(int(case)), [subset(program, base)])
        }
        assert ("* assumed" in caption) == bool(on & {"omega", "listing"})
        # The caption names a start that we supply.
        assert ("its initial omega" in caption) == (int(runs[0][0]) in assumed)
    claims = built_site["claims.html"].decode()
    for each in judgements():
        line = claims.partition(f'id="{each.claim["id"]}"')[2].partition("</summary>")[0]
        assert ("* assumed" in line) == (not all(x.survives for x in each.survivals))


@pytest.mark.campaign
def test_ratios_are_those_of_the_largest_errors(slots: Slots) -> None:
    ratios = {}
    for case in range(2, 8):
        two, four, third = (_error(case, program, "corrected") for program in PROGRAMS)
        ratios[case] = [two / third, four / third]
    found = slots
    assert found["ratio"] == min(ratios[2])
    assert found["least-ratio"] == min(min(ratios[case]) for case in range(2, 7))
    assert found["most-ratio"] == max(max(ratios[case]) for case in range(2, 7))
    assert [found["seven-two"], found["seven-four"]] == ratios[7]
    # "The conclusion was true of the printed programs, and false of the methods" rests on this.
    assert min(min(each) for each in ratios.values()) > 1.0
    assert judgement("vi-superior").original.verdict == REPRODUCED
    assert judgement("vi-superior").corrected.verdict == FALSE


def test_sentences_about_checks_that_see_no_fault_are_true(built_site: dict[str, bytes]) -> None:
    for program in PROGRAMS:
        last = run_program(case_scene(1), subset(program), "python").omega[-1]
        np.testing.assert_allclose(last, 3.5, rtol=1e-14)
    for program in ("two-term", "four-term"):
        listings = Listing.original(program), Listing.corrected(program)
        one, other = (run_program(case_scene(2), each, "python").omega for each in listings)
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-14)
    assert _error(5, "runge-kutta", "original") > 1.0
    assert _error(5, "two-term", "original") > 1000.0 * _error(5, "two-term", "corrected")
    assert b"right\n3.5 rad/s" in built_site["index.html"]
    evaluations = story.context()["evaluations"]
    for program in PROGRAMS:
        run = run_program(case_scene(2), Listing.corrected(program))
        assert run.evaluations == 100 * evaluations[program]


def test_the_limit_of_both_faults_is_the_sine_of_half_the_speed(slots: Slots) -> None:
    active = set(switches("runge-kutta"))
    scene = case_scene(2)
    for parts in (1, 8):
        finer = replace(scene, step_size=0.01 / parts, steps=100 * parts)
        times = np.array(finer.times())
        run = run_program(finer, Listing("runge-kutta", active), "python", may_stop=False)
        from_limit = np.abs(run.omega[:, 0] - 2.0 * np.sin(2.5 * times)).max()
        from_truth = np.abs(run.omega[:, 0] - np.sin(5.0 * times)).max()
        if parts == 1:
            assert slots["from-limit"] == pytest.approx(from_limit, rel=1e-12)
            assert slots["from-solution"] == pytest.approx(from_truth, rel=1e-12)
        else:
            assert from_limit < 0.2 * slots["from-limit"]


def test_both_languages_write_a_number_alike(built_site: dict[str, bytes]) -> None:
    generator = random.Random(29)
    numbers = [
        (generator.choice((-1, 1)) * 10.0 ** generator.uniform(-20, 20), generator.randint(1, 6))
        for _ in range(2000)
    ]
    numbers += [(0.0, 3), (3304.7, 4), (999999.0, 2), (9.9999e-4, 2), (1e-3, 3)]
    numbers += [(-1234.5, 5), (-0.0, 2), (0.5, 1)]
    modules = {"N": WEB / "story/numbers.js"}
    found = run_javascript(modules, "return given.map(([x, n]) => N.prose(x, n));", given=numbers)
    assert found == [prose(*each) for each in numbers]
    for slot, digits, value, text in re.findall(_SLOT, built_site["index.html"].decode()):
        assert html.unescape(text) == prose(float(value), int(digits)), slot


def test_the_name_of_the_edition_is_everywhere(built_site: dict[str, bytes]) -> None:
    home = built_site["index.html"].decode()
    title = f"The program that stopped at step {facts('account')['mechanism']['stopped']['step']}"
    assert f"<h1>{title}</h1>" in home
    assert f"<title>{title} · {EDITION['name']}</title>" in home
    for name in ("index.html", "about.html"):
        assert EDITION["subtitle"] in built_site[name].decode()
    assert EDITION["name"] in (ROOT / "README.md").read_text()
    assert EDITION["name"] in (ROOT / "CITATION.cff").read_text()
    # The home page is light.
    targets = pages(built_site)["index.html"].targets
    loaded = {path for element, path, _ in targets if element != "a"}
    assert "assets/story.js" in loaded
    assert sum(len(built_site[path]) for path in {"index.html", *loaded}) < 150e3


def test_marks_on_curves_are_whole() -> None:
    """A mark has a radius of 4.5 units, and what is outside of the plot is not drawn."""
    left, _, right, _ = story.BOX
    marks = story.context()["charts"]["claim"].marks
    assert len(marks) == len(story.LETTERS)
    for each in marks:
        across = [float(point.split(",")[0]) for point in each.points.split()]
        assert left + 4.5 <= min(across) < max(across) <= right - 4.5
