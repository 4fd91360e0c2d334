"""Maneuvers flown on demand over topics: as in process, from where the vehicle is, and never a fall."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import Future
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.links.commander import Doing
from aerobat.links.goals import Mode
from aerobat.links.mission import MissionSettings
from aerobat.links.ros import topics
from aerobat.links.ros.maneuver_node import NodeSettings
from places import SUPPORT
from ros_sky import AtOnce, Reply, Sky, aloft, at_the_flips_begin

MORE = 0.02  # [m] that a flight by topics may be off more than one in process


def test_what_cannot_be_done_now_is_answered_in_a_sentence() -> None:
    sky = Sky()
    for service, words in (
        ("takeoff", "nothing was heard of the vehicle"),
        ("hold", "have it take off first"),
        ("flip", "nothing was heard"),
    ):
        reply = sky.call(service)
        assert reply.success is False
        assert words in reply.sentence
    sky.run_for(0.1)
    assert "stands on the ground" in sky.call("flip").sentence
    assert "stands on the ground" in sky.call("land").sentence
    assert sky.call("takeoff").success
    sky.run_for(0.5)
    assert "climbing already" in sky.call("takeoff").sentence
    assert "is climbing; wait until it hovers" in sky.call("line").sentence


def test_goals_that_begin_elsewhere_or_are_malformed_move_nothing() -> None:
    sky = aloft()
    sky.node_lives = False
    sky.run_for(2.0)
    piece = sky.goals[-1]
    stays = sky.position
    assert sky.vehicle.mode is Mode.HOLD
    far = piece._replace(
        stamp=sky.now,
        begin=piece.begin._replace(position=piece.begin.position + 2.0),
        end=piece.end._replace(position=piece.end.position + 2.0),
    )
    broken = piece._replace(stamp=sky.now, begin=piece.begin._replace(velocity=np.full(3, np.nan)))
    for wrong, words in ((far, "goals begin where the vehicle is"), (broken, "not finite")):
        sky.vehicle_node._refused = ""
        sky.send(wrong)
        sky.run_for(0.1)
        assert words in sky.said[-1]
        assert sky.vehicle.mode is Mode.HOLD
    np.testing.assert_allclose(sky.position, stays, atol=1e-3)


def test_what_has_no_plan_is_answered_with_the_reason_and_the_vehicle_hovers_on() -> None:
    sky = aloft()
    problem, planner = sky.node._maneuvers["flip"]
    demanding = replace(problem, maneuver=replace(problem.maneuver, min_inverted_thrust=45.0))
    sky.node._maneuvers = {"flip": (demanding, planner)}
    reply = sky.call("flip")
    assert reply.success is False
    assert "asks 45 m/s² inverted, agile-quad gives 32" in reply.sentence
    sky.run_for(1.0)
    assert sky.hovers


@pytest.mark.slow
def test_a_vehicle_that_was_left_to_itself_in_the_air_lands_and_takes_off_only_then() -> None:
    """A take-off from the air would take its height for the ground's, and landings would end there."""
    sky = aloft()
    sky.graph.cut.add(topics.ODOMETRY)
    sky.run(lambda: sky.node.commander.doing is Doing.NOTHING)
    sky.graph.cut.clear()
    sky.run(lambda: sky.hovers and sky.vehicle.mode is Mode.HOLD)
    sky.run_for(0.2)
    refused = sky.call("takeoff")
    assert refused.success is False
    assert refused.sentence == "the vehicle is in the air already; have it land first"
    assert sky.call("land").success
    sky.run(lambda: sky.node.commander.doing is Doing.NOTHING)
    assert sky.stands
    assert sky.call("takeoff").success


class Planning(AtOnce):
    """Never has a plan."""

    def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        return Future()


