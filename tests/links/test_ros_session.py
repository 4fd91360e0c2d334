"""Sessions with a real ROS: a take-off, a flip, a half-flip whose node is killed, and a landing."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from places import SUPPORT
from suites import ROS_PYTHONS

PATIENCE = 600.0  # [s] of the wall, of which a session takes one or two minutes
IN_VAIN = 75  # the exit status of a session that waited in vain
TRIES = 2  # of some hundred sessions with rospy one has waited in vain, and none told why


pytestmark = pytest.mark.ros
Ended = tuple[int, str]  # a session's exit status, and all that its processes said


@pytest.fixture(scope="module")
def sessions() -> Iterator[dict[str, Future[Ended]]]:
    """Sessions with each generation of ROS, side by side: they wait for most of their time."""
    with ThreadPoolExecutor() as pool:
        yield {generation: pool.submit(session, generation) for generation in ROS_PYTHONS}


@pytest.mark.parametrize("generation", ROS_PYTHONS)
def test_a_session_flies_maneuvers_on_demand_and_survives_its_node(
    generation: str, sessions: dict[str, Future[Ended]]
) -> None:
    status, said = sessions[generation].result()
    assert status == 0, said


def session(generation: str) -> Ended:
    """Run a session, once more where it waited in vain."""
    for _ in range(TRIES):
        status, said = one_session(generation)
        if status != IN_VAIN:
            break
    return status, said


def one_session(generation: str) -> Ended:
    """Run a session in a process of its own, whose interpreter has that ROS."""
    command = [os.environ[ROS_PYTHONS[generation]], str(SUPPORT / "ros_session.py"), generation]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as started:
        try:
            said, _ = started.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            started.send_signal(signal.SIGTERM)  # so that it ends what it has started
            said, _ = started.communicate()
            return IN_VAIN, said
        return started.returncode, said
