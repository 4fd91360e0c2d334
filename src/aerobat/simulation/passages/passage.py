"""Passages through gates: the crossing of each gate's plane in its direction, nearest the planned instant.

A crossing counts once the vehicle's centre is PASSAGE_DEPTH beyond the plane before it returns to the plane.
A vehicle that stops in the gate, turns back, or comes from the other side has not passed. A path may cross
obliquely, as the paper's paths do, whose gates leave the velocity free; the crossing of the gate's plane
decides in any case. A path along the plane passes no gate.

Clearance from the frame is measured by an ellipsoid that encloses the body and its propellers. Everything
that the ellipsoid sweeps of the gate's plane during the crossing must lie within the opening.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import degrees
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import by_value
from aerobat.engines.pytree import components, tree_map
from aerobat.kernels.gates.progress import GateProgress
from aerobat.kernels.gates.section import BoundingEllipsoid, GatePlane, PlaneDirection
from aerobat.kernels.gates.snapshot import PlaceMotion, VelocityJump
from aerobat.kernels.gates.swath import NOWHERE, Extreme, Swath
from aerobat.problem.gate import Gate
from aerobat.problem.opening import EdgeProbe, edge_name
from aerobat.problem.planned_passage import PASSAGE_DEPTH, PlannedPassage
from aerobat.simulation.nested import map_arrays
from aerobat.simulation.outcome import FlightFailure, Outcome
from aerobat.vehicle import Ellipsoid

REPEAT_SEPARATOR = "#"  # separates a gate's name and the number of its passage, from the second on
PASSAGE_WINDOW = 0.25  # [s] around the planned instant in which the crossing is searched


@dataclass(frozen=True, eq=False)
class PerFlight:
    """A finding about one flight or about many; for many, the fields that differ are arrays (flights,)."""

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def of_flight(self, k: int) -> Self:
        """Return the finding of one flight of many, in plain numbers, nested findings included."""
        return map_arrays(lambda values: values[k].item(), self)


@by_value
class Passage(PerFlight):
    """The crossing of a gate's plane in its direction, nearest the planned instant; NaN where there is none.

    For many flights, all fields but the first two are arrays (flights,).
    """

    gate: str
    lap: int  # of a course
    time: float  # [s] of the crossing
    miss: float  # [m] distance from the gate's centre at the crossing
    lateral: float  # [m] offset from the centre at the crossing along the gate's lateral axis, to the left
    up: float  # [m] offset along the gate's upright axis
    inside: bool  # true if the centre of mass crossed within the opening
    speed: float  # [m/s] at the crossing
    attitude_error_deg: float  # angle between the thrust axis and its required direction
    attitude_tolerance_deg: float  # largest angle allowed; infinite where no attitude is required
    clearance: float  # [m] smallest distance of body and frame; negative: penetration depth; NaN: unknown
    closest_time: float  # [s] instant of the smallest clearance
    closest_edge: str  # left, right, upper or lower, as seen in the direction of passage; empty: unknown
    closest_lateral: float  # [m] nearest point on that edge: from the opening's centre to the left
    closest_up: float  # [m] nearest point on that edge: along the gate's upright axis
    needed_width: float  # [m] width of the smallest opening, with this centre, that the body passes
    needed_height: float  # [m] height of that opening
    planned: float  # [s] planned instant of the crossing; NaN where the flight had ended before
    backward_time: float  # [s] of a crossing against the direction near `planned`; infinite: none
    max_distance: float  # [m] largest distance beyond the plane near `planned`; negative: before the plane
    min_distance: float  # [m] smallest distance beyond the plane near `planned`

    @property
    def failure(self) -> FlightFailure | None:
        """The failure of one flight at this gate; None where nothing is wrong or the passage is unknown."""
        if np.isnan(self.planned):
            return None
        if np.isnan(self.time):
            return self._missed_crossing()
        if not self.inside:
            return self._failed(Outcome.MISSED_GATE, self.time, miss=self.miss)
        if self.clearance < 0.0:
            excess_cm, edge = -100 * self.clearance, self.closest_edge
            return self._failed(Outcome.HIT_FRAME, self.closest_time, excess_cm=excess_cm, edge=edge)
        if self.attitude_error_deg > self.attitude_tolerance_deg:
            angle, tolerance = self.attitude_error_deg, self.attitude_tolerance_deg
            return self._failed(Outcome.WRONG_ATTITUDE, self.time, angle=angle, tolerance=tolerance)
        return None

    def _missed_crossing(self) -> FlightFailure:
        """Return the failure of a flight that did not cross the plane in the gate's direction."""
        if self.max_distance <= 0.0:
            return self._failed(Outcome.SHORT_OF_GATE, self.planned, short=-self.max_distance)
        if self.max_distance >= PASSAGE_DEPTH and np.isfinite(self.backward_time):
            return self._failed(Outcome.BACKWARDS, self.backward_time)
        if self.min_distance <= 0.0:
            return self._failed(Outcome.STOPPED_IN_GATE, self.planned, beyond_cm=100 * self.max_distance)
        return self._failed(Outcome.EARLY, self.planned, early=self.min_distance)

    def _failed(self, outcome: Outcome, time: float, **numbers: object) -> FlightFailure:
        return FlightFailure(time, outcome, {"gate": f"gate '{self.gate}'", **numbers})


