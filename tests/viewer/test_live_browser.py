"""Live pages as people see them: sliders are moved, and new plans, or sentences, are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser

import aerobat as ab
from aerobat.viewer.live.view_live import LiveView
from browsers import LAPTOP, PHONE, Seen, open_browser
from shared_plans import shared_plan

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as found:
        yield found


@pytest.fixture(scope="module")
def live() -> Iterator[LiveView]:
    with ab.view_live(shared_plan("half-flip"), ab.Miqp(), browser=False) as view:
        yield view


@pytest.fixture
def show(browser: Browser, live: LiveView) -> Iterator[Callable[..., Seen]]:
    """Open the live page in a window of some size, with its flight halted."""
    opened: list[Seen] = []

    def opening(size: tuple[int, int] = LAPTOP) -> Seen:
        seen = Seen.watching(browser.new_page(viewport={"width": size[0], "height": size[1]}))
        opened.append(seen)
        seen.page.goto(live.address)
        seen.until("window.live && replay.frames > 0")
        assert seen.page.evaluate("replay.playing && replay.repeats"), "it flies by itself, again and again"
        seen.do("replay.toggle()")
        return seen

    yield opening
    for seen in opened:
        assert not seen.faults
        assert all(url.startswith(live.address) for url in seen.asked)
        seen.page.close()


def slide(seen: Seen, key: str, value: float) -> None:
    """Move a slider as a pointer does, and wait for what comes of it."""
    script = (
        "([key, value]) => { const { input } = live.sliders.get(key); input.value = value; input.oninput() }"
    )
    seen.page.evaluate(script, [key, value])
    seen.until("!document.querySelector('#verdict.busy') && !replay.stale")


def verdict(seen: Seen) -> tuple[str, str]:
    return seen.page.inner_text("#verdict h2"), seen.page.inner_text("#verdict p")


def path(seen: Seen) -> Any:
    """Where the page's vehicle flies."""
    return np.array(seen.page.evaluate("[...values(HEADER.planned)]")).reshape(-1, 3)


@pytest.mark.parametrize("size", [LAPTOP, PHONE], ids=["laptop", "phone"])
def test_a_slider_that_is_moved_shows_another_plan_in_the_same_page(show, size) -> None:
    seen = show(size)
    assert len(np.unique(seen.picture().reshape(-1, 3), axis=0)) > 200, "a blank canvas has a few shades"
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    before, duration, picture = verdict(seen), seen.page.evaluate("DURATION"), seen.picture()
    assert before[0] == "Feasible"
    assert "within its limit" in before[1], "the bound that binds is named"
    slide(seen, "gates[0].position.z", 5.0)
    assert np.abs(path(seen)[:, 2]).max() == pytest.approx(5.0, abs=0.5)
    assert np.linalg.norm(path(seen) - [2.5, 2.0, 5.0], axis=1).min() < 0.05, "it goes through the gate there"
    assert seen.page.evaluate("DURATION") > duration
    assert verdict(seen) != before
    assert seen.page.inner_text("#facts").find(f"{seen.page.evaluate('DURATION'):.3f} s") > 0
    assert np.abs(seen.picture().astype(int) - picture).max() > 50
    assert seen.page.evaluate("window.live.player === replay && replay.frames") > 1, "no page was loaded anew"
    seen.page.click("#reset")
    seen.until("!document.querySelector('#verdict.busy') && !replay.stale")
    assert verdict(seen) == before
    assert seen.page.evaluate("DURATION") == duration
    assert seen.page.locator("#reset").is_disabled()


def test_what_cannot_be_flown_is_said_in_a_sentence_and_the_last_plan_stays_faintly(show) -> None:
    seen = show()
    slide(seen, "maneuver.min_lateral_thrust", 38.0)
    assert verdict(seen)[0] == "Infeasible"
    assert "agile-quad gives 32" in verdict(seen)[1]
    assert seen.page.evaluate("getComputedStyle(document.getElementById('canvas')).opacity") == "0.35"
    slide(seen, "gates[0].tilt", 130.0)
    assert verdict(seen)[0] == "Refused"
    slide(seen, "maneuver.min_lateral_thrust", 10.0)
    slide(seen, "gates[0].tilt", 70.0)
    assert verdict(seen)[0] == "Feasible"
    assert seen.page.evaluate("getComputedStyle(document.getElementById('canvas')).opacity") == "1"


def test_the_gate_goes_with_its_sliders_before_anything_is_planned(show) -> None:
    seen = show()
    place = "replay.world.gates.children[0].children[0].matrix.toArray()"
    seen.page.evaluate("live.ask = () => {}")
    for key, value in (("gates[0].position.x", 1.5), ("gates[0].tilt", 60.0)):
        seen.page.evaluate(f"live.move('{key}', {value})")
    shown = np.array(seen.do(place)).reshape(4, 4).T
    gate = ab.tilted_gate((1.5, 2.0, 3.5), tilt=np.radians(60.0))
    np.testing.assert_allclose(shown[:3, 3], gate.position, atol=1e-9)
    np.testing.assert_allclose(shown[:3, 2], gate.up, atol=1e-9)
    np.testing.assert_allclose(shown[:3, 0], gate.normal, atol=1e-9)


def test_the_next_plan_is_drawn_by_the_programs_of_the_last(show) -> None:
    """Software compiles them for seconds."""
    seen = show()
    slide(seen, "gates[0].position.z", 3.0)
    seen.page.evaluate(
        "() => { window.linked = 0; const gl = replay.renderer.getContext();"
        "const link = gl.linkProgram.bind(gl);"
        "gl.linkProgram = (program) => ((window.linked += 1), link(program)) }"
    )
    for height in (3.2, 4.0):
        slide(seen, "gates[0].position.z", height)
        assert seen.page.evaluate("window.linked") == 0


def test_of_many_values_in_quick_succession_the_last_one_is_shown(show) -> None:
    seen = show()
    seen.page.evaluate("for (const z of [3, 3.2, 4.1, 4.6, 4.8, 3.7]) live.move('gates[0].position.z', z)")
    seen.until("!document.querySelector('#verdict.busy')")
    assert seen.page.evaluate("HEADER.gates[0].position[2]") == 3.7
    assert seen.page.evaluate("live.answered") == 1


def test_a_focused_slider_is_moved_by_keys_and_time_is_not(show) -> None:
    seen = show()
    seen.do("replay.seek(1)")
    seen.page.locator("[name='gates[0].position.y']").focus()
    seen.page.keyboard.press("ArrowRight")
    seen.page.keyboard.press("ArrowRight")
    assert seen.page.evaluate("live.moved['gates[0].position.y']") == pytest.approx(2.2)
    assert seen.time == 1.0
    seen.until("!document.querySelector('#verdict.busy')")


def test_dispersed_flights_are_shown_together(show) -> None:
    seen = show()
    slide(seen, "dispersion", 0.5)
    assert seen.page.evaluate("TRACKS.length") == 20
    assert seen.page.locator("#choice").is_visible()
    assert "flights" in seen.page.inner_text("#title")


def test_a_server_that_is_gone_is_said(browser: Browser) -> None:
    page = browser.new_page()
    with ab.view_live(shared_plan("line"), browser=False) as view:
        seen = Seen.watching(page)
        page.goto(view.address)
        seen.until("window.live && replay.frames > 0")
    slide(seen, "vehicle.thrust_to_weight", 4.0)
    assert verdict(seen)[0] == "No answer"
    assert "start aerobat view --live again" in verdict(seen)[1]
    page.close()
