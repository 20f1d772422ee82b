"""The laboratory in a browser: numbers, switches, addresses, and the time that a change takes."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver import ActionChains, Chrome, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from pyharness import Trajectory, case_scene, run_program
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, subset
from pyharness.thesis.printer import page
from tests.browser.screen import UNNAMED, WIDTHS, fragment, opening, screen, text_of, too_wide

Open = Callable[[str], None]
EXPERIMENTS = facts("experiments")["experiment"]
_DRAWN = "return document.querySelector('#omega1-chart canvas').toDataURL()"


@pytest.fixture
def laboratory(browser: Chrome, site: Path) -> Iterator[Open]:
    with opening(browser, site / "laboratory.html") as opened:
        yield opened


def _rows(browser: Chrome) -> list[list[str]]:
    """Open the table and return the text of its cells."""
    browser.execute_script("document.getElementById('numbers').open = true")
    # The page fills the table after the browser has reported that it was opened.
    _wait(browser, lambda: len(_table(browser, "#rows tr")) > 6)
    return _table(browser, "#rows tr")


def _table(browser: Chrome, selector: str) -> list[list[str]]:
    read = (
        "return [...document.querySelectorAll(arguments[0])]"
        ".map((row) => [...row.cells].map((cell) => cell.textContent))"
    )
    found: list[list[str]] = browser.execute_script(read, selector)
    return found


def _wait(browser: Chrome, holds: Callable[[], bool]) -> None:
    """Wait until a condition holds, because charts are drawn after the change of an input."""
    WebDriverWait(browser, 5.0).until(lambda _: holds())


def _wait_for_drawing(browser: Chrome, before: str) -> None:
    _wait(browser, lambda: browser.execute_script(_DRAWN) != before)


def _click(browser: Chrome, selector: str) -> None:
    browser.execute_script("document.querySelector(arguments[0]).click()", selector)


@pytest.mark.campaign
def test_the_numbers_are_the_twins(browser: Chrome, laboratory: Open) -> None:
    laboratory("")
    twin: Any = run_program(case_scene(2), subset("runge-kutta"), "python")
    rows = _rows(browser)
    assert len(rows) == 25
    assert [float(row[2]) for row in rows] == twin.omega[:, 0].tolist()
    assert [[float(x) for x in row[5:8]] for row in rows] == twin.velocity.tolist()
    assert "Stopped at step 25 of 100, at 0.25 s, by V2" in text_of(browser, "status")
    assert text_of(browser, "printer-page") == page(case_scene(2), "runge-kutta", twin)
    assert text_of(browser, "problems") == ""
    assert browser.execute_script("return document.querySelectorAll('canvas').length") == 6
    assert text_of(browser, "why-head") == "Why did it stop?"
    assert "V2 had just passed a turning point" in text_of(browser, "why")
    # A switch draws anew, and is in the address.
    before = browser.execute_script(_DRAWN)
    _click(browser, "input[value=stage-base]")
    assert fragment(browser) == "case=2&program=runge-kutta&listing=original&fix=stage-base"
    assert "step 25 " not in text_of(browser, "status")
    twin = run_program(case_scene(2), subset("runge-kutta", fix=["stage-base"]), "python")
    assert [float(row[2]) for row in _rows(browser)] == twin.omega[:, 0].tolist()
    assert text_of(browser, "command").endswith("--listing original --fix stage-base")
    _wait_for_drawing(browser, before)
    browser.find_element(By.ID, "stops").click()
    assert text_of(browser, "why-head") == "Why did it not stop early?"
    assert "The stop test is switched off." in text_of(browser, "why")


@pytest.mark.campaign
def test_an_address_restores_its_state(browser: Chrome, laboratory: Open) -> None:
    words = "case=5&program=two-term&listing=corrected&keep=x3-reads-acl2&steps=30"
    laboratory(f"#{words}")
    assert browser.find_element(By.ID, "case").get_property("value") == "5"
    assert browser.find_element(By.ID, "steps").get_property("value") == "30"
    on = "return [...document.querySelectorAll('input[name=switch]:checked')].map((x) => x.value)"
    assert browser.execute_script(on) == ["x3-reads-acl2"]
    assert not browser.find_element(By.ID, "stop-test").is_displayed()
    absent = browser.find_element(By.CSS_SELECTOR, "[value=stage-base]")
    assert not absent.is_enabled()
    label = absent.find_element(By.XPATH, "..")
    _wait(browser, lambda: "No effect here: not in the two-term program." in label.text)
    assert len(_rows(browser)) == 30
    # Change the fragment without reloading the page.
    browser.execute_script("location.hash = 'case=2&program=runge-kutta&listing=original'")
    _wait(browser, lambda: "Stopped at step 25" in text_of(browser, "status"))
    assert browser.find_element(By.ID, "stop-test").is_displayed()


@pytest.mark.campaign
def test_the_link_that_skips_the_menu_leaves_the_state(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=5&program=two-term&listing=corrected")
    told = text_of(browser, "status")
    address = browser.current_url
    _click(browser, "a.skip")
    time.sleep(0.1)
    assert browser.switch_to.active_element.get_dom_attribute("id") == "main"
    # The address still names the state, so that it can be cited.
    assert browser.current_url == address
    browser.refresh()
    assert text_of(browser, "status") == told
    assert text_of(browser, "problems") == ""


@pytest.mark.campaign
def test_what_has_the_focus_is_in_sight(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=7&program=runge-kutta&listing=original")
    browser.find_element(By.ID, "case").click()
    in_sight = (
        "const r = document.activeElement.getBoundingClientRect();"
        "return r.bottom > 0 && r.top < innerHeight && [document.activeElement.id]"
    )
    seen = set()
    for _ in range(170):
        ActionChains(browser, 0).send_keys(Keys.TAB).perform()
        # A page may still be scrolling.
        seen.update(WebDriverWait(browser, 3.0).until(lambda _: browser.execute_script(in_sight)))
    assert {"omega0", "lipschitz", "step", "address", "printer-page"} <= seen


@pytest.mark.campaign
def test_curves_are_hidden_and_the_pointer_tells_numbers(browser: Chrome, laboratory: Open) -> None:
    laboratory("")
    for id in ("show-solution", "show-limit"):
        before = browser.execute_script(_DRAWN)
        browser.find_element(By.ID, id).click()
        _wait_for_drawing(browser, before)
    over = browser.find_element(By.CSS_SELECTOR, "#omega1-chart .u-over")
    width = over.size["width"]
    ActionChains(browser).move_to_element_with_offset(over, -width // 2 + width // 5, 0).perform()
    told = text_of(browser, "readout")
    step = round(float(told.split(" s: ")[0]) / 0.01)
    twin: Any = run_program(case_scene(2), subset("runge-kutta"), "python")
    for name, value in (("U1", twin.omega[step - 1, 0]), ("V3", twin.velocity[step - 1, 2])):
        assert f"{name} {value:.5g}" in told
    assert "solution" not in told
    assert "quotient: V1 " in told


def _rounded_as(text: str, exact: float) -> float:
    """Return a number rounded to the significant digits of a text."""
    digits = text.lstrip("-").partition("e")[0].replace(".", "").lstrip("0")
    return float(f"{exact:.{max(len(digits), 1)}g}")


def _check_rows(rows: list[list[str]], twin: Trajectory, step: int) -> None:
    """Check that program and solution have the digits in which they differ, and not many more."""
    assert twin.velocity is not None
    for row, exact in zip(rows, [*twin.omega[step], *twin.velocity[step]], strict=False):
        assert float(row[1]) == _rounded_as(row[1], exact)
    for _, program, solution, error, *_ in rows[:3]:
        assert abs(float(program) - float(solution)) == pytest.approx(float(error), rel=0.02)
        assert len(program) < 10


@pytest.mark.campaign
def test_the_step_slider_shows_numbers_and_cards(browser: Chrome, laboratory: Open) -> None:
    laboratory("")
    twin: Any = run_program(case_scene(2), subset("runge-kutta"), "python")
    assert twin.velocity is not None
    rows = _table(browser, "#step-numbers tr")
    _check_rows(rows, twin, -1)
    assert float(rows[4][4]) == _rounded_as(rows[4][4], twin.stop.quotient)
    cards = _table(browser, ".cards tbody tr")
    stopping = next(row for row in cards if row[0] == "1420")
    assert "ends the run" in stopping[1]
    assert stopping[2] == f"quotient of V2 = {twin.stop.quotient!r}"
    assert "not reached" in next(row for row in cards if row[0] == "1430")[1]
    before = browser.execute_script(_DRAWN)
    browser.find_element(By.ID, "step").send_keys(Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    assert text_of(browser, "step-told") == "23 of 25, at 0.23 s"
    rows = _table(browser, "#step-numbers tr")
    _check_rows(rows, twin, 22)
    cards = _table(browser, ".cards tbody tr")
    results = {row[2].partition(" = ")[0]: row[2].partition(" = ")[2] for row in cards if row[2:]}
    assert [float(results[f"U{axis}(4)"]) for axis in (1, 2, 3)] == twin.omega[22].tolist()
    assert not any("ends the run" in row[1] for row in cards if row[1:])
    _wait_for_drawing(browser, before)
    # A click on a chart chooses the step at the pointer.
    over = browser.find_element(By.CSS_SELECTOR, "#velocity-chart .u-over")
    width = over.size["width"]
    chosen = ActionChains(browser).move_to_element_with_offset(over, -width // 2 + width // 10, 0)
    chosen.click().perform()
    assert 8 <= int(text_of(browser, "step-told").split()[0]) <= 12
    link = ".cards a[href='listing/runge-kutta.html#860']"
    assert browser.find_elements(By.CSS_SELECTOR, link)
    # A step that the next run has stays chosen.
    _click(browser, "input[value=stage-base]")
    assert 8 <= int(text_of(browser, "step-told").split()[0]) <= 12
    cards = _table(browser, ".cards tbody tr")
    assert "corrected" in next(row[1] for row in cards if row[0] == "860")


@pytest.mark.campaign
def test_cards_of_a_step_are_in_the_listing(browser: Chrome, laboratory: Open, site: Path) -> None:
    for program in PROGRAMS:
        laboratory(f"#case=5&program={program}")
        links = browser.execute_script(
            "return [...document.querySelectorAll('.cards a')].map((each) => each.hash.slice(1))"
        )
        text = (site / f"listing/{program}.html").read_text()
        assert len(links) > 60
        assert [each for each in links if f'id="{each}"' not in text] == []


@pytest.mark.campaign
def test_a_pinned_run_stays_in_charts_and_address(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=2&program=runge-kutta&listing=original&no-stop")
    assert not browser.find_element(By.ID, "difference").is_displayed()
    browser.find_element(By.ID, "pin").click()
    browser.find_element(By.CSS_SELECTOR, "input[value=stage-base]").click()
    pinned = "pin=case%3D2%26program%3Drunge-kutta%26listing%3Doriginal%26no-stop"
    words = f"case=2&program=runge-kutta&listing=original&fix=stage-base&no-stop&{pinned}"
    assert fragment(browser) == words
    for _ in range(2):
        assert browser.find_element(By.ID, "difference").is_displayed()
        assert text_of(browser, "pinned-command") == (
            "pyharness run --case 2 --program runge-kutta --listing original --no-stop"
        )
        assert "Largest error of omega: 2.98 rad/s." in text_of(browser, "pinned-ending")
        assert "Largest error of omega: 0.02 rad/s." in text_of(browser, "status")
        over = browser.find_element(By.CSS_SELECTOR, "#omega1-chart .u-over")
        ActionChains(browser).move_to_element(over).perform()
        told = text_of(browser, "readout")
        step = round(float(told.split(" s: ")[0]) / 0.01)
        first, second = (
            run_program(case_scene(2), subset("runge-kutta", fix=fix), "python", may_stop=False)
            for fix in (["stage-base"], [])
        )
        own, other = (run.omega[step - 1, 0] for run in (first, second))
        assert f"pinned {other:.5g}" in told
        assert f"difference: U1 {own - other:.5g}" in told
        laboratory(f"#{words}")
    browser.find_element(By.ID, "unpin").click()
    assert fragment(browser) == words.removesuffix(f"&{pinned}")
    assert not browser.find_element(By.ID, "difference").is_displayed()
    assert browser.switch_to.active_element.get_dom_attribute("id") == "pin"


@pytest.mark.campaign
def test_the_limit_is_told(browser: Chrome, laboratory: Open) -> None:
    for words, told, shown in (
        ("", "2 y(t/2) - y(0)", True),
        ("listing=corrected", "this program converges to the solution", False),
        ("case=1", "In this case both are the same function", False),
        ("case=7&program=two-term", "converges to no function", False),
        ("reading=do-variable", "We have not worked out the limit", False),
        ("case=5&program=two-term", "to the solution of another equation", True),
    ):
        laboratory(f"#{words}")
        assert told in text_of(browser, "limit")
        assert browser.find_element(By.ID, "show-limit").is_enabled() == shown
    assert not browser.find_element(By.ID, "quotient").is_displayed()


_LISTING = "return document.querySelector('input[name=listing]:checked').value"
_SWITCHES = """
return [...document.querySelectorAll("fieldset.switches")].map((group) =>
  [...group.querySelectorAll(".reason")].map((each) => each.textContent !== ""));
