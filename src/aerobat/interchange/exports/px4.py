"""Set-points for PX4: attitude, rates and thrust, and the path, in the fields and axes of its messages.

Each message is a table with the name and layout that `ulog2csv` gives to the messages of a flight's log. The
same program can thus read plan and log. World axes are NED, body axes FRD, and numbers float32, as in the
messages.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.flatness import reference
from aerobat.interchange.exports.loss import Content, ExportRows
from aerobat.interchange.tables import csv_text
from aerobat.planning import Plan

ATTITUDE, RATES, PATH = SETPOINTS = (
    "vehicle_attitude_setpoint_0.csv",
    "vehicle_rates_setpoint_0.csv",
    "trajectory_setpoint_0.csv",
)
MICROSECONDS = 1e6
NED_ENU = np.array([0.0, -np.sqrt(0.5), -np.sqrt(0.5), 0.0])  # ENU to NED: swaps x and y, negates z
FLU_FRD = np.array([0.0, 1.0, 0.0, 0.0])  # FRD to FLU, or back: half a turn about x


def px4_setpoints(plan: Plan, rate: float) -> Content:
    """Return the set-points of a plan with a vehicle at `rate` [1/s] and at the end.

    Each row is held until the next. The plan between rows is lost, and digits beyond microseconds and
    float32.
    """
    assert plan.vehicle is not None, "exports are of plans with a vehicle"
    timestamps = np.unique(np.floor(plan.trajectory.sample(rate) * MICROSECONDS))
    found = reference(plan, times=timestamps / MICROSECONDS)
    flat = found.setpoint.flat
    position, velocity, acceleration, jerk = (
        _float32(ned(curve)) for curve in (flat.position, flat.velocity, flat.acceleration, flat.jerk)
    )
    q_d = _float32(so3.multiply(so3.multiply(NED_ENU, found.setpoint.q_world_body), FLU_FRD))
    rates = _float32(found.setpoint.omega_body * np.array([1.0, -1.0, -1.0]))
    fraction = found.setpoint.wrench.thrust / plan.vehicle.max_thrusts.sum()  # [-] of the maximum thrust
    thrust = _float32(fraction[:, None] * np.array([0.0, 0.0, -1.0]))
    zero = _float32(np.zeros(len(timestamps)))
    messages: Mapping[str, Mapping[str, Array]] = {
        ATTITUDE: {"yaw_sp_move_rate": zero, "q_d": q_d, "thrust_body": thrust},
        RATES: {"roll": rates[:, 0], "pitch": rates[:, 1], "yaw": rates[:, 2], "thrust_body": thrust},
        PATH: {
            "position": position,
            "velocity": velocity,
            "acceleration": acceleration,
            "jerk": jerk,
            "yaw": _float32(_yaw(q_d)),
            "yawspeed": np.full_like(zero, np.nan),
        },
    }
    q_world_body = so3.multiply(
        so3.multiply(so3.conjugate(NED_ENU), so3.normalize(q_d)), so3.conjugate(FLU_FRD)
    )
    rows = ExportRows(found.times, ned(position), ned(velocity), q_world_body)
    files = tuple(_table(timestamps, messages[name]) for name in SETPOINTS)
    return Content(files, rows.loss(plan, held=True))


def ned(vectors: Array) -> Array:
    """Convert vectors (..., 3) from ENU to NED axes, or back."""
    return np.asarray(vectors[..., [1, 0, 2]] * np.array([1.0, 1.0, -1.0]))


def _yaw(q_ned_frd: Array) -> Array:
    """Return the heading of the body's x axis [rad], from north to east, (T,)."""
    forward = so3.rotate(q_ned_frd, np.array([1.0, 0.0, 0.0]))
    return np.asarray(np.arctan2(forward[:, 1], forward[:, 0]))


def _float32(values: Array) -> Array:
    """Return the values as float32, without negative zeros."""
    return np.asarray(np.asarray(values, dtype=np.float32) + np.float32(0.0))


def _table(timestamps: Array, fields: Mapping[str, Array]) -> bytes:
    """Return a table of timestamps [µs] and a message's fields, numbers (T,) or arrays (T, n), of float32."""
    header = ["timestamp"]
    for name, values in fields.items():
        header += [name] if values.ndim == 1 else [f"{name}[{i}]" for i in range(values.shape[1])]
    rows = zip(timestamps.astype(int), np.column_stack(list(fields.values())), strict=True)
    return csv_text([header, *([time, *row] for time, row in rows)]).encode()
