"""The seven scenes of the story in a browser: each with its action, and the twins' numbers."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from selenium.webdriver import Chrome, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

from pyharness import Listing, case_scene, run_program, subset
from pyharness.edition import story
from pyharness.edition.decks import TITLES
from pyharness.truth.reference import reference
from tests.browser.screen import click, on_paper, opening, screen, without_scripts

pytestmark = pytest.mark.usefixtures("page")


@pytest.fixture
def page(browser: Chrome, site: Path) -> Iterator[None]:
    with screen(browser, 1200), opening(browser, site / "index.html") as opened:
        opened("")
        yield


def _value(browser: Chrome, slot: str) -> float:
    (found,) = browser.find_elements(By.CSS_SELECTOR, f"data[data-slot='{slot}']")
    assert found.is_displayed(), slot
    return float(str(found.get_dom_attribute("value")))


def _text(browser: Chrome, scene: str) -> str:
    return browser.find_element(By.CSS_SELECTOR, f"#{scene} .answer").text


def _points(browser: Chrome, chart: str, curve: str) -> str:
    found = browser.find_element(By.CSS_SELECTOR, f"#chart-{chart} [data-curve='{curve}']")
    return str(found.get_dom_attribute("points"))


def _first_points(chart: str, curve: str) -> str:
    (found,) = [x.points for x in story.context()["charts"][chart].curves if x.name == curve]
    return str(found)


def _largest(case: int, program: str, listing: Listing, components: slice = slice(None)) -> float:
    scene = case_scene(case)
    run = run_program(scene, listing, "python")
    truth = reference(scene, scene.times()).omega[: run.steps]
    return float(np.abs(run.omega - truth)[:, components].max())


@pytest.mark.campaign
def test_the_points_of_a_step_and_their_fault(browser: Chrome) -> None:
    assert _value(browser, "points-at") == story.POINTS_STEP
    assert _points(browser, "points-run", "two-term") == _first_points("points-run", "two-term")
    assert _points(browser, "points", "point-2") == _first_points("points", "point-2")
    assert _points(browser, "points", "point-3") == ""
    browser.find_element(By.ID, "points-step").send_keys(Keys.HOME)
    assert _value(browser, "point-last") == pytest.approx(0.02 / 3)
    click(browser, "input[name=points-program][value=four-term]")
    assert _value(browser, "point-last") == pytest.approx(0.008)
    four = subset("four-term")
    assert _value(browser, "points-error") == pytest.approx(
        _largest(6, "four-term", four, slice(0, 1)), rel=1e-9
    )
    assert _points(browser, "points-run", "two-term") == ""
    assert _points(browser, "points", "point-4") != ""
    click(browser, "input[name=points-program][value=two-term]")
    click(browser, "#points-fault")
    browser.find_element(By.ID, "points-step").send_keys(Keys.END)
    assert _value(browser, "point-last") == pytest.approx(0.02 / 3)
    assert _value(browser, "points-steps") == 100
    without = subset("two-term", fix=["dt-accumulates"])
    assert _value(browser, "points-error") == pytest.approx(
        _largest(6, "two-term", without, slice(0, 1)), rel=1e-9
    )


@pytest.mark.campaign
def test_a_reader_chooses_a_program_predicts_and_runs(browser: Chrome) -> None:
    assert _text(browser, "claim") == ""
    for letter, has in (("A", "two terms"), ("B", "Runge-Kutta")):
        click(browser, f"input[name=trust][value={letter}]")
        assert has in _text(browser, "claim")
        for name in story.LETTERS.values():
            assert _points(browser, "claim", name) == _first_points("claim", name)
    run: Any = run_program(case_scene(2), subset("runge-kutta"), "python")
    error = _largest(2, "runge-kutta", subset("runge-kutta"), slice(0, 1))
    assert _value(browser, "stop-error") == pytest.approx(error, rel=1e-12)
    curve = browser.find_element(By.CSS_SELECTOR, "#chart-stop [data-curve=runge-kutta]")
    assert curve.value_of_css_property("visibility") == "hidden"
    assert not browser.find_element(By.CSS_SELECTOR, "#stop .answer").is_displayed()
    before = _points(browser, "stop", "prediction")
    browser.find_element(By.ID, "prediction").send_keys(Keys.ARROW_LEFT * 10)
    assert _points(browser, "stop", "prediction") != before
    click(browser, "#run")
    assert curve.value_of_css_property("visibility") == "visible"
    assert _value(browser, "predicted") == 40
    assert _value(browser, "run-step") == run.stop.step
    assert _value(browser, "quotient") == run.stop.quotient
    assert f"was {run.stop.variable}," in _text(browser, "stop")
    assert _points(browser, "stop", "runge-kutta") == _first_points("stop", "runge-kutta")


@pytest.mark.campaign
def test_faults_hide_in_case_1_and_show_in_case_5_and_in_the_race(browser: Chrome) -> None:
    assert _value(browser, "blind-error-1") < 1e-14
    for case, program in ((5, "runge-kutta"), (5, "two-term"), (2, "four-term")):
        click(browser, f"input[name=blind-program][value={program}]")
        click(browser, f"input[name=blind-case][value='{case}']")
        expected = _largest(case, program, subset(program), slice(0, 1))
        assert _value(browser, f"blind-error-{case}") == pytest.approx(expected, rel=1e-12)
        assert TITLES[program] in _text(browser, "blind")
        charts = browser.find_elements(By.CSS_SELECTOR, "#blind .chart")
        shown = [each.get_dom_attribute("id") for each in charts if each.is_displayed()]
        assert shown == [f"chart-blind-{case}"]
    for listing in ("corrected", "original"):
        click(browser, f"input[name=race][value={listing}]")
        for program in TITLES:
            drawn = _points(browser, f"race-{listing}", program)
            assert drawn == _first_points(f"race-{listing}", program)
    errors = [_largest(2, name, Listing.corrected(name)) for name in ("four-term", "runge-kutta")]
    assert _value(browser, "ratio") == pytest.approx(errors[0] / errors[1], rel=1e-9)


def test_v2_turns_and_its_quotient_leaps(browser: Chrome) -> None:
    run: Any = run_program(case_scene(2), subset("runge-kutta"), "python")
    assert _value(browser, "at-quotient") == run.stop.quotient
    assert _points(browser, "velocity", "runge-kutta") == _first_points("velocity", "runge-kutta")
    slider = browser.find_element(By.ID, "step")
    slider.send_keys(Keys.ARROW_LEFT * 15)
    assert _value(browser, "at-step") == 10
    assert _value(browser, "at-velocity") == run.velocity[9, 1]
    assert 0.0 < _value(browser, "at-quotient") < 500.0
    click(browser, "#omega-alone")
    alone = subset("runge-kutta", fix=["lipschitz-tests-velocity"])
    stop: Any = run_program(case_scene(2), alone, "python").stop
    assert _value(browser, "alone-step") == stop.step
    assert slider.get_dom_attribute("max") == str(stop.step)
    # The slider keeps its step if the run becomes shorter than it.
    slider.send_keys(Keys.END)
    assert _value(browser, "at-step") == stop.step
    click(browser, "#omega-alone")
    assert _value(browser, "at-step") == run.stop.step


@pytest.mark.campaign
def test_either_fault_can_be_switched_off(browser: Chrome) -> None:
    names = "half-speed", "runge-kutta"
    assert _points(browser, *names) == _first_points(*names)
    both = _value(browser, "from-limit")
    Select(browser.find_element(By.ID, "step-size")).select_by_index(3)
    assert _value(browser, "from-limit") < 0.2 * both
    finer = replace(case_scene(2), step_size=0.01 / 8, steps=800)
    truth = reference(finer, finer.times()).omega[:, 0]
    fixes: list[str] = []
    for fault, slot in (("stage-base", "one-solution"), ("base-not-restored", "none-solution")):
        fixes.append(fault)
        click(browser, f"input[name=fault][value={fault}]")
        run = run_program(finer, subset("runge-kutta", fix=fixes), "python", may_stop=False)
        expected = np.abs(run.omega[:, 0] - truth).max()
        assert _value(browser, slot) == pytest.approx(expected, rel=1e-9, abs=1e-14)
        assert not browser.find_element(By.CSS_SELECTOR, "[data-slot=from-limit]").is_displayed()


@pytest.mark.campaign
def test_the_story_can_be_read_in_four_minutes(browser: Chrome) -> None:
    """A reader who takes every action once sees fewer words than 250 a minute."""
    for selector in ("input[name=trust]", "#run", "#omega-alone", "input[value=corrected]"):
        click(browser, selector)
    script = """
      const words = ".scene :is(p, h2, legend, label, figcaption, button)";
      const shown = [...document.querySelectorAll(words)].filter((each) => each.checkVisibility());
      return shown.map((each) => each.textContent);
    """
    words = " ".join(browser.execute_script(script)).split()
    assert 600 < len(words) < 1000, len(words)
    # All actions can be reached with the keyboard.
    reached = []
    for _ in range(60):
        browser.switch_to.active_element.send_keys(Keys.TAB)
        focus = browser.switch_to.active_element
        reached.append(focus.get_dom_attribute("id") or focus.get_dom_attribute("name"))
    wanted = "trust prediction run step omega-alone fault step-size blind-case blind-program race"
    assert {*wanted.split(), "points-step", "points-program", "points-fault"} <= set(reached)


@pytest.mark.campaign
def test_on_paper_and_without_scripts_the_story_can_be_read(browser: Chrome, site: Path) -> None:
    with on_paper(browser):
        text = browser.find_element(By.TAG_NAME, "main").text
        curve = browser.find_element(By.CSS_SELECTOR, "#chart-stop [data-curve=runge-kutta]")
        assert curve.value_of_css_property("visibility") == "visible"
    answers = "Program B is Runge-Kutta", "ended at step 25 of 100.", "to step 62", "Case 5, Runge"
    for told in answers:
        assert told in text
    assert "you predicted" not in text
    with without_scripts(browser):
        browser.get((site / "index.html").as_uri())
        text = browser.find_element(By.TAG_NAME, "main").text
        for told in ("ended at step 25 of 100", "Case 5, Runge-Kutta", "times smaller", "step 62"):
            assert told in text
        assert "One fault: the curve is 0 " not in text
        assert not browser.find_element(By.ID, "run").is_displayed()
        assert _points(browser, "stop", "runge-kutta") != ""


@pytest.mark.campaign
def test_the_menu_of_a_phone_takes_a_line_until_it_is_opened(browser: Chrome, site: Path) -> None:
    with screen(browser, 360):
        browser.get((site / "index.html").as_uri())
        header = browser.find_element(By.CSS_SELECTOR, "header.top")
        entry = browser.find_element(By.CSS_SELECTOR, "nav a[href='laboratory.html']")
        assert header.size["height"] < 60
        picture = browser.find_element(By.ID, "chart-claim")
        assert picture.location["y"] + picture.size["height"] < 740
        assert not entry.is_displayed()
        button = browser.find_element(By.ID, "menu")
        button.send_keys(Keys.ENTER)
        assert button.get_dom_attribute("aria-expanded") == "true"
        assert entry.is_displayed()
        button.send_keys(Keys.ENTER)
        assert header.size["height"] < 60