@pytest.mark.parametrize("service", ["hold", "land"])
def test_a_vehicle_obeys_while_a_maneuver_is_planned_which_is_then_given_up(service: str) -> None:
    sky = aloft()
    sky.node._executor = Planning()
    asked = Reply()
    sky.graph.services["/aerobat/flip"](asked)
    assert "a maneuver is being planned; wait for it" in sky.call("line").sentence
    assert asked.success is None
    assert sky.call(service).success
    assert asked.success is False
    assert asked.sentence == f"the maneuver is given up: {service} was called"
    sky.run(lambda: sky.stands if service == "land" else sky.node.commander.doing is Doing.HOVERING)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pause", "told"),
    [
        (0.12, "aborted: a set-point was 0.1"),
        pytest.param(0.07, "set-points were up to 80 ms late", marks=pytest.mark.slow),
    ],
)
def test_set_points_that_were_late_are_told_and_too_late_they_end_it(pause: float, told: str) -> None:
    sky = at_the_flips_begin()
    sky.run_into_the_plan(0.3)
    sky.node_lives = False
    sky.run_for(pause)
    sky.node_lives = True
    sky.run(lambda: bool(sky.reports))
    assert told in sky.reports[0]
    sky.run_for(3.0)
    assert sky.hovers


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vehicle", "generation", "service"), [("agile-quad", 1, "flip"), ("hexarotor", 2, "flip_trans")]
)
def test_a_flight_by_topics_tracks_as_in_process(vehicle: str, generation: int, service: str) -> None:
    """And ends in a hover, told of, from where it lands."""
    sky = aloft(vehicle, generation)
    began = sky.position
    reply = sky.call(service)
    assert reply.success, reply.sentence
    assert sky.node._flown is not None
    plan = sky.node._flown.plan
    sky.run(lambda: bool(sky.reports))
    alone = ab.score(ab.fly(plan, seed=0), plan.problem)
    assert max(sky.errors) < alone.max_position_error_m + MORE
    (report,) = sky.reports
    assert report.startswith("flown within")
    assert report.endswith("hovering")
    sky.run_for(1.0)
    assert sky.hovers
    displaced = plan.trajectory.evaluate(plan.duration) - plan.trajectory.evaluate(0.0)
    np.testing.assert_allclose(sky.position, began + displaced, atol=0.02)
    assert sky.call("land").success
    sky.run(lambda: sky.node.commander.doing is Doing.NOTHING)
    assert sky.stands


@pytest.mark.slow
def test_goals_come_one_a_period_and_each_goes_on_where_the_one_before_ends() -> None:
    """Through a whole maneuver, its approach and its end."""
    sky = at_the_flips_begin()
    sky.run(lambda: bool(sky.reports))
    sky.run_for(0.5)
    stamps = np.array([piece.stamp for piece in sky.goals])
    np.testing.assert_allclose(np.diff(stamps), 0.01, atol=1e-6)
    for before, after in zip(sky.goals, sky.goals[1:], strict=False):
        for ended, begun in zip(before.end, after.begin, strict=True):
            np.testing.assert_allclose(ended, begun, atol=1e-12)
    steps = np.linalg.norm(np.diff([piece.begin.position for piece in sky.goals], axis=0), axis=1)
    speeds = [np.linalg.norm(piece.begin.velocity) for piece in sky.goals]
    assert steps.max() < 0.01 * max(speeds) + 0.01


@pytest.mark.slow
def test_a_vehicle_that_hears_of_goals_late_takes_off_all_the_same() -> None:
    sky = Sky()
    sky.run_for(0.1)
    sky.graph.cut.add(topics.GOAL)
    assert sky.call("takeoff").success
    sky.run_for(6.0)
    assert sky.vehicle.landed
    sky.graph.cut.clear()
    sky.run_for(0.5)
    sky.graph.cut.add(topics.GOAL)
    sky.run(lambda: sky.vehicle.mode is Mode.HOLD)  # and once more, in the air
    sky.run_for(2.0)
    sky.graph.cut.clear()
    sky.run(lambda: sky.node.commander.doing is Doing.HOVERING)
    sky.run_for(1.0)
    assert sky.hovers
    assert sky.position[2] == pytest.approx(3.0, abs=0.01)


@pytest.mark.slow
def test_a_pause_of_goals_and_odometry_in_a_climb_ends_up_there_too() -> None:
    sky = Sky()
    sky.run_for(0.1)
    assert sky.call("takeoff").success
    sky.run(lambda: sky.position[2] > 0.2)
    sky.graph.cut |= {topics.GOAL, topics.ODOMETRY}
    sky.run_for(0.9)  # by then the goal is 1.5 m away
    sky.graph.cut.clear()
    sky.run(lambda: sky.node.commander.doing is Doing.HOVERING)
    sky.run_for(1.0)
    assert sky.hovers
    assert sky.position[2] == pytest.approx(3.0, abs=0.01)


@pytest.mark.process
def test_nothing_is_imported_while_a_vehicle_waits_for_goals() -> None:
    """An import takes longer than the silence after which a vehicle leaves its client."""
    script = SUPPORT / "flight_of_imports.py"
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert not done.stdout.split()


