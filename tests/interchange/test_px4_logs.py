"""Set-points for PX4 beside a log of the same messages, read by PX4's own tool, `ulog2csv`."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pandas as pd
from pyulog.ulog2csv import convert_ulog2csv

import aerobat as ab
from aerobat.interchange.exports.px4 import ATTITUDE, PATH, RATES
from shared_plans import shared_plan

# the messages of PX4 1.15, as msg/*.msg of PX4/PX4-Autopilot define them, beginning with the timestamp
DEFINITIONS = {
    ATTITUDE: "float yaw_sp_move_rate;float[4] q_d;float[3] thrust_body;bool fw_control_yaw_wheel",
    RATES: "float roll;float pitch;float yaw;float[3] thrust_body;bool reset_integral",
    PATH: "float[3] position;float[3] velocity;float[3] acceleration;float[3] jerk;float yaw;float yawspeed",
}


def chunk(kind: str, data: bytes) -> bytes:
    """A message of a ULog file."""
    return struct.pack("<HB", len(data), ord(kind)) + data


def log_of(tables: dict[str, pd.DataFrame]) -> bytes:
    """A ULog file of messages that hold the rows of our tables."""
    formats, added, logged = b"", b"", b""
    for number, (file, table) in enumerate(tables.items()):
        name, definition = file.removesuffix("_0.csv"), DEFINITIONS[file]
        formats += chunk("F", f"{name}:uint64_t timestamp;{definition};".encode())
        added += chunk("A", struct.pack("<BH", 0, number) + name.encode())
        flag = b"\0" if "bool" in definition else b""
        for row in table.itertuples(index=False):
            values = np.array(row[1:], dtype="<f4").tobytes()
            logged += chunk("D", struct.pack("<HQ", number, int(row[0])) + values + flag)
    return b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + formats + added + logged


def test_tables_are_those_that_ulog2csv_writes_of_the_same_messages(tmp_path: Path) -> None:
    """Its names in its order, and the same numbers; flags, which plans have none of, it adds at the end."""
    ab.export(shared_plan("flip-roll"), tmp_path / "ours", "px4")
    ours = {file: pd.read_csv(tmp_path / "ours" / file) for file in DEFINITIONS}
    (tmp_path / "flight.ulg").write_bytes(log_of(ours))
    convert_ulog2csv(str(tmp_path / "flight.ulg"), None, None, ",", None, None, False)
    for file, table in ours.items():
        theirs = pd.read_csv(tmp_path / f"flight_{file}")
        flags = [column for column in theirs if column not in table]
        assert list(theirs) == [*table, *flags]
        assert len(flags) == DEFINITIONS[file].count("bool")
        np.testing.assert_array_equal(theirs[table.columns].astype("f4"), table.astype("f4"))
        np.testing.assert_array_equal(theirs["timestamp"], table["timestamp"])
