"""Sessions with a real ROS: take-off, a flip, a half-flip cut short by a kill, and a landing, over its topics."""

from __future__ import annotations

import os
import signal
import subprocess

import pytest

from places import SUPPORT
from suites import ROS_PYTHONS

PATIENCE = 600.0  # [s] of the wall, of which a session takes one or two minutes
IN_VAIN = 75  # the exit status of a session that waited in vain
TRIES = 2  # of some hundred sessions with rospy one has waited in vain, and none told why


@pytest.mark.ros
@pytest.mark.parametrize("generation", ROS_PYTHONS)
def test_a_session_flies_maneuvers_on_demand_and_survives_its_node(generation: str) -> None:
    for _ in range(TRIES):
        status, said = session(generation)
        if status != IN_VAIN:
            break
    assert status == 0, said


def session(generation: str) -> tuple[int, str]:
    """Return a session's exit status, and all that its processes said."""
    command = [os.environ[ROS_PYTHONS[generation]], str(SUPPORT / "ros_session.py"), generation]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as started:
        try:
            said, _ = started.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            started.send_signal(signal.SIGTERM)  # so that it ends what it has started
            said, _ = started.communicate()
            return IN_VAIN, said
        return started.returncode, said
