"""The suites that tests belong to, and the settings that all tests share."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Generator, Iterator

import pytest
from _pytest.mark.expression import Expression
from _pytest.runner import runtestprotocol
from hypothesis import is_hypothesis_test, settings

import budget
from aerobat.control.law import CONTROL_LAWS
from aerobat.environment.obstacles import OBSTACLES
from aerobat.planning.planners import PLANNERS
from aerobat.problem.maneuvers.maneuver import MANEUVERS
from aerobat.registry import imported_plugins
from aerobat.simulation.plants.plant import PLANTS
from suites import FAST, FULL, GROUPS, missing, register_profiles

# long work says nothing of its progress, but where a test asks for it: no test depends on the clock
os.environ["AEROBAT_PROGRESS"] = "1e6"

SPENT = pytest.StashKey[float]()  # [s] of the processor, by a test with its fixtures
register_profiles()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the two suites."""
    parser.addoption("--full", action="store_true", help=f"Run all tests: {', '.join(GROUPS)} too.")
    parser.addoption(
        "--rest", action="store_true", help="Run what --full runs and the default suite does not."
    )
    parser.addoption("--no-budget", action="store_true", help="Let any test take long, as beside other work.")


def pytest_configure(config: pytest.Config) -> None:
    """Choose the suite; refuse one that needs a part of the system that is not there."""
    config.option.full |= config.option.rest
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


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what the default suite runs as `--rest` would; laws draw more examples there, and stay."""
    if config.option.rest:
        done = [
            item
            for item in items
            if not (_in_a_group(item) or is_hypothesis_test(getattr(item, "obj", None)))
        ]
        config.hook.pytest_deselected(items=done)
        items[:] = [item for item in items if item not in set(done)]


def _in_a_group(item: pytest.Item) -> bool:
    return any(item.get_closest_marker(name) for name in GROUPS)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, None, None]:
    """Begin to count a test's time of the processor; fail a test whose part of the system is not there."""
    item.stash[SPENT] = -budget.processor_seconds()
    for group in GROUPS:
        if item.get_closest_marker(group) and (sentence := missing(group)):
            pytest.fail(sentence, pytrace=False)
    return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test; fail one that takes long twice and belongs to no group.

    The first test of a process pays for modules and compiled functions that later ones share, and other work
    on the machine makes one run long. The second run has paid, and is judged.
    """
    place = {"nodeid": item.nodeid, "location": item.location}
    item.ihook.pytest_runtest_logstart(**place)
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    if _exceeded(item, reports):
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        if limit := _exceeded(item, reports):
            call = next(report for report in reports if report.when == "call")
            call.outcome = "failed"
            call.longrepr = (
                f"{item.nodeid} took {item.stash[SPENT]:.1f} s of the processor, more than "
                f"{limit:.1f} s. Shorten it, or mark it slow."
            )
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(**place)
    return True


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, None, None]:
    """Count a test's time of the processor."""
    yield
    item.stash[SPENT] += budget.processor_seconds()


def _exceeded(item: pytest.Item, reports: list[pytest.TestReport]) -> float | None:
    """The limit [s] that a test took longer than, which passed and is in no group; None of others."""
    options = item.config.option
    is_judged = not (options.full or options.no_budget) and budget.is_measured()
    if not is_judged or _in_a_group(item) or not all(report.passed for report in reports):
        return None
    return budget.exceeded(item.stash[SPENT])


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
    """What a test registers, and plugins that it imports, are its own: files share processes in any order."""
    before = {registry: set(registry) for registry in (PLANNERS, MANEUVERS, OBSTACLES, CONTROL_LAWS, PLANTS)}
    modules = set(sys.modules)
    yield
    for registry, names in before.items():
        for name in set(registry) - names:
            if not registry._classes[name].__module__.startswith("aerobat."):
                del registry._classes[name]
    if new := sys.modules.keys() - modules:
        plugins = imported_plugins()
        for name in new:
            if getattr(sys.modules[name], "__file__", None) in plugins:
                del sys.modules[name]
