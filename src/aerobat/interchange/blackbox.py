"""Betaflight's blackbox logs, decoded by the package betaflight-chirp-core."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import PathName, by_value, validated
from aerobat.errors import SpecError, import_extra
from aerobat.storage import read_whole

MAX_LOG = 2**27  # bytes
_STEP = 0.005  # [s] between the starts that are tried


@by_value
class Blackbox:
    """The rates of a flight in a flight controller's log, by its own clock. Axes are FLU."""

    times: Array  # [s], (T,), rising
    omega_body: Array  # [rad/s] by the gyro, filtered, (T, 3)
    rate_setpoint: Array  # [rad/s] commanded by the sticks, (T, 3)
    motors: Array  # [-] fractions of the range, in the firmware's order, (T, n)

    def begin(self, times: Array, omega_body: Array) -> float:
        """Return the start of the plan by the log's clock [s], at which planned and measured rates fit best.

        Args:
            times: Times of the plan [s], rising, (N,).
            omega_body: Planned rates at these times [rad/s], (N, 3).

        Raises SpecError for a log that is shorter than the plan.
        """
        last = float(self.times[-1] - times[-1])
        begins = np.arange(float(self.times[0]), last + _STEP, _STEP)
        if last < self.times[0]:
            raise SpecError("the log is shorter than the plan; give the flight's own plan")
        misfits = [float(np.mean((self._rates(times + begin) - omega_body) ** 2)) for begin in begins]
        return float(begins[int(np.argmin(misfits))])

    def _rates(self, times: Array) -> Array:
        return np.stack([np.interp(times, self.times, axis) for axis in self.omega_body.T], axis=-1)


@validated
def read_blackbox(path: PathName) -> Blackbox:
    """Read the last flight of a Betaflight blackbox log, such as `aerobat fly --autopilot betaflight` writes.

    Raises SpecError for a file that is no such log, BackendMissing without betaflight-chirp-core.
    """
    try:
        raw = read_whole(path, MAX_LOG)
        names, rows, header = _decoded(raw)
        columns = {name: rows[:, names.index(name)] for name in names}
        low, high = header["motorOutput"]
        scale = pi / 180.0 / (10.0 if header.get("blackbox_high_resolution") else 1.0)
        motors = [columns[name] for name in names if name.startswith("motor[")]
        return Blackbox(
            times=1e-6 * columns["time"],
            omega_body=scale * _three(columns, "gyroADC"),
            rate_setpoint=scale * _three(columns, "setpoint"),
            motors=(np.stack(motors, axis=-1) - low) / (high - low),
        )
    except SpecError as error:
        raise SpecError(f"blackbox log {path}: {error}") from None
    except (KeyError, ValueError, IndexError, TypeError):
        raise SpecError(
            f"blackbox log {path}: it has no flight with gyro, setpoint and motors; log these in NORMAL mode"
        ) from None


def _three(columns: dict[str, Array], name: str) -> Array:
    return np.stack([columns[f"{name}[{axis}]"] for axis in range(3)], axis=-1)


def _decoded(raw: bytes) -> tuple[list[str], Array, dict[str, Any]]:
    """Return the names and rows of the last flight's frames, and its settings."""
    package = "betaflight-chirp-core"
    decoder = import_extra("betaflight_chirp_core.decoder", f"blackbox logs need {package}", package)
    parser = decoder.FlightLogParser(raw, *decoder.split_sessions(raw)[-1])
    parser.parse_header()
    parser.parse_data()
    names = parser.frame_defs["I"]["name"]
    rows = np.array([row[: len(names)] for row in parser.main_frames], dtype=np.float64)
    rising = np.diff(rows[:, names.index("time")], prepend=-1.0) > 0.0
    return names, rows[rising], parser.sys_config