def passages(planned: PlannedPassage, progress: GateProgress, stop: Array) -> Passage:
    """Return the passages of many flights through one gate.

    Args:
        planned: the planned passage.
        progress: of the vehicles, whose positions are offsets from the gate's centre; leaves (flights,).
        stop: when flights diverged [s], NaN for those that did not, (flights,).
    """
    gate = planned.gate
    time = progress.crossing.time
    offset, velocity, q = (np.stack(part, axis=-1) for part in progress.crossing[1:])
    q = so3.normalize(q)
    crossed = np.isfinite(time)
    ended_before = ~crossed & (stop <= planned.time)

    def known(values: Array | float, where: NDArray[np.bool_] = crossed) -> Array:
        return np.where(where, values, np.nan)

    in_plane = offset @ gate.plane_axes.T
    tilt = np.arccos(np.clip(so3.thrust_axis(q) @ planned.up, -1, 1))
    fields: dict[str, Any] = {
        "time": known(time),
        "miss": known(np.linalg.norm(offset, axis=-1)),
        "lateral": known(in_plane[..., 0]),
        "up": known(in_plane[..., 1]),
        "inside": crossed & (gate.opening.depth(in_plane) > 0.0),
        "speed": known(np.linalg.norm(velocity, axis=-1)),
        "attitude_error_deg": known(np.rad2deg(tilt)),
        "attitude_tolerance_deg": np.full(len(q), degrees(planned.attitude_tolerance)),
        **_least_clearance(gate, progress.swath.crossing, crossed),
        "planned": known(planned.time, ~ended_before),
        "backward_time": progress.backward,
        "max_distance": known(progress.max_distance, ~ended_before),
        "min_distance": known(progress.min_distance, ~ended_before),
    }
    return Passage(gate.name, planned.lap, **fields)


def passage_names(passages: Sequence[Passage]) -> Iterator[str]:
    """Yield the gates' names in the order of passage, with the number of the passage from the second on."""
    turns: Counter[str] = Counter()
    for passage in passages:
        turns[passage.gate] += 1
        yield passage.gate + (f"{REPEAT_SEPARATOR}{turns[passage.gate]}" if turns[passage.gate] > 1 else "")


