"""Flights that another system recorded, read from a CSV file with named columns, for inspection."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import PathName, validated
from aerobat.documents import read_text, within
from aerobat.errors import SpecError
from aerobat.flatness import reference, vehicle_of
from aerobat.interchange.number_table import NAMES, has_header, named_columns
from aerobat.kernels.motors import first_order_response
from aerobat.planning import Plan
from aerobat.simulation import Flight, Outcome
from aerobat.simulation.flight import LOG_OF_COMMANDS, setpoint_series
from aerobat.vehicle import Vehicle

MAX_LOG = 2**27  # bytes: ten minutes at 1 kHz
MIN_ROWS = 3  # for rates by differences
MIN_STEP = 1e-6  # [s] between rows
MAX_VALUE = 1e6  # [m], [m/s], [rad/s] or [N]; no multirotor reaches that
ESTIMATED_POSITION = ("est_x", "est_y", "est_z")
ESTIMATED_VELOCITY = ("est_vx", "est_vy", "est_vz")
_GROUPS = ("time", "position", "attitude", "velocity", "rates")
_USED = {*chain(*(NAMES[group] for group in _GROUPS)), *ESTIMATED_POSITION, *ESTIMATED_VELOCITY}


@validated
def read_flight_log(path: PathName, plan: Plan, vehicle: Vehicle | str | None = None) -> Flight:
    """Read a recorded flight of a plan from a CSV file with a header.

    Required columns are `t` [s] on the plan's clock and the true pose `x, y, z` [m] and `qw, qx, qy, qz`
    (world ENU, body FLU). For each rotor, its thrust `f0, f1, ...` [N], its command `u0, u1, ...` [N], or
    both are required, too. Optional columns are `vx, vy, vz` [m/s] world, `wx, wy, wz` [rad/s] body, and
    `est_x, ..., est_vz`, the observer's position and velocity.

    Missing rates are computed from the pose, and missing thrusts or commands from each other by the rotors'
    lags. Other columns, and rows outside the plan's time, are ignored.

    Args:
        path: The file.
        plan: The plan that was flown; the flight has its set-points.
        vehicle: The nominal vehicle, or its name; by default the plan's.

    Raises SpecError, naming the line or the column, for a file without such a table.
    """
    nominal = vehicle_of(plan, vehicle)
    with within(f"flight log {path}: "):
        columns = _columns(read_text(Path(path), MAX_LOG), plan.duration)
        return _flight(columns, plan, nominal)


def _columns(text: str, duration: float) -> dict[str, Array]:
    """Return the used columns by their names, with the rows within the plan's time."""
    if not has_header(text):
        raise SpecError("line 1: it names no columns; a log needs t, x, y, z, qw, qx, qy, qz and f0, f1, ...")
    needed = (*NAMES["time"], *NAMES["position"], *NAMES["attitude"])
    columns = named_columns(text, needed, "a log needs t, x, y, z, qw, qx, qy, qz")
    close = np.diff(columns["t"]) < MIN_STEP
    if close.any():
        line = 3 + int(np.argmax(close))
        raise SpecError(f"line {line}: times, the column t, must rise, by {MIN_STEP:g} s or more")
    flown = (columns["t"] >= 0.0) & (columns["t"] <= duration)
    if flown.sum() < MIN_ROWS:
        raise SpecError(
            f"{flown.sum()} of its rows lie within the plan's time, 0 to {duration:.3f} s; "
            "let t be 0 where the plan begins"
        )
    steps = np.diff(columns["t"][flown])
    if steps.max() > max(20.0 * np.median(steps), 0.25):  # [s] longer steps are gaps
        line = 3 + int(np.argmax(flown)) + int(np.argmax(steps))
        raise SpecError(
            f"line {line}: t rises by {steps.max():.3g} s, where rows are {np.median(steps):.2g} s apart; "
            "give a part without gaps"
        )
    used = {
        name: column[flown]
        for name, column in columns.items()
        if name in _USED or (name[0] in "fu" and name[1:].isdecimal())
    }
    for name, column in used.items():
        if np.abs(column).max() > MAX_VALUE:
            line = 2 + int(np.argmax(np.abs(columns[name]) * flown))
            raise SpecError(f"line {line}: the column {name} is beyond {MAX_VALUE:g}; see its unit")
    return used


