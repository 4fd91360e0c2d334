"""Replay pages as people see them: opened from the disk by the system's browser, drawn by software."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from playwright.sync_api import Browser

import aerobat as ab
from browsers import LAPTOP, PATIENCE, PHONE, Seen, open_browser, wait
from shared_plans import shared_plan
from viewer_cases import dispersed, flip

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as found:
        yield found


@pytest.fixture(scope="module")
def show(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Seen]]:
    """Open the page of a flight in a window of some size."""
    folder = tmp_path_factory.mktemp("pages")
    opened: list[Seen] = []

    def opening(replay: ab.Replay, size: tuple[int, int] = LAPTOP) -> Seen:
        file = folder / f"{len(opened)}.html"
        file.write_text(replay.html, encoding="utf-8")
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        seen = Seen.watching(page)
        opened.append(seen)
        page.goto(file.as_uri())
        seen.until("window.replay && replay.frames > 0")
        return seen

    yield opening
    for seen in opened:
        assert not seen.faults
        assert len(seen.asked) == 1, "the page itself, and nothing else"
        seen.page.close()


@pytest.fixture(scope="module")
def laptop(show: Callable[..., Seen]) -> Seen:
    """The flip in roll on a laptop."""
    return show(ab.view(*flip()))


@pytest.mark.parametrize("size", [LAPTOP, PHONE], ids=["laptop", "phone"])
def test_the_scene_is_drawn_and_all_of_the_page_is_in_the_window(show, size) -> None:
    seen = show(ab.view(*flip()), size)
    picture = seen.picture()
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 200, "a blank canvas has a few shades"
    width = seen.page.evaluate("document.documentElement.scrollWidth")
    assert width <= size[0], "nothing lies to the side of the window"
    boxes = {
        name: seen.page.locator(name).bounding_box()
        for name in ("#stage", "#plots", "#play", "#time", "#views")
    }
    assert all(box is not None and box["width"] > 0 for box in boxes.values())
    assert boxes["#play"]["y"] + boxes["#play"]["height"] <= size[1], "controls are always in reach"
    beside = boxes["#plots"]["x"] >= boxes["#stage"]["x"] + boxes["#stage"]["width"] - 1
    below = boxes["#plots"]["y"] >= boxes["#stage"]["y"] + boxes["#stage"]["height"] - 1
    assert (beside, below) == ((True, False) if size == LAPTOP else (False, True))
    assert seen.page.locator(".plot").count() == 3


def test_the_vehicle_is_where_and_as_it_was_flown(laptop: Seen) -> None:
    flight, _ = flip()
    for time in np.linspace(0.0, flight.times[-1], 7):
        pose = laptop.do(
            f"(replay.seek({time}), replay.draw(), "
            "[...replay.world.vehicle.position.toArray(), ...replay.world.vehicle.quaternion.toArray()])"
        )
        position = [np.interp(time, flight.times, flight.position[:, i]) for i in range(3)]
        attitude = flight.q_world_body[np.abs(flight.times - time).argmin()]
        np.testing.assert_allclose(pose[:3], position, atol=1e-4)
        assert abs(np.dot(np.roll(pose[3:], 1), attitude)) > 0.999


def test_play_moves_the_vehicle_to_the_end_and_pause_stops_it(laptop: Seen) -> None:
    laptop.press("1", "Home")
    before = laptop.picture()
    laptop.page.select_option("#speed", "0.25")
    laptop.page.click("#play")
    laptop.until("replay.time > 0.2")
    laptop.page.click("#play")
    paused = laptop.time
    assert paused > 0.2
    assert not laptop.page.evaluate("replay.playing")
    laptop.until("!replay.stale")
    assert np.abs(laptop.picture().astype(int) - before).max() > 50
    assert laptop.time == paused
    assert laptop.page.inner_text("#clock").startswith(f"{paused:.3f}")
    laptop.page.select_option("#speed", "4")
    laptop.press(" ")
    laptop.until("!replay.playing")
    assert laptop.time == pytest.approx(flip()[0].times[-1])
    laptop.press(" ")  # from the start again
    laptop.until("replay.playing && replay.time < 2 || !replay.playing")
    laptop.until("!replay.playing")


def test_the_time_bar_seeks_and_cursors_of_all_plots_follow(laptop: Seen) -> None:
    duration = float(flip()[0].times[-1])
    for part in (0.25, 0.75):
        laptop.page.evaluate(
            "(part) => { const bar = document.getElementById('time'); bar.value = part; "
            "bar.dispatchEvent(new Event('input')) }",
            part,
        )
        laptop.until("!replay.stale")
        assert laptop.time == pytest.approx(part * duration, rel=1e-3)
        places = laptop.page.evaluate(
            "[...document.querySelectorAll('.cursor')].map((c) => +/M([^ ]*)/.exec(c.getAttribute('d'))[1])"
        )
        left, right = laptop.page.evaluate("[0, DURATION].map((t) => replay.plots.plots[0].x(t))")
        np.testing.assert_allclose(places, left + part * (right - left), atol=0.5)
        error = np.interp(laptop.time, flip()[0].times, 100 * flip()[0].position_error)
        told = laptop.page.locator(".plot h2 b").first.inner_text()
        assert float(told.removesuffix(" cm")) == pytest.approx(error, abs=1e-4)


def test_what_stands_in_a_plot_is_left_alone_while_time_goes_on(laptop: Seen) -> None:
    """Software renders it slowly: painted anew in every frame it took half of their time."""
    laptop.do(
        "window.changes = 0; for (const plot of document.querySelectorAll('.plot svg:not(.moving)'))"
        " new MutationObserver((list) => (window.changes += list.length))"
        ".observe(plot, { subtree: true, childList: true, attributes: true })"
    )
    layers = "[...document.querySelectorAll('.plot svg, .plot b')].map((e) => getComputedStyle(e).willChange)"
    assert set(laptop.page.evaluate(layers)) == {"transform"}
    laptop.press("Home", "ArrowRight", "End")
    assert laptop.page.evaluate("window.changes") == 0


def test_what_is_drawn_slowly_is_drawn_coarser_while_it_plays_and_finely_when_it_stands(laptop: Seen) -> None:
    laptop.press("Home")
    width = "replay.renderer.domElement.width"
    fine = laptop.page.evaluate(width)
    slow = f"(replay.toggle(), [1, 2, 3, 4].map(() => (replay.seek(0), replay.advance(1), {width})))"
    coarser = laptop.page.evaluate(f"[{slow}, replay.toggle()][0]")
    assert coarser[0] == pytest.approx(0.7 * fine, abs=1)
    assert coarser[1:] == [pytest.approx(0.5 * fine, abs=1)] * 3, "and no coarser than that"
    laptop.until("replay.fineness === 1 && !replay.stale")
    assert laptop.page.evaluate(width) == fine


def test_a_press_on_a_plot_seeks(laptop: Seen) -> None:
    box = laptop.page.locator(".plot svg").nth(1).bounding_box()
    assert box is not None
    left, right = laptop.page.evaluate("[0, DURATION].map((t) => replay.plots.plots[1].x(t))")
    laptop.page.mouse.click(box["x"] + (left + right) / 2, box["y"] + box["height"] / 2)
    assert laptop.time == pytest.approx(flip()[0].times[-1] / 2, rel=0.02)


def test_all_of_it_can_be_done_by_keys(laptop: Seen) -> None:
    duration = float(flip()[0].times[-1])
    laptop.press("Home")
    assert laptop.time == 0.0
    laptop.press("ArrowRight", "ArrowRight", "ArrowLeft")
    assert laptop.time == pytest.approx(duration / 100)
    laptop.press("End")
    assert laptop.time == pytest.approx(duration)
    pictures = []
    for key, view in (("1", "orbit"), ("2", "follow"), ("3", "gate")):
        laptop.press("Home", "Shift+ArrowRight", key)
        assert laptop.page.evaluate("replay.cameras.view") == view
        assert laptop.page.locator(f"[data-view={view}]").get_attribute("aria-pressed") == "true"
        pictures.append(laptop.picture())
    for other in pictures[1:]:
        assert np.abs(other.astype(int) - pictures[0]).max() > 50
    speed = laptop.page.evaluate("replay.speed")
    laptop.press("ArrowDown")
    assert laptop.page.evaluate("replay.speed") < speed
    laptop.press("ArrowUp", "1")
    assert laptop.page.evaluate("replay.speed") == speed


def test_a_dragged_camera_turns_and_a_followed_vehicle_stays_in_the_middle(laptop: Seen) -> None:
    laptop.press("2", "Home")
    offset = "replay.cameras.camera.position.clone().sub(replay.world.vehicle.position).toArray()"
    before = laptop.do(offset)
    laptop.press("End")
    np.testing.assert_allclose(laptop.do(offset), before, atol=1e-6)
    laptop.page.mouse.move(500, 400)
    laptop.page.mouse.down()
    laptop.page.mouse.move(650, 380, steps=3)
    laptop.page.mouse.up()
    after = np.array(laptop.do(offset))
    assert np.linalg.norm(after) == pytest.approx(np.linalg.norm(before), rel=1e-3)
    assert np.linalg.norm(after - before) > 0.1
    laptop.press("1")


def test_of_many_flights_the_failed_ones_are_marked_and_each_can_be_chosen(show) -> None:
    plan = shared_plan("flip-roll")
    seen = show(ab.view(dispersed(), plan))
    failed = [track.failed for track in ab.view(dispersed(), plan).scene.tracks]
    options = seen.page.locator("#flight option").all_inner_texts()
    assert [text.startswith("✗") for text in options] == failed
    assert seen.page.evaluate("replay.plots.focus") == failed.index(True), "a failed one comes first"
    assert "failed" in seen.page.inner_text("#facts .wrong")
    seen.press("[")
    assert seen.page.evaluate("replay.plots.focus") == failed.index(True) - 1
    assert "wrong" not in (seen.page.get_attribute("#flight", "class") or "")


def test_without_webgl_a_sentence_says_so_and_the_plots_still_show_the_flight(browser: Browser) -> None:
    page = browser.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto("about:blank")
    page.set_content(ab.view(*flip()).html)
    assert "no WebGL" in page.inner_text("#sorry")
    page.keyboard.press("End")
    wait(page, "!replay.stale")
    flight = flip()[0]
    last = float(page.locator(".plot h2 b").first.inner_text().removesuffix(" cm"))
    assert last == pytest.approx(100 * flight.position_error[-1], abs=1e-4)
    assert not faults
    page.close()


def test_a_notebook_frame_holds_the_page(browser: Browser) -> None:
    page = browser.new_page()
    page.set_default_timeout(PATIENCE)
    page.set_content(f"<h1>a notebook</h1>{ab.view(shared_plan('half-flip'))._repr_html_()}")
    frame = page.frame_locator("iframe")
    assert frame.locator("h1").inner_text() == "half-flip · agile-quad"
    assert frame.locator(".plot h2 span").all_inner_texts() == [
        "speed [m/s]",
        "body rate [°/s]",
        "rotor thrust [N]",
    ]
    page.close()
