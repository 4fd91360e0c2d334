"""The collocation of benchmarks/, a yardstick: known least times of a rigid body, its mesh, its bounds."""

import numpy as np
import pytest

from aerobat.planning import TimeOptimal, plan
from aerobat.planning.task import Task
from aerobat.problem import load_problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle
from collocation.optimal_control.bounds import Backoff, Bounds
from collocation.optimal_control.collocation import CollocatedMotion, CollocationMesh
from collocation.planner import Collocation
from random_flights import with_lags
from rigid_body_replay import replayed
from section_v_sets import LEAST_TIMES, section_v

QUAD = load_vehicle("agile-quad")
JERKY = with_lags(QUAD, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["A", "B"])
def test_section_v_takes_its_least_time_and_a_rigid_body_without_control_arrives(name):
    """Feed-forward alone, in the plane, for which multiple shooting found those times."""
    vehicle, problem = section_v(name), load_problem("section-v")
    found = Collocation(starts=1, planar=True).plan(problem, vehicle)
    assert found.duration < 1.005 * LEAST_TIMES[name]
    assert found.certificate.certified
    assert np.abs(np.array(found.trajectory.component_range(0))[:, 1]).max() < 1e-5
    position, velocity = replayed(found.trajectory, vehicle, problem.environment)
    assert np.linalg.norm(position - problem.goal.position) < 1e-3
    assert np.linalg.norm(velocity) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["line", "half-flip"])
def test_refined_polynomials_come_within_half_a_percent_of_the_collocated_rigid_body_or_beat_it(name):
    """Two optimizers that share no program: Gauss points and IPOPT, polynomials and a method of our own."""
    collocated = plan(name, Collocation(starts=2), QUAD)
    refined = plan(name, TimeOptimal(starts=2), QUAD)
    assert collocated.certified
    assert refined.certified
    assert refined.duration < 1.005 * collocated.duration
    assert refined.duration > 0.98 * collocated.duration


@pytest.mark.parametrize("continuous", [True, False])
def test_the_end_intervals_are_short_where_thrust_jumps(continuous):
    mesh = CollocationMesh.even((2, 5), continuous, np.ones(3))
    assert np.bincount(mesh.phase_of, mesh.fractions) == pytest.approx([1.0, 1.0])
    assert (mesh.fractions[0] < 0.8 * mesh.fractions[1]) is not continuous
    assert (mesh.fractions[-1] < 0.8 * mesh.fractions[-2]) is not continuous


def test_a_backoff_leaves_rotors_a_range_beside_the_reserve():
    """A reserve and a backoff that crossed ended as "lower must not exceed upper"."""
    problem = load_problem("line")
    bounds = Bounds.of(Task.of(problem, JERKY))
    fast = Trajectory(
        [0.1], [[[0, 0, 0], [0, 0, 0], [0, 0, 0.1365]]]
    )  # upward at 27 m/s², 1 N too much for each rotor
    none = Backoff.none(1, bounds)
    for reserve in (0.0, 0.1, 0.2, 0.3, 0.4):
        grown = none.grown(bounds, fast, reserve)
        kept = 2.0 * reserve * bounds.sizes[-5:-1]
        assert (
            grown is None
            or (
                grown.low + grown.high
                < bounds.upper - bounds.lower - np.array([*np.zeros(len(bounds.path)), *kept, 0])
            ).all()
        )
    assert none.grown(bounds, fast, 0.0) is not None
    assert none.grown(bounds, fast, 0.4) is None


def test_a_refined_mesh_covers_its_phases_and_is_finer_where_the_body_turns():
    even = CollocationMesh.even((4, 6), True, np.ones(3))
    starts = np.zeros((3, 10))
    starts[1, 7] = 100.0  # turns in the second phase's fourth interval
    motion = CollocatedMotion(np.array([1.0, 3.0]), np.zeros((12, 11)), starts, starts)
    refined = even.refined(motion, 100, 4)
    assert [sum(refined.fractions[refined.phase_of == phase]) for phase in (0, 1)] == pytest.approx(
        [1.0, 1.0]
    )
    assert sum(refined.intervals) == pytest.approx(100, abs=2)
    assert (refined.fractions > 0.0).all()
    second = refined.fractions[refined.phase_of == 1]
    at = np.cumsum(second) - second / 2
    assert second[np.argmin(np.abs(at - 3.5 / 6))] == pytest.approx(second.min())
    assert second.min() < 0.6 * second.max()


def test_what_is_exceeded_still_is_backed_off_from_twice_as_far():
    """Between nodes it may be exceeded by so little that what is added to nodes never reached it."""
    bounds = Bounds.of(Task.of(load_problem("line"), JERKY))
    # upward at a hair more than rotors give
    fast = Trajectory([0.1], [[[0, 0, 0], [0, 0, 0], [0, 0, 0.5 * 0.01 * (3.3 - 1 + 1e-6) * 9.81]]])
    backoff = Backoff.none(1, bounds).grown(bounds, fast)
    for _ in range(6):
        grown = backoff.grown(bounds, fast)
        assert (grown.high[:, -5:-1] >= 2.0 * backoff.high[:, -5:-1]).all()
        backoff = grown
