"""The system's browser, drawing by software, and a page that is open in it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from suites import browser

LAPTOP, PHONE = (1280, 720), (390, 844)
PATIENCE = 120_000  # [ms] on a busy machine; nothing waits longer than it takes
STEP = 20  # [ms] from one look to the next
FLAGS = (
    "--no-sandbox", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip


def wait(page: Page, condition: str) -> None:
    """Wait for a condition; a replay's own policy forbids the browser's way of waiting for one."""
    for _ in range(PATIENCE // STEP):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(STEP)
    raise AssertionError(f"never {condition}")


@dataclass
class Seen:
    """A page that is open, and what went wrong since it was opened."""

    page: Page
    faults: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def do(self, script: str) -> object:
        """The value of a script in the page, after what it changes is drawn."""
        value = self.page.evaluate(script)
        self.until("!replay.stale")
        return value

    def until(self, condition: str) -> None:
        """Wait for a condition."""
        wait(self.page, condition)

    def press(self, *keys: str) -> None:
        """Press keys, and wait until their effect is drawn."""
        for key in keys:
            self.page.keyboard.press(key)
        self.until("!replay.stale")

    @property
    def time(self) -> float:
        """Where the replay is [s]."""
        return float(self.page.evaluate("replay.time"))

    def picture(self) -> np.ndarray:
        """The scene in space as pixels."""
        return np.asarray(Image.open(io.BytesIO(self.page.locator("#stage").screenshot())).convert("RGB"))

    @classmethod
    def watching(cls, page: Page) -> Seen:
        """A page, from now on."""
        page.set_default_timeout(PATIENCE)
        seen = cls(page)
        page.on("pageerror", lambda error: seen.faults.append(str(error)))
        page.on("console", lambda line: seen.faults.append(line.text) if line.type == "error" else None)
        page.on("request", lambda request: seen.asked.append(request.url))
        return seen


@contextmanager
def open_browser() -> Iterator[Browser]:
    """The system's Chromium, else Chrome or Edge."""
    with sync_playwright() as tools:
        found = tools.chromium.launch(executable_path=browser(), args=FLAGS)
        yield found
        found.close()
