"""The README's pictures of a replay and of a live page, drawn anew.

uv run --dev python docs/make_replay_picture.py
"""

import shutil
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

import aerobat as ab

INSTANT = 0.95  # [s] shortly before the gate
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]

plan = ab.plan("flip-roll", vehicle="agile-quad")
with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
    page = Path(folder) / "replay.html"
    ab.write_replay(ab.fly(plan), page, plan)
    browser = tools.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
    window = browser.new_page(viewport={"width": 1280, "height": 720})
    window.goto(page.as_uri())
    window.evaluate(f"(replay.view('follow'), replay.seek({INSTANT}))")
    window.wait_for_timeout(3000)
    window.screenshot(path=Path(__file__).with_name("replay.png"))
    with ab.view_live("half-flip", browser=False) as live:
        window.goto(live.address)
        for key, value in {"gates[0].position.z": 4.2, "gates[0].tilt": -60.0}.items():
            window.evaluate("([key, value]) => live.move(key, value)", [key, value])
        while window.locator("#verdict.busy").count():
            window.wait_for_timeout(100)
        window.evaluate(f"(replay.toggle(), replay.seek({INSTANT}))")
        window.wait_for_timeout(3000)
        window.screenshot(path=Path(__file__).with_name("live.png"))
    browser.close()
