"""The suites that tests belong to, and the settings that all tests share."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest
from _pytest.mark.expression import Expression
from hypothesis import settings

from aerobat.planning.planners import PLANNERS
from aerobat.problem.maneuvers.maneuver import MANEUVERS
from suites import FAST, FULL, GROUPS, missing, register_profiles

# long work says nothing of its progress, but where a test asks for it: no test depends on the clock
os.environ["AEROBAT_PROGRESS"] = "1e6"
# ffmpeg is started without a fork of Python's own, which JAX's threads, of other tests, may lock up
os.environ["IMAGEIO_FFMPEG_NO_PREVENT_SIGINT"] = "1"

register_profiles()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option of the full suite."""
    parser.addoption("--full", action="store_true", help=f"Run all tests: {', '.join(GROUPS)} too.")


def pytest_configure(config: pytest.Config) -> None:
    """Choose the suite; refuse one that needs a part of the system that is not there."""
    for name, meaning in GROUPS.items():
        config.addinivalue_line("markers", f"{name}: {meaning}")
    settings.load_profile(FULL if config.option.full else FAST)
    if any("::" in argument for argument in config.args):
        return  # tests that are named are run, whichever group they are in
    if not (config.option.full or config.option.markexpr):
        config.option.markexpr = f"not ({' or '.join(GROUPS)})"
    chosen = Expression.compile(config.option.markexpr or "slow or not slow")
    for group in GROUPS:
        sentence = missing(group)
        if sentence and chosen.evaluate(lambda name, group=group, **_: name == group):
            raise pytest.UsageError(sentence)


@pytest.fixture(autouse=True)
def signals_are_heeded() -> Iterator[None]:
    """Give SIGINT and SIGTERM Python's own meaning, which children inherit: some shells have them ignored."""
    meanings = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    before = {number: signal.signal(number, meaning) for number, meaning in meanings.items()}
    yield
    for number, meaning in before.items():
        signal.signal(number, signal.SIG_DFL if meaning is None else meaning)


@pytest.fixture(autouse=True)
def registries_as_they_were() -> Iterator[None]:
    """Planners and maneuvers that a test registers are its own: files share processes in any order."""
    before = {registry: set(registry) for registry in (PLANNERS, MANEUVERS)}
    yield
    for registry, names in before.items():
        for name in set(registry) - names:
            if not registry._classes[name].__module__.startswith("aerobat."):
                del registry._classes[name]
