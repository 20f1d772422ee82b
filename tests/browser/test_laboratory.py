"""The laboratory in a browser: numbers, switches, addresses, and the time that a change takes."""

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from selenium.webdriver import ActionChains, Chrome, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from pyharness import case_scene, run_program
from pyharness.model.listing import PROGRAMS, subset
from pyharness.original.printer import page
from tests.browser.screen import WIDTHS, errors, screen, too_wide

Open = Callable[[str], None]


@pytest.fixture
def laboratory(browser: Chrome, site: Path) -> Iterator[Open]:
    """Yield a function that loads the page with a fragment; its console must stay empty."""

    def opened(fragment: str = "") -> None:
        # Changing only the fragment would not reload the page.
        browser.get("about:blank")
        browser.get(f"{(site / 'laboratory.html').as_uri()}{fragment}")

    errors(browser)
    yield opened
    assert errors(browser) == []


def _text(browser: Chrome, id: str) -> str:
    return str(
        browser.execute_script("return document.getElementById(arguments[0]).textContent", id)
    )


def _rows(browser: Chrome) -> list[list[str]]:
    """Open the table and return the text of its cells."""
    browser.execute_script("document.getElementById('numbers').open = true")
    read = (
        "return [...document.querySelectorAll('#rows tr')]"
        ".map((row) => [...row.cells].map((cell) => cell.textContent))"
    )
    # The page fills the table after the browser has reported that it was opened.
    deadline = time.monotonic() + 5.0
    while True:
        found: list[list[str]] = browser.execute_script(read)
        if len(found) > 6 or time.monotonic() > deadline:
            return found
        time.sleep(0.02)


def _fragment(browser: Chrome) -> str:
    return browser.current_url.partition("#")[2]


def _click(browser: Chrome, selector: str) -> None:
    browser.execute_script("document.querySelector(arguments[0]).click()", selector)


def test_the_numbers_are_the_twins(browser: Chrome, laboratory: Open) -> None:
    laboratory("")
    twin = run_program(case_scene(2), subset("runge-kutta"), "python")
    assert twin.velocity is not None
    rows = _rows(browser)
    assert len(rows) == 25
    assert [float(row[2]) for row in rows] == twin.omega[:, 0].tolist()
    assert [[float(x) for x in row[5:8]] for row in rows] == twin.velocity.tolist()
    assert "Stopped at step 25 of 100, at 0.25 s, by V2" in _text(browser, "status")
    assert _text(browser, "printer-page") == page(case_scene(2), "runge-kutta", twin)
    assert _text(browser, "problems") == ""
    assert browser.execute_script("return document.querySelectorAll('canvas').length") == 2


