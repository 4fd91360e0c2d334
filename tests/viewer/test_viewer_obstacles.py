"""Obstacles in replay pages: what the page draws is the surfaces of the problem's obstacles and walls."""

from __future__ import annotations

from base64 import b64decode
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat.viewer.document import packed
from aerobat.viewer.scene import scene_of
from browsers import open_browser
from obstacle_cases import open_cruise, walled_cruise


def numbers(scene: dict[str, Any], place: dict[str, Any]) -> np.ndarray:
    return np.frombuffer(b64decode(scene["arrays"]), "<f4", place["length"], place["offset"])


def test_a_page_has_the_triangles_and_edges_of_obstacles_and_walls() -> None:
    scene = scene_of(walled_cruise())
    names = {surface.name for surface in scene.surfaces}
    assert names == {"trunk", "sphere", "box", "the wall of gate"}
    page = packed(scene)
    found = {key: numbers(page, place) for key, place in page["header"]["obstacles"].items()}
    triangles = np.concatenate([surface.triangles for surface in scene.surfaces])
    edges = np.concatenate([surface.edges for surface in scene.surfaces])
    assert found["triangles"] == pytest.approx(triangles.ravel(), abs=1e-6)
    assert found["edges"] == pytest.approx(edges.ravel(), abs=1e-6)


def test_a_flight_shows_the_walls_of_its_plan() -> None:
    plan = walled_cruise()
    flown = scene_of(ab.fly(plan, rate=100.0, engine="floats"), plan)
    assert [s.name for s in flown.surfaces] == [s.name for s in scene_of(plan).surfaces]


def test_a_page_without_obstacles_draws_none() -> None:
    assert packed(scene_of(open_cruise()))["header"]["obstacles"]["triangles"]["length"] == 0


@pytest.mark.browser
def test_obstacles_are_one_thing_more_in_the_scene() -> None:
    counts = []
    with open_browser() as browser:
        for plan in (open_cruise(), walled_cruise()):
            page = browser.new_page(viewport={"width": 900, "height": 600})
            faults: list[str] = []
            page.on("pageerror", lambda fault, faults=faults: faults.append(str(fault)))
            page.set_content(ab.view(plan).html)
            page.wait_for_function("window.replay && replay.frames > 0")
            counts.append(page.evaluate("replay.world.scene.children.length"))
            assert not faults
    assert counts[1] == counts[0] + 1
