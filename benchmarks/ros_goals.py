"""Goals of `aerobat link ros` in real time: how many arrive, and when, while the vehicle hovers.

Both nodes and this one are processes of their own on one machine. A goal's age is the time from its stamp to
when it is taken here; jitter is how the time between two of them differs from a period. Ages are with the
machine as it is: what else runs on it is in them.

python benchmarks/ros_goals.py ros1|ros2 [SECONDS]

with an interpreter that has that ROS and aerobat, as .ci/run makes one.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from aerobat.interchange.ros import NANOSECONDS
from aerobat.links.ros import topics
from ros_session import brought, session, whole


def main() -> None:
    generation = sys.argv[1]
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 30.0
    with session(generation, speed=None) as (ros, watch, ask, node), node():
        watch.wait(lambda: bool(watch.states), "odometry")
        brought(watch, ask, "takeoff", lambda: bool(watch.goals) and watch.hovers)
        ages: list[float] = []
        stamps: list[float] = []

        def take(message: Any) -> None:
            stamps.append(topics.nanoseconds(message.header.stamp) / 1e9)
            ages.append(time.time() - stamps[-1])

        ros.subscribe(topics.GOAL, topics.KIND_OF_GOAL, take)
        ros.work_until(ros.time() + 2 * NANOSECONDS)
        ages.clear()
        watch.goals.clear()
        ros.work_until(ros.time() + round(seconds * NANOSECONDS))
        count, taken = len(ages), 1e3 * np.array(ages)
        arrivals = np.diff(taken)
        lasted = whole(watch.goals, waits=False)
        print(f"{generation}: {count} goals in {lasted:.2f} s, in order, none lost")
        for name, values in (("age", taken), ("jitter", np.abs(arrivals))):
            median, most, worst = np.percentile(values, [50, 99, 100])
            print(f"  {name}: median {median:.2f} ms, 99 % under {most:.2f} ms, {worst:.2f} ms at most")


if __name__ == "__main__":
    main()
