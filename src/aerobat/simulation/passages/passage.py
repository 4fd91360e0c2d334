"""Passages through gates: the crossing of each gate's plane, in its direction, next to the planned instant.

A crossing counts once the vehicle's centre gets PASSAGE_DEPTH beyond the plane before it comes back to it;
one that stops in the gate, turns back, or comes from the other side has not passed. A path may cross
obliquely, as the paper's do, whose gates leave the velocity free: it is judged where it crosses, by the
gate's plane all the same. One that moves along the plane passes no gate.

The frame is judged by the body, an ellipsoid with its propellers inside: all that it sweeps of the gate's
plane, from when it comes into the plane until it has left it, is to lie within the opening.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from math import degrees
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import by_value
from aerobat.engines.pytree import components, tree_map
from aerobat.kernels.gates.progress import GatePlane, GateProgress
from aerobat.kernels.gates.section import BoundingEllipsoid, PlaneDirection
from aerobat.kernels.gates.snapshot import Bend, PlaceMotion
from aerobat.kernels.gates.swath import NOWHERE, Extreme, Swath
from aerobat.problem.gate import Gate
from aerobat.problem.opening import EdgeProbe, edge_name
from aerobat.problem.planned_passage import PASSAGE_DEPTH, PlannedPassage
from aerobat.simulation.outcome import FlightFailure, Outcome
from aerobat.vehicle import Ellipsoid

PASSAGE_WINDOW = 0.25  # [s] around the planned instant in which the crossing is looked for


@dataclass(frozen=True, eq=False)
class PerFlight:
    """A finding of one flight, or of many: then fields that they do not share are arrays (flights,)."""

    def __post_init__(self) -> None:
        """Write-protect the arrays of many."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def of_flight(self, k: int) -> Self:
        """One flight's of many, in plain numbers, as are the findings that it holds."""
        return replace(
            self, **{field.name: _of_flight(getattr(self, field.name), k) for field in fields(self)}
        )


def _of_flight(value: Any, k: int) -> Any:
    """One flight's part of a field of many."""
    if isinstance(value, tuple):
        return tuple(_of_flight(each, k) for each in value)
    if isinstance(value, PerFlight):
        return value.of_flight(k)
    return value[k].item() if isinstance(value, np.ndarray) else value