@pytest.mark.slow
def test_a_vehicle_that_hears_late_of_a_landings_goals_lands_all_the_same() -> None:
    """As one does for which a node that has just begun is still unknown."""
    sky = aloft()
    sky.graph.cut.add(topics.GOAL)
    sky.run_for(1.0)
    assert sky.call("land").success
    sky.run_for(4.0)
    assert sky.hovers
    sky.graph.cut.clear()
    sky.run(lambda: sky.node.commander.doing is Doing.NOTHING)
    assert sky.stands


@pytest.mark.slow
def test_a_vehicle_that_never_lands_is_left_to_itself() -> None:
    sky = aloft()
    sky.graph.cut.add(topics.GOAL)
    sky.run_for(1.0)
    assert sky.call("land").success
    sky.run(lambda: sky.node.commander.doing is Doing.NOTHING)
    assert "the vehicle does not land as it is told; it is left to itself" in sky.said
    assert sky.hovers


@pytest.mark.slow
def test_a_vehicle_that_never_takes_off_is_left_to_itself() -> None:
    sky = Sky()
    sky.run_for(0.1)
    sky.graph.cut.add(topics.GOAL)
    assert sky.call("takeoff").success
    sky.run(lambda: sky.node.commander.doing is Doing.NOTHING)
    assert "the vehicle does not climb as it is told; it is left to itself" in sky.said


@pytest.mark.slow
def test_of_goals_that_a_pause_of_the_vehicle_holds_up_each_counts_at_its_time() -> None:
    sky = at_the_flips_begin()
    sky.run_into_the_plan(1.0)
    assert sky.node._flown is not None
    plan, ((kind, take), *others) = sky.node._flown.plan, sky.graph.takers[topics.GOAL]
    held: list[object] = []
    sky.graph.takers[topics.GOAL] = [(kind, held.append), *others]
    sky.vehicle_runs = False
    sky.run_for(0.2)
    for message in held:
        take(message)
    sky.graph.takers[topics.GOAL], sky.vehicle_runs = [(kind, take), *others], True
    sky.run(lambda: bool(sky.reports))
    assert max(sky.errors) < ab.score(ab.fly(plan, seed=0), plan.problem).max_position_error_m + MORE
    assert sky.reports[0].startswith(("flown within", "hit the frame"))  # off its path after the pause


@pytest.mark.slow
def test_a_maneuver_begins_where_the_odometry_sees_the_vehicle() -> None:
    """A line takes it ten metres off, and there the next one begins, its gate moved along."""
    sky = aloft()
    assert sky.call("line").success
    sky.run(lambda: bool(sky.reports))
    sky.run_for(1.0)
    assert sky.call("flip").success
    sky.run_for(0.01)
    flown = sky.node._flown
    assert flown is not None
    start = flown.plan.trajectory.evaluate(0.0) + flown.stream.offset
    np.testing.assert_allclose(start, sky.position, atol=2e-3)
    assert start[0] > 9.9
    seen = sky.node.commander.observed
    assert seen is not None
    np.testing.assert_allclose(start, seen.body.position, atol=2e-3)
    gate = next(m for m in sky.shown[-1].markers if m.ns == "gate")
    middle = np.mean([[p.x, p.y, p.z] for p in gate.points[:4]], axis=0)
    np.testing.assert_allclose(middle, start + 5.5 * so3.UP, atol=1e-6)