def _flight(columns: Mapping[str, Array], plan: Plan, nominal: Vehicle) -> Flight:
    times, position = columns["t"], _group(columns, NAMES["position"])
    attitude = _group(columns, NAMES["attitude"])
    norms = np.linalg.norm(attitude, axis=1)
    if not ((norms > 0.5) & (norms < 2.0)).all():
        raise SpecError("qw, qx, qy, qz must be unit quaternions in every row")
    q = so3.normalize(attitude)
    planned = reference(plan, nominal, times=times)
    _require_near(position, planned.setpoint.flat.position)
    _require_aligned(q, planned.setpoint.q_world_body)
    thrusts, commands = _of_rotors(columns, planned.rotor_thrusts[0], nominal)
    are_measured = all(f"f{k}" in columns for k in range(len(nominal.rotors)))
    span = nominal.max_thrusts - nominal.min_thrusts
    margin = np.minimum(commands - nominal.min_thrusts, nominal.max_thrusts - commands)
    series = {
        "position": position,
        "velocity": _group(columns, NAMES["velocity"], _rate(times, position)),
        "q_world_body": q,
        "omega_body": _group(columns, NAMES["rates"], _turning(times, q)),
        "commands": commands,
        "thrusts": thrusts,
        "saturated": ((margin <= 1e-3 * span) & (span > 0.0)).any(axis=1),  # a dead rotor has no range
        "min_thrusts": nominal.min_thrusts,
        "max_thrusts": nominal.max_thrusts,
        "ends": times[-1],
        **setpoint_series(planned.setpoint),
    }
    if all(name in columns for name in ESTIMATED_POSITION):
        seen = _group(columns, ESTIMATED_POSITION)
        series |= {
            "observed_position": seen,
            "observed_velocity": _group(columns, ESTIMATED_VELOCITY, _rate(times, seen)),
            "observed_q_world_body": q,
            "since_pose": np.zeros(len(times)),
        }
    return Flight(
        times=times,
        series=series,
        vehicles=(nominal.name,),
        outcomes=(Outcome.COMPLETE,),
        sentences=("recorded by another system",),
        engine="log" if are_measured else LOG_OF_COMMANDS,
        environment=plan.problem.surroundings,
    )


def _require_newtons(names: tuple[str, ...], thrusts: Array, nominal: Vehicle) -> None:
    """Refuse thrusts (T, n) of which one is above twice its rotor's maximum, as in another unit."""
    for name, thrust, most in zip(names, thrusts.T, nominal.max_thrusts, strict=True):
        if thrust.max() > 2.0 * most:
            raise SpecError(
                f"the column {name} reaches {thrust.max():.3g}, where {nominal.name}'s rotor gives "
                f"{most:.3g} N at most; give newtons"
            )


def _require_near(position: Array, planned: Array) -> None:
    """Refuse positions of another path, in other units or along other axes.

    Their median distance from the plan is above half of the plan's extent, and above 0.5 m.
    """
    off = float(np.median(np.linalg.norm(position - planned, axis=1)))
    if off > max(0.5 * float(np.linalg.norm(np.ptp(planned, axis=0))), 0.5):
        raise SpecError(
            f"x, y, z are {off:.3g} m from the plan's path half of the time; give metres, x east, y north, "
            "z up, of a flight of this plan"
        )


def _require_aligned(q_world_body: Array, planned: Array) -> None:
    """Refuse attitudes between other axes, and quaternions in another order."""
    off = float(np.median(so3.angle_between(planned, q_world_body)))
    if off > np.pi / 2.0:
        raise SpecError(
            f"qw, qx, qy, qz are {np.rad2deg(off):.3g}° from the plan's attitude half of the time; give qw "
            "first, and turns from the body's axes, x forward, y left, z up, to the world's"
        )


def _group(columns: Mapping[str, Array], names: tuple[str, ...], otherwise: Array | None = None) -> Array:
    """Return columns side by side, (T, len(names)), or `otherwise`, if given, where one is missing."""
    if otherwise is not None and not all(name in columns for name in names):
        return otherwise
    return np.stack([columns[name] for name in names], axis=1)


def _of_rotors(columns: Mapping[str, Array], first: Array, nominal: Vehicle) -> tuple[Array, Array]:
    """Return thrusts and commands [N] of all rotors, (T, n) each; a missing one follows from the other.

    Thrusts that are computed begin with `first` [N], the plan's, (n,).
    """
    times, count = columns["t"], len(nominal.rotors)
    given = {}
    for letter in "fu":
        names = tuple(f"{letter}{k}" for k in range(count))
        if all(name in columns for name in names):
            given[letter] = _group(columns, names)
            _require_newtons(names, given[letter], nominal)
        if f"{letter}{count}" in columns:
            raise SpecError(
                f"line 1: there is a column {letter}{count}, and {nominal.name} has {count} rotors"
            )
    if not given:
        raise SpecError(
            f"line 1: there are neither f0 to f{count - 1}, the rotors' thrusts [N], nor u0 to u{count - 1}, "
            "their commands; one of them tells saturation from what the vehicle's model lacks"
        )
    thrusts, commands = given.get("f"), given.get("u")
    if commands is None:
        assert thrusts is not None, "one of them was given"
        led = thrusts + nominal.lags * np.gradient(thrusts, times, axis=0)
        return thrusts, np.clip(led, nominal.min_thrusts, nominal.max_thrusts)
    return (_followed(times, first, commands, nominal.lags) if thrusts is None else thrusts), commands


def _followed(times: Array, first: Array, commands: Array, lags: Array) -> Array:
    """Return the thrusts [N] of rotors that follow commands by their lags, from the first thrusts on."""
    decays = np.exp(-np.diff(times)[:, None] / np.maximum(lags, 1e-9))
    thrusts = [first]
    for command, decay in zip(commands[:-1], decays, strict=True):
        thrusts.append(np.array(first_order_response(tuple(thrusts[-1]), command, decay)))
    return np.array(thrusts)


def _rate(times: Array, values: Array) -> Array:
    return np.asarray(np.gradient(values, times, axis=0))


def _turning(times: Array, q: NDArray[np.float64]) -> Array:
    """Return the body rates [rad/s] between attitudes, (T, 3), the first one twice."""
    turns = so3.box_minus(q[1:], q[:-1]) / np.diff(times)[:, None]
    return np.concatenate([turns[:1], turns])
