"""The README's picture of a replay page, drawn anew: `uv run --dev python docs/make_replay_picture.py`."""

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
    browser.close()
