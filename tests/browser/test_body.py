"""The tumbling body in a browser: drawings, controls, addresses, and when it moves."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from selenium.webdriver import Chrome, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from pyharness import Scene, case_scene, solve
from pyharness.checks.theory.flips import flip_times
from tests.browser.screen import (
    UNNAMED,
    WIDTHS,
    fragment,
    opening,
    screen,
    text_of,
    too_wide,
    without_scripts,
)

Open = Callable[[str], None]
CANVASES = ("space", "polhode", "herpolhode")


@pytest.fixture
def body(browser: Chrome, site: Path) -> Iterator[Open]:
    with opening(browser, site / "body.html") as opened:
        yield opened


def _drawn(browser: Chrome, id: str) -> int:
    """Return the number of pixels of a canvas that are drawn."""
    script = """const canvas = document.getElementById(arguments[0]);
      const { width, height } = canvas;
      const copy = new OffscreenCanvas(width, height).getContext("2d");
      copy.drawImage(canvas, 0, 0);
      const { data } = copy.getImageData(0, 0, width, height);
      return data.filter((x, n) => n % 4 === 3 && x > 0).length;"""
    found: int = browser.execute_script(script, id)
    return found


def _numbers(browser: Chrome, id: str) -> list[float]:
    return [float(x) for x in text_of(browser, id).removesuffix(" rad/s").split(", ")]


def _picture(browser: Chrome, id: str) -> str:
    script = "return document.getElementById(arguments[0]).toDataURL()"
    return str(browser.execute_script(script, id))


def _enter(browser: Chrome, id: str, keys: str) -> None:
    field = browser.find_element(By.ID, id)
    field.send_keys(Keys.CONTROL, "a")
    field.send_keys(keys, Keys.TAB)


def _slide(browser: Chrome, id: str, value: int) -> None:
    script = """const slider = document.getElementById(arguments[0]);
      slider.value = arguments[1];
      slider.dispatchEvent(new Event("input", { bubbles: true }));"""
    browser.execute_script(script, id, value)


@pytest.mark.campaign
def test_the_drawings_show_the_state_of_the_address(browser: Chrome, body: Open) -> None:
    body("#body=case-4&time=1000000")
    found = solve(case_scene(4), [1e6], "closed-form", attitude=True)
    assert found.attitude is not None
    assert _numbers(browser, "at-omega") == pytest.approx(found.omega[0].tolist(), abs=1e-6)
    assert _numbers(browser, "at-attitude") == pytest.approx(found.attitude[0].tolist(), abs=1e-6)
    flip = float(flip_times((40, 30, 20), (0, 1, 10))[0])
    assert f"changes its sign every {flip:.3f} s: this is the flip" in text_of(browser, "told")
    assert "Time: 1000000 s; omega" in text_of(browser, "status")
    assert "Digits that remain" in text_of(browser, "status")
    assert text_of(browser, "problems") == ""
    for id in CANVASES:
        assert _drawn(browser, id) > 500, id


def test_every_body_is_drawn_and_in_the_address(browser: Chrome, body: Open) -> None:
    body("")
    choice = Select(browser.find_element(By.ID, "body"))
    names = [str(each.get_dom_attribute("value")) for each in choice.options]
    assert names == ["", "racket", "cube", "case-2", "case-3", "case-4"]
    seen = set()
    for name in [*names[2:], names[1], "case-4"]:
        choice.select_by_value(name)
        assert fragment(browser) == f"body={name}"
        assert text_of(browser, "problems") == ""
        assert _drawn(browser, "space") > 1000
        seen.add(_picture(browser, "space"))
    assert len(seen) == 5
    assert choice.first_selected_option.text.startswith("Case 4")


@pytest.mark.campaign
def test_dragging_the_time_draws_at_once(browser: Chrome, body: Open) -> None:
    body("#body=racket")
    before = [_picture(browser, id) for id in CANVASES]
    _slide(browser, "slider", 801)
    assert fragment(browser) == "body=racket&time=1000000"
    assert text_of(browser, "at-time") == "1000000 s"
    after = [_picture(browser, id) for id in CANVASES]
    assert all(old != new for old, new in zip(before, after, strict=True))
    slider = browser.find_element(By.ID, "slider")
    assert slider.get_dom_attribute("aria-valuetext") == "1000000 s"
    assert not browser.find_element(By.ID, "flip").is_enabled()
    for value in (0, 1, 300, 800):
        _slide(browser, "slider", value)
        assert slider.get_property("value") == str(value)
    # The keyboard moves it too.
    _slide(browser, "slider", 300)
    old = text_of(browser, "at-time")
    slider.send_keys(Keys.ARROW_RIGHT)
    assert text_of(browser, "at-time") != old
    body(f"#{fragment(browser)}")
    assert browser.find_element(By.ID, "slider").get_property("value") == "301"


@pytest.mark.campaign
def test_the_next_flip_is_a_flip(browser: Chrome, body: Open) -> None:
    body("#body=racket")
    flip = float(flip_times((0.0015725, 0.01226, 0.0138125), (0.02, 6.0, 0.0))[0])
    times = []
    for _ in range(3):
        browser.find_element(By.ID, "flip").click()
        assert abs(_numbers(browser, "at-omega")[1]) < 1e-6
        times.append(float(text_of(browser, "at-time").removesuffix(" s")))
    assert np.diff(times) == pytest.approx([flip, flip], rel=1e-9)


@pytest.mark.campaign
def test_fields_take_any_body_and_say_what_is_wrong(browser: Chrome, body: Open) -> None:
    body("#body=case-4")
    _enter(browser, "moments", "10, 20, 40")
    assert text_of(browser, "problems") == (
        "moments: 10 + 20 is less than 40; each moment is at most the sum of the other two"
    )
    field = browser.find_element(By.ID, "moments")
    assert field.get_dom_attribute("aria-invalid") == "true"
    _enter(browser, "time", "1e7")
    assert "time: 10000000; allowed: a number from 0 to 1000000" in text_of(browser, "problems")
    assert fragment(browser) == "body=case-4"
    _enter(browser, "moments", "5, 4, 3")
    _enter(browser, "omega0", "-1, 2, 3")
    _enter(browser, "time", "1e5")
    assert text_of(browser, "problems") == ""
    assert field.get_dom_attribute("aria-invalid") is None
    assert fragment(browser) == "moments=5,4,3&omega0=-1,2,3&time=100000"
    assert browser.find_element(By.ID, "body").get_property("value") == ""
    found = solve(Scene("", (-1, 2, 3), moments=(5, 4, 3)), [1e5], "closed-form")
    assert _numbers(browser, "at-omega") == pytest.approx(found.omega[0].tolist(), abs=1e-6)
    assert "moments = [5, 4, 3]" in text_of(browser, "scene")
    assert browser.find_element(By.ID, "scene-file").is_displayed()
    # Mistakes in the address.
    body("#body=brick&time=x&spin=1")
    told = text_of(browser, "problems")
    assert told.startswith("unknown word 'spin'; allowed: ")
    assert "body: unknown 'brick'; allowed: racket" in told
    assert "time: 'x' where a number belongs" in told
    assert text_of(browser, "at-time") == "0 s"
    browser.execute_script("location.hash = 'body=cube'")
    WebDriverWait(browser, 5).until(lambda _: "steady" in text_of(browser, "told"))
    assert text_of(browser, "problems") == ""
    assert not browser.find_element(By.ID, "flip").is_enabled()


@pytest.mark.campaign
def test_special_motions_are_drawn_and_told(browser: Chrome, body: Open) -> None:
    for words, told in (
        ("moments=4,6.5,9&omega0=3,1,-2", "on the separatrix: it approaches a spin about axis 2"),
        ("moments=40,30,20&omega0=0,0,0", "This rotation is steady"),
        ("moments=40,30,20&omega0=0,7,0", "This rotation is steady"),
        ("moments=40,30,20&omega0=0,0,-3", "This rotation is steady"),
        ("body=case-2", "Two moments are equal"),
        ("moments=3,2,1&omega0=2,1,0.1", "Omega circles axis 1, which has the largest moment."),
        ("moments=2,1,1&omega0=1,0.5,0.1&time=1e5", "Two moments are equal"),
    ):
        body(f"#{words}")
        assert told in text_of(browser, "told")
        assert "NaN" not in browser.find_element(By.TAG_NAME, "main").text
        for id in CANVASES:
            assert _drawn(browser, id) > 20, (id, words)


@pytest.mark.campaign
def test_it_moves_when_it_is_played(browser: Chrome, body: Open) -> None:
    """The browser of the tests prefers reduced motion, so that nothing moves before."""
    body("#body=racket")
    still = _picture(browser, "space")
    time.sleep(0.3)
    assert text_of(browser, "at-time") == "0 s"
    assert _picture(browser, "space") == still
    Select(browser.find_element(By.ID, "speed")).select_by_value("10")
    play = browser.find_element(By.ID, "play")
    assert play.text == "Play"
    play.click()
    assert play.text == "Pause"
    assert text_of(browser, "status") == "Playing."
    WebDriverWait(browser, 5).until(lambda _: float(text_of(browser, "at-time")[:-2]) > 1.0)
    assert _picture(browser, "space") != still
    play.click()
    stopped = text_of(browser, "at-time")
    assert f"&time={stopped.removesuffix(' s')}" in fragment(browser)
    assert stopped in text_of(browser, "status")
    time.sleep(0.3)
    assert text_of(browser, "at-time") == stopped
    # At a million seconds it stops.
    _enter(browser, "time", "999999.9")
    play.click()
    WebDriverWait(browser, 5).until(lambda _: text_of(browser, "at-time") == "1000000 s")
    WebDriverWait(browser, 5).until(lambda _: play.text == "Play")


@pytest.mark.campaign
def test_it_starts_only_where_motion_is_welcome(browser: Chrome, body: Open) -> None:
    """Neither for a reader who wants little motion, nor if the address names a time."""
    features = [{"name": "prefers-reduced-motion", "value": "no-preference"}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    try:
        body("#body=case-4")
        assert text_of(browser, "play") == "Pause"
        WebDriverWait(browser, 5).until(lambda _: text_of(browser, "at-time") != "0 s")
        # A drawing that is out of sight does not move.
        down = "window.scrollTo({ top: document.body.scrollHeight, behavior: 'instant' })"
        browser.execute_script(down)
        time.sleep(0.7)
        before = text_of(browser, "at-time")
        time.sleep(0.5)
        assert text_of(browser, "at-time") == before
        body("#body=case-4&time=2")
        assert text_of(browser, "play") == "Play"
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.campaign
def test_nothing_is_wider_than_the_page(browser: Chrome, body: Open) -> None:
    for width in WIDTHS:
        with screen(browser, width):
            body("#moments=40,30,20&omega0=0.123456789,-1,10&time=123456.789")
            assert too_wide(browser) <= 0, width
            assert browser.execute_script(UNNAMED) == []
            for id in CANVASES:
                assert _drawn(browser, id) > 500, (id, width)


@pytest.mark.campaign
def test_without_scripts_there_is_a_picture(browser: Chrome, site: Path) -> None:
    with without_scripts(browser):
        browser.get((site / "body.html").as_uri())
        image = browser.find_element(By.CSS_SELECTOR, "main img")
        assert image.is_displayed()
        assert "polhode" in str(image.get_dom_attribute("alt"))
        assert "changes its sign every" in browser.find_element(By.TAG_NAME, "figcaption").text
        assert not browser.find_element(By.ID, "tumbling").is_displayed()


@pytest.mark.campaign
def test_colours_change_with_the_theme_and_the_viewpoint_turns(browser: Chrome, body: Open) -> None:
    body("#body=case-4&time=1")
    before = _picture(browser, "space")
    browser.execute_script("document.getElementById('theme').click()")
    assert _picture(browser, "space") != before
    browser.execute_script("document.getElementById('theme').click()")
    assert _picture(browser, "space") == before
    _slide(browser, "view", -100)
    assert _picture(browser, "space") != before
    assert fragment(browser) == "body=case-4&time=1"
