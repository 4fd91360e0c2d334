"""Replay pages as files: their numbers, their weight, what they ask of others, where they are written."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.reporting.style import BLUE, INK, RED, SKY, YELLOW
from aerobat.viewer.document import PAGE, SCRIPTS
from shared_plans import shared_plan
from viewer_cases import array, dispersed, flip, header

MAX_BYTES = 3_000_000


def test_a_page_holds_what_was_flown() -> None:
    flight, plan = flip()
    page = ab.view(flight, plan).html
    told = header(page)
    track = told["tracks"][0]
    np.testing.assert_allclose(array(page, told["times"]), flight.times, atol=1e-6)
    np.testing.assert_allclose(array(page, track["position"]).reshape(-1, 3), flight.position, atol=1e-5)
    np.testing.assert_allclose(array(page, track["attitude"]).reshape(-1, 4), flight.q_world_body, atol=2e-5)
    np.testing.assert_allclose(array(page, track["thrusts"]).reshape(-1, 4), flight.thrusts, atol=2e-4)
    errors = {curve["name"]: array(page, curve["values"]) for curve in told["curves"]}
    np.testing.assert_allclose(errors["position error"], flight.position_error, rtol=1e-6)
    np.testing.assert_allclose(errors["attitude error"], np.rad2deg(flight.attitude_error), rtol=1e-6)
    assert [rotor["max"] for rotor in told["rotors"]] == plan.vehicle.max_thrusts.tolist()
    assert told["body"]["semiAxes"] == plan.vehicle.bounding_ellipsoid.semi_axes.tolist()
    assert told["gates"][0]["position"] == plan.problem.gates[0].position.tolist()


@pytest.mark.parametrize("count", [1, 50])
def test_a_page_of_five_seconds_at_500_rows_is_light(count: int) -> None:
    flight = ab.fly(_slow_line(), ["agile-quad"] * count, rate=500.0)
    assert 4.99 < flight.times[-1] < 5.01
    assert len(ab.view(flight).html.encode()) < MAX_BYTES


def test_a_page_asks_nothing_of_any_other_place() -> None:
    page = ab.view(*flip()).html
    assert "default-src 'none'" in page  # the browser refuses what the page may not ask
    assert not re.search(r"<(link|img|iframe|script)[^>]*(src|href)=", page)
    assert "import(" not in page
    assert "fetch(" not in "".join((PAGE / name).read_text() for name in SCRIPTS)


def test_no_name_ends_the_script_it_stands_in() -> None:
    _, plan = flip()
    name = "</script><script>alert(1)</script>&<!--"
    named = replace(plan, vehicle=replace(plan.vehicle, name=name))
    page = ab.view(named).html
    assert page.count("alert(1)") == 3  # in the title and twice in the header, nowhere as a tag
    assert "<script>alert" not in page
    assert header(page)["title"].endswith(name)


def test_a_notebook_shows_the_page_in_a_frame_of_its_own() -> None:
    replay = ab.view(*flip())
    frame = re.fullmatch(r'<iframe [^>]*srcdoc="([^"]*)"></iframe>', replay._repr_html_())
    assert frame is not None
    assert unescape(frame[1]) == replay.html
    assert repr(replay) == f"Replay(flip-roll · agile-quad, {len(replay.html) / 1e6:.2f} MB)"


def test_an_earlier_replay_is_replaced_and_nothing_else(tmp_path: Path) -> None:
    plan = shared_plan("line")
    ab.write_replay(plan, tmp_path / "page.html")
    ab.write_replay(dispersed(), tmp_path / "page.html")
    assert header((tmp_path / "page.html").read_text(encoding="utf-8"))["title"].startswith(
        "flight · 50 flights"
    )
    for content in (b"years of work", b"\x89PNG\r\n"):
        (tmp_path / "mine.html").write_bytes(content)
        with pytest.raises(ab.SpecError, match="is there already and no replay"):
            ab.write_replay(plan, tmp_path / "mine.html")
        assert (tmp_path / "mine.html").read_bytes() == content
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.html", "page.html"]


def test_the_page_has_the_colours_of_the_figures() -> None:
    colours = (PAGE / "models.js").read_text() + (PAGE / "replay.css").read_text()
    for name, colour in {"blue": BLUE, "ink": INK, "red": RED, "sky": SKY, "yellow": YELLOW}.items():
        assert f'{name}: "{colour}"' in colours
        assert f"--{name}: {colour};" in colours


def _slow_line() -> ab.Trajectory:
    fixed = np.zeros((2, 5, 3))
    fixed[1, 0] = 3.0, 0.0, 1.0
    return ab.minimum_effort(fixed, [5.0])
