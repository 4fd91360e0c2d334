"""Settings that all tests share."""

import os
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

from aerobat.planning.planners import PLANNERS
from aerobat.problem.maneuvers.maneuver import MANEUVERS

# the same examples on every run, and no deadline: no test depends on the clock
settings.register_profile(
    "reproducible", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("reproducible")

# what takes long on a busy machine tells nothing more: no test depends on the clock
os.environ["AEROBAT_PROGRESS"] = "1e6"
# ffmpeg is started without a fork of Python's own, which JAX's threads, of other tests, may lock up
os.environ["IMAGEIO_FFMPEG_NO_PREVENT_SIGINT"] = "1"


@pytest.fixture(autouse=True)
def registries_as_they_were() -> Iterator[None]:
    """Planners and maneuvers that a test registers are its own: files share processes in any order."""
    before = {registry: set(registry) for registry in (PLANNERS, MANEUVERS)}
    yield
    for registry, names in before.items():
        for name in set(registry) - names:
            if not registry._classes[name].__module__.startswith("aerobat."):
                del registry._classes[name]
