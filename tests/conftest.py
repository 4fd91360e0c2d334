"""Settings that all tests share."""

import os

from hypothesis import HealthCheck, settings

# the same examples on every run, and no deadline: no test depends on the clock
settings.register_profile(
    "reproducible", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("reproducible")

# what takes long on a busy machine tells nothing more: no test depends on the clock
os.environ["AEROBAT_PROGRESS"] = "1e6"