"""


@pytest.mark.campaign
def test_some_faults_are_a_state_of_their_own(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=2&program=runge-kutta&listing=original")
    some = browser.find_element(By.CSS_SELECTOR, "input[name=listing][value=some]")
    assert (browser.execute_script(_LISTING), some.is_enabled()) == ("original", False)
    _click(browser, "input[value=stage-base]")
    assert (browser.execute_script(_LISTING), some.is_enabled()) == ("some", True)
    assert "some faults" in text_of(browser, "sheet-told")
    _click(browser, "input[value=stage-base]")
    assert browser.execute_script(_LISTING) == "original"
    _click(browser, "input[name=listing][value=corrected]")
    assert browser.execute_script(_LISTING) == "corrected"
    # A start that we supply is marked, and not one of the reader's.
    for case, told in ((2, ""), (3, "its initial omega"), (7, "its initial omega and its cards")):
        Select(browser.find_element(By.ID, "case")).select_by_value(str(case))
        assert text_of(browser, "assumed-what") == told
        assert browser.find_element(By.ID, "assumed-case").is_displayed() == (told != "")
    # So is what a run of the printed cards depends on.
    laboratory("#case=2&program=runge-kutta&listing=original")
    assert text_of(browser, "assumed-what") == "I after the DO loop of runge-kutta, its last value"
    laboratory("#case=3&program=runge-kutta&listing=original")
    assert text_of(browser, "assumed-what").startswith("its initial omega; I after the DO loop")
    laboratory("#case=3&program=two-term&listing=original")
    assert text_of(browser, "assumed-what").endswith("C, not C1, on card 770 of two-term")
    laboratory("#case=3&program=runge-kutta&listing=original&omega0=1,2,3")
    assert not browser.find_element(By.ID, "assumed-case").is_displayed()


@pytest.mark.campaign
def test_choices_without_effect_are_last(browser: Chrome, laboratory: Open) -> None:
    for program in PROGRAMS:
        laboratory(f"#case=2&program={program}&listing=original")
        _wait(browser, lambda: any(map(any, browser.execute_script(_SWITCHES))))
        assert all(idle == sorted(idle) for idle in browser.execute_script(_SWITCHES)), program


@pytest.mark.campaign
def test_a_switch_that_does_nothing_says_so(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=2&program=runge-kutta&listing=original")
    box = browser.find_element(By.CSS_SELECTOR, "input[value=torque-held]")
    label = box.find_element(By.XPATH, "..")
    _wait(browser, lambda: "No effect here: it changes no number of this run." in label.text)
    assert "idle" in str(label.get_dom_attribute("class"))
    # It can still be switched, because two such switches together may do something.
    assert box.is_enabled()
    Select(browser.find_element(By.ID, "case")).select_by_value("7")
    _wait(browser, lambda: "No effect here" not in label.text)
    assert "idle" not in str(label.get_dom_attribute("class"))


@pytest.mark.campaign
@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda each: each["id"])
def test_guided_experiment(browser: Chrome, laboratory: Open, experiment: dict[str, Any]) -> None:
    laboratory("")
    lesson = browser.find_element(By.ID, f"experiment-{experiment['id']}")
    assert not lesson.is_displayed()
    button = browser.find_element(By.CSS_SELECTOR, f"[aria-controls=experiment-{experiment['id']}]")
    button.send_keys(Keys.ENTER)
    assert lesson.is_displayed()
    assert experiment["explanation"] not in lesson.text
    run = lesson.find_element(By.CSS_SELECTOR, "a.run")
    run.click()
    assert "Choose a prediction first." in lesson.text
    wrong = 1 if experiment["answer"] != 1 else 2
    choices = lesson.find_elements(By.CSS_SELECTOR, "input")
    choices[wrong - 1].click()
    run.click()
    right = experiment["choices"][experiment["answer"] - 1]
    assert f"Your prediction was wrong. Right: {right}" in lesson.text
    assert experiment["explanation"] in lesson.text
    assert fragment(browser) == experiment["state"]
    choices[experiment["answer"] - 1].click()
    run.send_keys(Keys.ENTER)
    assert "Your prediction was right." in lesson.text
    expected = experiment["expect"]
    assert f"Largest error of omega: {expected['error']} rad/s." in text_of(browser, "status")
    if expected["ended"] == "stopped":
        assert f"Stopped at step {expected['steps']} of" in text_of(browser, "status")


@pytest.mark.campaign
def test_on_a_phone_the_choices_are_beside_the_chart(browser: Chrome, laboratory: Open) -> None:
    with screen(browser, 360):
        laboratory("")
        box = browser.find_element(By.CSS_SELECTOR, "input[value=stage-base]")
        assert not box.is_displayed()
        chart = browser.find_element(By.ID, "omega1-chart")
        browser.execute_script("arguments[0].scrollIntoView()", chart)
        sheet = browser.find_element(By.ID, "sheet")
        assert sheet.text.startswith("Case 2, runge-kutta, original: stopped at step 25")
        sheet.send_keys(Keys.ENTER)
        assert sheet.get_dom_attribute("aria-expanded") == "true"
        before = browser.execute_script(_DRAWN)
        box.click()
        _wait_for_drawing(browser, before)
        where = "const r = arguments[0].getBoundingClientRect(); return [r.top, r.bottom]"
        top, bottom = browser.execute_script(where, chart)
        above, _ = browser.execute_script(where, browser.find_element(By.ID, "choices"))
        assert 0 <= top < bottom <= above
        assert "fix=stage-base" in fragment(browser)
        assert too_wide(browser) <= 0
        sheet.click()
        assert not box.is_displayed()


def test_controls_make_the_address_that_restores_them(browser: Chrome, laboratory: Open) -> None:
    laboratory("")
    for id, keys in (
        ("omega0", "-1, 0.5, 2e0"), ("step-size", "0.005"), ("steps", "40"), ("lipschitz", "60"),
    ):  # fmt: skip
        field = browser.find_element(By.ID, id)
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys(keys, Keys.TAB)
    _click(browser, "input[value=corrected]")
    expected = "case=2&program=runge-kutta&listing=corrected&omega0=-1,0.5,2&step-size=0.005"
    assert fragment(browser) == f"{expected}&steps=40&lipschitz=60"
    told = text_of(browser, "status")
    laboratory(f"#{fragment(browser)}")
    assert text_of(browser, "status") == told
    _click(browser, "#reset")
    assert fragment(browser) == "case=2&program=runge-kutta&listing=original"


def test_what_is_wrong_stays_until_it_is_mended(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=2&program=runge-kutta&listing=original&fix=stage-base")
    field = browser.find_element(By.ID, "steps")
    field.send_keys("x", Keys.TAB)
    # Another control changes the run, and leaves the invalid field unchanged.
    program = Select(browser.find_element(By.ID, "program"))
    program.select_by_visible_text("two-term")
    assert "steps: '100x'" in text_of(browser, "problems")
    assert field.get_property("value") == "100x"
    browser.find_element(By.ID, "step-size").send_keys("y", Keys.TAB)
    assert "steps: '100x'" in text_of(browser, "problems")
    assert "step-size: '0.01y'" in text_of(browser, "problems")
    # The page has kept the switches of the other program.
    program.select_by_visible_text("runge-kutta")
    assert browser.current_url.endswith("listing=original&fix=stage-base")
    _click(browser, "#reset")
    assert text_of(browser, "problems") == ""
    assert field.get_property("value") == "100"
    # An address with mistakes.
    laboratory("#case=9&program=runge-kutta&listing=original&spin=1")
    assert text_of(browser, "problems").startswith("unknown word 'spin'; allowed: ")
    assert "case: unknown '9'; allowed: 1, 2" in text_of(browser, "problems")
    assert "Stopped at step 25" in text_of(browser, "status")
    field = browser.find_element(By.ID, "steps")
    field.send_keys("x", Keys.TAB)
    assert "steps: '100x'; allowed: a whole number" in text_of(browser, "problems")
    assert field.get_attribute("aria-invalid") == "true"
    field.send_keys(Keys.BACKSPACE, Keys.TAB)
    assert text_of(browser, "problems") == ""
    assert field.get_attribute("aria-invalid") is None


@pytest.mark.campaign
def test_nothing_is_wider_than_the_page(browser: Chrome, laboratory: Open) -> None:
    for width in WIDTHS:
        with screen(browser, width):
            laboratory("#case=7&program=two-term&listing=original")
            _rows(browser)
            assert too_wide(browser) <= 0, width
            assert browser.execute_script(UNNAMED) == []
    laboratory("")
    before = browser.execute_script(_DRAWN)
    _click(browser, "#theme")
    assert browser.execute_script(_DRAWN) != before
    _click(browser, "#theme")
    assert browser.execute_script(_DRAWN) == before