@by_value
class Passage(PerFlight):
    """A gate's plane crossed in its direction, next to the planned instant; NaN where it was not.

    Of many flights, the fields but the first two are arrays (flights,).
    """

    gate: str
    lap: int  # of a course
    time: float  # [s] of the crossing
    miss: float  # [m] from the centre there
    lateral: float  # [m] from the centre there along the gate's lateral axis, to the left
    up: float  # [m] likewise along its upright
    inside: bool  # true if the centre of mass went through the opening
    speed: float  # [m/s]
    attitude_error_deg: float  # angle between the thrust axis and where it shall point
    attitude_tolerance_deg: float  # largest that is allowed; infinite where no attitude is asked
    clearance: float  # [m] the least between body and frame; negative: so far into it; NaN: unknown
    closest_time: float  # [s] when that was
    closest_edge: str  # left, right, upper or lower, as who passes upright sees it; empty: unknown
    closest_lateral: float  # [m] where on that edge: from the opening's centre to the left
    closest_up: float  # [m] likewise along the gate's upright
    needed_width: float  # [m] of the least opening about the same centre that it would have passed
    needed_height: float  # [m] likewise
    planned: float  # [s] when it was to be crossed; NaN where the flight had ended before
    backward_time: float  # [s] of a crossing against the direction about then; infinite where there is none
    max_distance: float  # [m] beyond the plane about then, negative: before it
    min_distance: float  # [m] likewise

    @property
    def failure(self) -> FlightFailure | None:
        """The mistake of one flight; None where nothing is wrong, or known."""
        if np.isnan(self.planned):
            return None
        if np.isnan(self.time):
            return self._instead()
        if not self.inside:
            return self._failed(Outcome.MISSED_GATE, self.time, miss=self.miss)
        if self.clearance < 0.0:
            excess_cm, edge = -100 * self.clearance, self.closest_edge
            return self._failed(Outcome.HIT_FRAME, self.closest_time, excess_cm=excess_cm, edge=edge)
        if self.attitude_error_deg > self.attitude_tolerance_deg:
            angle, tolerance = self.attitude_error_deg, self.attitude_tolerance_deg
            return self._failed(Outcome.WRONG_ATTITUDE, self.time, angle=angle, tolerance=tolerance)
        return None

    def _instead(self) -> FlightFailure:
        """What happened in place of a crossing in the gate's direction."""
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
    """Passages of many flights through one gate.

    Args:
        planned: what was to be passed.
        progress: of the vehicles, offsets from the gate's centre as positions; leaves (flights,).
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
        **_closest(gate, progress.swath.crossing, crossed),
        "planned": known(planned.time, ~ended_before),
        "backward_time": progress.backward,
        "max_distance": known(progress.max_distance, ~ended_before),
        "min_distance": known(progress.min_distance, ~ended_before),
    }
    return Passage(gate.name, planned.lap, **fields)


def _closest(gate: Gate, swath: Swath, crossed: NDArray[np.bool_]) -> dict[str, Any]:
    """What a swath leaves of the opening, and where it is least, each (flights,).

    Args:
        gate: what is passed.
        swath: through its plane, leaves (flights,); none where the body is not known.
        crossed: true where it is crossed.
    """
    opening = gate.opening
    swath = swath or len(opening.probes) * (tree_map(partial(np.full, len(crossed)), NOWHERE),)
    times, reach = (np.stack(part, axis=-1) for part in zip(*(each[:2] for each in swath), strict=True))
    limits = np.array([probe.limit for probe in opening.probes])
    known = crossed & np.isfinite(times).all(axis=-1)
    left = np.where(known[:, None], limits - reach, 0.0)
    nearest = np.argmin(left, axis=-1)
    points = np.stack([_in_opening(*pair) for pair in zip(opening.probes, swath, strict=True)])
    outward = np.stack([opening.outward(k, each) for k, each in enumerate(points)])
    rows = np.arange(len(nearest))
    outward = outward[nearest, rows]
    edge = opening.nearest_on_edge(outward, points[nearest, rows])
    needed = opening.needed(np.where(known[:, None], reach, 0.0))
    numbers = {
        "clearance": left[rows, nearest],
        "closest_time": times[rows, nearest],
        "closest_lateral": edge[:, 0],
        "closest_up": edge[:, 1],
        "needed_width": needed[..., 0],
        "needed_height": needed[..., 1],
    }
    places = {name: np.where(known, values, np.nan) for name, values in numbers.items()}
    names = [edge_name(normal) if there else "" for normal, there in zip(outward, known, strict=True)]
    return places | {"closest_edge": np.array(names)}


def _in_opening(probe: EdgeProbe, extreme: Extreme) -> Array:
    """The points (left, up) of a gate's plane that reach the farthest along a probe [m], (flights, 2)."""
    left, up = probe.direction
    along, beside = extreme.point
    return np.stack([left * along - up * beside, up * along + left * beside], axis=-1)


def gate_places(
    planned: Sequence[PlannedPassage], ellipsoid: BoundingEllipsoid | tuple[()]
) -> list[tuple[GatePlane, BoundingEllipsoid | tuple[()]]]:
    """Planned passages as kernels read them, leaves numbers, each with what encloses the vehicle.

    Without that, no body is measured.
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
    """The ellipsoid that encloses a vehicle as kernels read it, leaves numbers; () where none is known."""
    if body is None:
        return ()
    return BoundingEllipsoid(components(body.centre), components(body.semi_axes))


def _motion(gate: Gate) -> PlaceMotion | tuple[()]:
    """The motion of a gate that moves."""
    if gate.motion is None:
        return ()
    bends = zip(gate.motion.times.tolist(), gate.motion.turns, strict=True)
    return PlaceMotion(components(gate.velocity), tuple(Bend(time, components(by)) for time, by in bends))


def _directions(gate: Gate) -> tuple[PlaneDirection, ...]:
    """The directions in which a body that passes a gate is measured."""
    probes = gate.opening.probes
    turned = [probe.direction @ gate.plane_axes for probe in probes]
    beside = [np.array([-up, left]) @ gate.plane_axes for (left, up), *_ in probes]
    return tuple(
        PlaneDirection(components(a), components(b), float(probe.both_ways), float(probe.radial))
        for a, b, probe in zip(turned, beside, probes, strict=True)
    )