@pytest.mark.slow
def test_in_the_world_gate_and_goal_stay_where_their_problem_has_them() -> None:
    sky = Sky(settings=NodeSettings(in_world=True, takeoff_height=3.5))
    problem, planner = sky.node._maneuvers["window"]
    higher = replace(problem.gates[0], position=(2.5, 2.0, 6.0))
    problem = replace(problem, gates=(higher,), goal=ab.at_rest((5.0, 0.5, 3.0)))
    sky.node._maneuvers = {"window": (problem, planner)}
    sky.take_off()
    reply = sky.call("window")
    assert reply.success, reply.sentence
    sky.run(lambda: bool(sky.reports))
    sky.run_for(1.0)
    assert sky.reports[0].startswith("flown within")
    assert np.abs(sky.position - problem.goal.position).max() < 0.02
    gate = next(m for m in sky.shown[-1].markers if m.ns == "gate")
    middle = np.mean([[p.x, p.y, p.z] for p in gate.points[:4]], axis=0)
    np.testing.assert_allclose(middle, problem.gates[0].position, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("instant", [1.2, *(pytest.param(t, marks=pytest.mark.slow) for t in (0.2, 1.9))])
def test_a_node_killed_at_any_instant_of_the_flip_leaves_a_hover(instant: float) -> None:
    sky = at_the_flips_begin()
    sky.run_into_the_plan(instant)
    sky.node_lives = False
    sky.run_for(6.0)
    assert sky.hovers
    assert sky.vehicle.mode is Mode.HOLD
    flown = sky.node._flown
    assert flown is not None
    expected = ab.recoveries(flown.plan, times=[instant], ground=-3.0).lowest[0] + flown.stream.offset[2]
    assert min(sky.heights[-1500:]) > min(expected, 3.0) - 0.3


@pytest.mark.slow
def test_a_vehicle_off_its_path_is_brought_to_a_hover() -> None:
    """One with a drag that its plan knows nothing of."""
    own = ab.load_vehicle("agile-quad")
    dragged = replace(own, drag_body=np.full(3, 0.8))
    bounds = MissionSettings(max_error=0.05)
    sky = Sky(flying=dragged, settings=NodeSettings(mission=bounds))
    sky.take_off()
    assert sky.call("flip").success
    sky.run(lambda: bool(sky.reports))
    assert "off its path" in sky.reports[0]
    sky.run(lambda: sky.node.commander.doing is Doing.HOVERING)
    sky.run_for(2.0)
    assert sky.hovers
    assert sky.vehicle.mode is Mode.OFFBOARD
    assert sky.call("land").success


@pytest.mark.slow
def test_without_odometry_goals_stop_and_the_vehicle_hovers_by_itself() -> None:
    sky = at_the_flips_begin()
    sky.run_into_the_plan(1.0)
    sky.graph.cut.add("/aerobat/odometry")
    sky.run_for(5.0)
    assert "no news of the vehicle" in sky.reports[0]
    assert sky.node.commander.doing is Doing.NOTHING
    assert sky.hovers
    assert sky.vehicle.mode is Mode.HOLD
    refused = sky.call("flip")
    assert not refused.success
    assert "nothing was heard of the vehicle" in refused.sentence
    sky.graph.cut.clear()
    sky.run_for(0.5)
    assert sky.call("land").success
    sky.run(lambda: sky.vehicle.landed)
    assert not sky.vehicle.crashed


def test_odometry_that_is_not_finite_is_left_out_and_its_silence_ends_the_maneuver() -> None:
    sky = at_the_flips_begin()
    sky.run_into_the_plan(0.3)

    def change(message: Any) -> list[Any]:
        message.pose.pose.position.x = np.nan
        return [message]

    sky.graph.change[topics.ODOMETRY] = change
    sky.run(lambda: bool(sky.reports), limit=1.0)
    assert "no news of the vehicle" in sky.reports[0]
    assert sum("odometry is left out that is not finite" in sentence for sentence in sky.said) == 1
    sky.run_for(3.0)
    assert sky.hovers


def test_odometry_that_is_stamped_later_than_now_is_left_out_and_told_once() -> None:
    sky = at_the_flips_begin()
    sky.run_into_the_plan(0.3)

    def change(message: Any) -> list[Any]:
        ahead = deepcopy(message)
        ahead.header.stamp.sec += 10**6
        return [ahead, message, ahead]

    sky.graph.change[topics.ODOMETRY] = change
    sky.run_for(0.2)
    assert sum("odometry is left out that is stamped later" in sentence for sentence in sky.said) == 1
    assert not sky.reports
    sky.graph.cut.add(topics.ODOMETRY)
    sky.run(lambda: bool(sky.reports), limit=0.4)
    assert "no news of the vehicle" in sky.reports[0]


@pytest.mark.slow
def test_a_vehicle_whose_odometry_jumps_is_not_led_by_goals_that_jump() -> None:
    sky = at_the_flips_begin()
    sky.run_into_the_plan(1.2)

    def change(message: Any) -> list[Any]:
        message.pose.pose.position.x += 5.0
        return [message]

    sky.graph.change[topics.ODOMETRY] = change
    sky.run(lambda: bool(sky.reports), limit=1.0)
    assert "m off its path" in sky.reports[0]
    assert any("off its goal; it is left to itself" in sentence for sentence in sky.said)
    sky.run_for(5.0)
    assert sky.hovers


@pytest.mark.slow
def test_hold_gives_a_maneuver_up_at_once() -> None:
    sky = at_the_flips_begin()
    sky.run_into_the_plan(1.2)
    assert sky.call("hold").success
    sky.run(lambda: sky.node.commander.doing is Doing.HOVERING)
    sky.run_for(5.0)
    assert sky.hovers
    assert "hold was called" in sky.reports[0]