def _least_clearance(gate: Gate, swath: Swath, crossed: NDArray[np.bool_]) -> dict[str, Any]:
    """Return a swath's smallest clearance from the opening's edges, its place and time, each (flights,).

    Args:
        gate: the gate.
        swath: what the body sweeps of the gate's plane, leaves (flights,); empty where the body is not known.
        crossed: true where the plane is crossed.
    """
    opening = gate.opening
    swath = swath or len(opening.probes) * (tree_map(partial(np.full, len(crossed)), NOWHERE),)
    times, reach = (np.stack(part, axis=-1) for part in zip(*(each[:2] for each in swath), strict=True))
    limits = np.array([probe.limit for probe in opening.probes])
    known = crossed & np.isfinite(times).all(axis=-1)
    clearances = np.where(known[:, None], limits - reach, 0.0)
    nearest = np.argmin(clearances, axis=-1)
    points = np.stack([_in_opening(*pair) for pair in zip(opening.probes, swath, strict=True)])
    outward = np.stack([opening.outward(k, each) for k, each in enumerate(points)])
    rows = np.arange(len(nearest))
    outward = outward[nearest, rows]
    edge = opening.nearest_on_edge(outward, points[nearest, rows])
    needed_size = opening.needed_size(np.where(known[:, None], reach, 0.0))
    numbers = {
        "clearance": clearances[rows, nearest],
        "closest_time": times[rows, nearest],
        "closest_lateral": edge[:, 0],
        "closest_up": edge[:, 1],
        "needed_width": needed_size[..., 0],
        "needed_height": needed_size[..., 1],
    }
    places = {name: np.where(known, values, np.nan) for name, values in numbers.items()}
    names = [edge_name(normal) if is_known else "" for normal, is_known in zip(outward, known, strict=True)]
    return places | {"closest_edge": np.array(names)}


def _in_opening(probe: EdgeProbe, extreme: Extreme) -> Array:
    """Return the points (left, up) of a gate's plane that reach farthest along a probe [m], (flights, 2)."""
    left, up = probe.direction
    along, beside = extreme.point
    return np.stack([left * along - up * beside, up * along + left * beside], axis=-1)


def gate_places(
    planned: Sequence[PlannedPassage], ellipsoid: BoundingEllipsoid | tuple[()]
) -> list[tuple[GatePlane, BoundingEllipsoid | tuple[()]]]:
    """Return planned passages as kernels read them, leaves numbers, each with the enclosing ellipsoid.

    Without an ellipsoid, clearance is not measured.
    """
    return [
        (
            GatePlane(
                centre=components(each.gate.position),
                normal=components(each.gate.normal),
                directions=_directions(each.gate) if ellipsoid else (),
                radius=each.gate.opening.circumradius,
                planned=each.time,
                window=PASSAGE_WINDOW,
                depth=PASSAGE_DEPTH,
                motion=_motion(each.gate),
            ),
            ellipsoid,
        )
        for each in planned
    ]


def bounding_ellipsoid(body: Ellipsoid | None) -> BoundingEllipsoid | tuple[()]:
    """Return a vehicle's enclosing ellipsoid as kernels read it, with numbers as leaves; () where unknown."""
    if body is None:
        return ()
    return BoundingEllipsoid(components(body.centre), components(body.semi_axes))


def _motion(gate: Gate) -> PlaceMotion | tuple[()]:
    """Return the motion of a moving gate; () for a fixed one."""
    if gate.motion is None:
        return ()
    jumps = zip(gate.motion.times.tolist(), gate.motion.velocity_jumps, strict=True)
    changes = tuple(VelocityJump(time, components(change)) for time, change in jumps)
    return PlaceMotion(components(gate.velocity), changes)


def _directions(gate: Gate) -> tuple[PlaneDirection, ...]:
    """Return the directions in the gate's plane along which the extent of a passing body is measured."""
    probes = gate.opening.probes
    turned = [probe.direction @ gate.plane_axes for probe in probes]
    beside = [np.array([-up, left]) @ gate.plane_axes for (left, up), *_ in probes]
    return tuple(
        PlaneDirection(components(a), components(b), float(probe.both_ways), float(probe.radial))
        for a, b, probe in zip(turned, beside, probes, strict=True)
    )