def test_a_switch_draws_anew_and_is_in_the_address(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=2&program=runge-kutta&listing=original")
    draw = "return document.querySelector('canvas').toDataURL()"
    before = browser.execute_script(draw)
    _click(browser, "input[value=stage-base]")
    assert _fragment(browser) == "case=2&program=runge-kutta&listing=original&fix=stage-base"
    assert "step 25 " not in _text(browser, "status")
    twin = run_program(case_scene(2), subset("runge-kutta", fix=["stage-base"]), "python")
    assert [float(row[2]) for row in _rows(browser)] == twin.omega[:, 0].tolist()
    assert _text(browser, "command").endswith("--listing original --fix stage-base")
    assert browser.execute_script(draw) != before


def test_an_address_restores_its_state(browser: Chrome, laboratory: Open) -> None:
    words = "case=5&program=two-term&listing=corrected&keep=x3-reads-acl2&steps=30"
    laboratory(f"#{words}")
    assert browser.find_element(By.ID, "case").get_property("value") == "5"
    assert browser.find_element(By.ID, "steps").get_property("value") == "30"
    on = "return [...document.querySelectorAll('input[name=switch]:checked')].map((x) => x.value)"
    assert browser.execute_script(on) == ["x3-reads-acl2"]
    assert not browser.find_element(By.ID, "stop-test").is_displayed()
    assert not browser.find_element(By.CSS_SELECTOR, "[value=stage-base]").is_displayed()
    assert len(_rows(browser)) == 30
    # Change the fragment without reloading the page.
    browser.execute_script("location.hash = 'case=2&program=runge-kutta&listing=original'")
    deadline = time.monotonic() + 5.0
    while "step 25" not in _text(browser, "status") and time.monotonic() < deadline:
        time.sleep(0.02)
    assert "Stopped at step 25" in _text(browser, "status")
    assert browser.find_element(By.ID, "stop-test").is_displayed()


def test_the_link_that_skips_the_menu_leaves_the_state(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=5&program=two-term&listing=corrected")
    told = _text(browser, "status")
    address = browser.current_url
    _click(browser, "a.skip")
    time.sleep(0.1)
    assert browser.switch_to.active_element.get_dom_attribute("id") == "main"
    # The address still names the state, so that it can be cited.
    assert browser.current_url == address
    browser.refresh()
    assert _text(browser, "status") == told
    assert _text(browser, "problems") == ""


def test_what_has_the_focus_is_in_sight(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=7&program=runge-kutta&listing=original")
    browser.find_element(By.ID, "case").click()
    in_sight = (
        "const r = document.activeElement.getBoundingClientRect();"
        "return r.bottom > 0 && r.top < innerHeight && [document.activeElement.id]"
    )
    seen = set()
    for _ in range(60):
        ActionChains(browser, 0).send_keys(Keys.TAB).perform()
        # A page may still be scrolling.
        seen.update(WebDriverWait(browser, 3.0).until(lambda _: browser.execute_script(in_sight)))
    assert {"omega0", "lipschitz", "address", "printer-page"} <= seen


def test_components_can_be_hidden_and_the_pointer_tells_numbers(
    browser: Chrome, laboratory: Open
) -> None:
    laboratory("")
    draw = "return document.querySelector('canvas').toDataURL()"
    before = browser.execute_script(draw)
    _click(browser, "input[name=component]:nth-of-type(1)")
    assert browser.execute_async_script(
        "const done = arguments[0]; requestAnimationFrame(() => done(true))"
    )
    assert browser.execute_script(draw) != before
    over = browser.find_element(By.CSS_SELECTOR, "#omega-chart .u-over")
    ActionChains(browser).move_to_element(over).perform()
    assert re.match(r"0\.\d+ s: U1 .*\(solution ", _text(browser, "readout"))


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
    assert _fragment(browser) == f"{expected}&steps=40&lipschitz=60"
    told = _text(browser, "status")
    laboratory(f"#{_fragment(browser)}")
    assert _text(browser, "status") == told
    _click(browser, "#reset")
    assert _fragment(browser) == "case=2&program=runge-kutta&listing=original"


def test_mistakes_are_told_and_the_rest_holds(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=9&program=runge-kutta&listing=original&spin=1")
    assert _text(browser, "problems").startswith("unknown word 'spin'; allowed: ")
    assert "case: unknown '9'; allowed: 1, 2" in _text(browser, "problems")
    assert "Stopped at step 25" in _text(browser, "status")
    field = browser.find_element(By.ID, "steps")
    field.send_keys("x", Keys.TAB)
    assert "steps: '100x'; allowed: a whole number" in _text(browser, "problems")
    assert field.get_attribute("aria-invalid") == "true"
    field.send_keys(Keys.BACKSPACE, Keys.TAB)
    assert _text(browser, "problems") == ""
    assert field.get_attribute("aria-invalid") is None


def test_what_is_wrong_stays_until_it_is_mended(browser: Chrome, laboratory: Open) -> None:
    laboratory("#case=2&program=runge-kutta&listing=original&fix=stage-base")
    field = browser.find_element(By.ID, "steps")
    field.send_keys("x", Keys.TAB)
    # Another control changes the run, and leaves the invalid field unchanged.
    program = Select(browser.find_element(By.ID, "program"))
    program.select_by_visible_text("two-term")
    assert "steps: '100x'" in _text(browser, "problems")
    assert field.get_property("value") == "100x"
    step = browser.find_element(By.ID, "step-size")
    step.send_keys("y", Keys.TAB)
    assert "steps: '100x'" in _text(browser, "problems")
    assert "step-size: '0.01y'" in _text(browser, "problems")
    # The page has kept the switches of the other program.
    program.select_by_visible_text("runge-kutta")
    assert browser.current_url.endswith("listing=original&fix=stage-base")
    _click(browser, "#reset")
    assert _text(browser, "problems") == ""
    assert field.get_property("value") == "100"


def test_every_control_has_a_name_and_nothing_is_wider_than_the_page(
    browser: Chrome, laboratory: Open
) -> None:
    laboratory("#case=7&program=two-term&listing=original")
    unnamed = (
        "return [...document.querySelectorAll('.controls :is(input, select)')]"
        ".filter((x) => x.labels.length === 0).map((x) => x.id)"
    )
    assert browser.execute_script(unnamed) == []
    for width in WIDTHS:
        with screen(browser, width):
            laboratory("#case=7&program=two-term&listing=original")
            _rows(browser)
            assert too_wide(browser) <= 0, width


def test_colours_change_with_the_theme(browser: Chrome, laboratory: Open) -> None:
    laboratory("")
    draw = "return document.querySelector('canvas').toDataURL()"
    before = browser.execute_script(draw)
    _click(browser, "#theme")
    assert browser.execute_script(draw) != before
    _click(browser, "#theme")
    assert browser.execute_script(draw) == before


def test_without_script_the_default_state_is_there(site: Path) -> None:
    text = (site / "laboratory.html").read_text()
    assert "step 25 by V2" in re.sub(r"\s+", " ", text)
    twin = run_program(case_scene(2), subset("runge-kutta"), "python")
    assert page(case_scene(2), "runge-kutta", twin) in text
    assert repr(float(twin.omega[-1, 0])) in text


def test_how_long_a_change_takes(
    browser: Chrome, laboratory: Open, capsys: pytest.CaptureFixture[str]
) -> None:
    """Print the times without judging them, because they depend on the machine."""
    change = """const done = arguments[arguments.length - 1];
      const box = document.querySelector("input[value=torque-held]");
      const taken = [];
      const again = async () => {
        const begin = performance.now();
        box.click();
        await null;  // the charts draw at the end of the task
        taken.push(performance.now() - begin);
        if (taken.length < 7) requestAnimationFrame(again); else done(taken);
      };
      requestAnimationFrame(again);"""
    lines = []
    for program in PROGRAMS:
        laboratory(f"#case=7&program={program}&listing=original&steps=300")
        taken = browser.execute_async_script(change)
        assert len(taken) == 7
        ordered = sorted(taken)
        lines.append(
            f"{program}: first {taken[0]:.1f} ms, median {ordered[3]:.1f} ms, "
            f"longest {ordered[-1]:.1f} ms"
        )
    with capsys.disabled():
        print("\nCase 7, 300 steps, a change in the page:", *lines, sep="\n  ")
