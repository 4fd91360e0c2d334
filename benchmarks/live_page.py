"""Live pages: from a slider that is moved to the new plan on the screen, in the system's chromium.

    uv run --dev python benchmarks/live_page.py

Time on the clock, in the page, and processor time of the server, which plans, and of the browser, which
renders by software. On a machine that others use too the clock tells more of them.
"""

import shutil
import time
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
import psutil
from playwright.sync_api import Page, sync_playwright

import aerobat as ab

FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
MOVES = 7  # of each slider, to places of its middle half that differ
SLIDERS = ("gates[0].z", "maneuver.min_lateral_thrust", "vehicle.thrust_to_weight", "dispersion")
MOVE = """async ([key, part]) => {
  const { input, low, high } = live.sliders.get(key);
  const [start, answered] = [performance.now(), live.answered];
  input.value = low + part * (high - low);
  input.oninput();
  while (live.answered === answered || replay.stale) await new Promise(requestAnimationFrame);
  return (performance.now() - start) / 1000;
}"""


def browser_time() -> float:
    """Processor time of all that this process has started [s]."""
    times = []
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            spent = child.cpu_times()
            times.append(spent.user + spent.system)
    return sum(times)


def moves(page: Page, key: str, parts: Sequence[float]) -> str:
    """A row: seconds from each move to its plan on the screen, and of the processor for it."""
    rows = []
    for part in parts:
        server, browser = time.process_time(), browser_time()
        seen = page.evaluate(MOVE, [key, float(part)])
        rows.append((seen, time.process_time() - server, browser_time() - browser))
        page.wait_for_timeout(300)
    seen, server, browser = np.median(rows, axis=0)
    return f"{seen:14.2f}{np.max(rows, axis=0)[0]:12.2f}{server:12.2f}{browser:12.2f}"


def main() -> None:
    print(f"{'':34}{'seen: median':>14}{'greatest':>12}{'server':>12}{'browser':>12}  [s]")
    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for name in ("flip-roll", "half-flip"):
            with ab.view_live(name, browser=False) as live:
                page = browser.new_page(viewport={"width": 1280, "height": 720})
                page.goto(live.address)
                while not page.evaluate("window.live && replay.frames > 0"):
                    page.wait_for_timeout(50)
                page.evaluate("replay.toggle()")
                moves(page, SLIDERS[0], [0.29])  # the first of all compiles
                for key in SLIDERS:
                    if key == "dispersion":  # which compiles the loop with its filter
                        print(f"{name:12}{'the first dispersed':22}{moves(page, key, [0.1])}")
                    print(f"{name:12}{key.split('.')[-1]:22}{moves(page, key, np.linspace(0.3, 0.7, MOVES))}")
                    page.click("#reset")
                    page.wait_for_timeout(3000)
                page.close()
        browser.close()


if __name__ == "__main__":
    main()
