"""Exported files as readers that others wrote have them, turned into our axes by formulas of their own."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pandas as pd
from mcap.reader import make_reader
from mcap.records import Schema
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap_ros2.decoder import DecoderFactory
from pygltflib import GLTF2
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation, Slerp

START = 1.0  # [s] stamp of a plan's start in bags
ENU_OF_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_OF_FLU = np.diag([1.0, -1.0, -1.0])
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # of glTF's axes, y up


@dataclass(frozen=True)
class Read:
    """What a file says at its rows, ENU and FLU."""

    times: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    attitude: Rotation  # body to world

    def at(self, times: np.ndarray, held: bool) -> tuple[np.ndarray, np.ndarray, Rotation]:
        """Position, velocity and attitude between rows, by straight lines or `held`."""
        if held:
            row = np.searchsorted(self.times, times, side="right") - 1
            return self.position[row], self.velocity[row], self.attitude[row]
        lines = (
            np.stack([np.interp(times, self.times, column) for column in rows.T], axis=1)
            for rows in (self.position, self.velocity)
        )
        position, velocity = lines
        return position, velocity, Slerp(self.times, self.attitude)(times)


def read_csv(path: Path) -> Read:
    """By pandas."""
    table = pd.read_csv(path)
    return Read(
        table["t"].to_numpy(),
        table[["x", "y", "z"]].to_numpy(),
        table[["vx", "vy", "vz"]].to_numpy(),
        Rotation.from_quat(table[["qx", "qy", "qz", "qw"]].to_numpy()),
    )


def read_px4(path: Path) -> Read:
    """By pandas, as a log's tables."""
    attitude = pd.read_csv(path / "vehicle_attitude_setpoint_0.csv")
    setpoints = pd.read_csv(path / "trajectory_setpoint_0.csv")
    assert (attitude["timestamp"] == setpoints["timestamp"]).all()
    q_d = attitude[[f"q_d[{i}]" for i in (1, 2, 3, 0)]].to_numpy()
    turns = ENU_OF_NED @ Rotation.from_quat(q_d).as_matrix() @ FRD_OF_FLU
    position, velocity = (
        setpoints[[f"{name}[{i}]" for i in range(3)]].to_numpy() @ ENU_OF_NED.T
        for name in ("position", "velocity")
    )
    return Read(attitude["timestamp"].to_numpy() / 1e6, position, velocity, Rotation.from_matrix(turns))


def read_glb(path: Path) -> Read:
    """By pygltflib; the velocity is that of the straight lines."""
    scene = GLTF2().load(str(path))
    blob = scene.binary_blob()

    def array(number: int) -> np.ndarray:
        accessor = scene.accessors[number]
        view = scene.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
        assert accessor.componentType == 5126
        flat = np.frombuffer(blob, "<f4", accessor.count * width, view.byteOffset)
        assert flat.reshape(-1, width).max(axis=0).tolist() == accessor.max
        return flat.reshape(-1, width).astype(float)

    (animation,) = scene.animations
    curves = {}
    for channel in animation.channels:
        sampler = animation.samplers[channel.sampler]
        assert sampler.interpolation == "LINEAR"
        times = array(sampler.input)[:, 0]
        curves[channel.target.path] = array(sampler.output)
    position = curves["translation"] @ Z_UP.T
    turns = Z_UP @ Rotation.from_quat(curves["rotation"]).as_matrix() @ Z_UP.T
    slopes = np.diff(position, axis=0) / np.diff(times)[:, None]
    return Read(times, position, np.concatenate([slopes, slopes[-1:]]), Rotation.from_matrix(turns))


def _of_messages(messages: Sequence[tuple[int, Any]]) -> Read:
    """What odometry says: poses in the world, velocities in the body."""
    assert [stamp for stamp, _ in messages] == [_nanoseconds(m.header.stamp) for _, m in messages]
    poses = [message.pose.pose for _, message in messages]
    attitude = Rotation.from_quat([[getattr(p.orientation, each) for each in "xyzw"] for p in poses])
    in_body = np.array([[getattr(m.twist.twist.linear, each) for each in "xyz"] for _, m in messages])
    assert {(m.header.frame_id, m.child_frame_id) for _, m in messages} == {("world", "base_link")}
    return Read(
        np.array([stamp for stamp, _ in messages]) / 1e9 - START,
        np.array([[getattr(p.position, each) for each in "xyz"] for p in poses]),
        attitude.apply(in_body),
        attitude,
    )


def _nanoseconds(stamp: Any) -> int:
    return int(getattr(stamp, "sec", None) or getattr(stamp, "secs", 0)) * 10**9 + int(
        getattr(stamp, "nanosec", None) or getattr(stamp, "nsecs", 0)
    )


def bag_messages(path: Path) -> Iterator[tuple[str, int, Any]]:
    """Topic, stamp [ns] and message of a bag of any kind, in its order.

    MCAP by the reader of its makers, rows of ROS 2's SQLite by sqlite3 and that reader's decoder, ROS 1 by
    rosbags.
    """
    if path.suffix == ".mcap":
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for _, channel, message, decoded in reader.iter_decoded_messages():
                yield channel.topic, message.log_time, decoded
    elif path.suffix == ".bag":
        store = get_typestore(Stores.ROS1_NOETIC)
        with Reader(path) as bag:
            for connection, stamp, raw in bag.messages():
                yield connection.topic, stamp, store.deserialize_ros1(raw, connection.msgtype)
    else:
        with sqlite3.connect(path / "plan.db3") as rows:
            store = get_typestore(Stores.ROS2_HUMBLE)
            decoders: dict[str, Callable[[bytes], Any]] = {}
            query = "SELECT name, type, timestamp, data FROM messages JOIN topics ON topics.id = topic_id"
            for topic, kind, stamp, raw in rows.execute(query + " ORDER BY messages.id"):
                if kind not in decoders:
                    definition, _ = store.generate_msgdef(kind, ros_version=2)
                    schema = Schema(len(decoders) + 1, definition.encode(), SchemaEncoding.ROS2, kind)
                    decoders[kind] = DecoderFactory().decoder_for(MessageEncoding.CDR, schema)
                yield topic, stamp, decoders[kind](raw)


def read_bag(path: Path) -> Read:
    """The odometry of a bag."""
    return _of_messages(
        [(stamp, m) for topic, stamp, m in bag_messages(path) if topic == "/aerobat/odometry"]
    )


def read_mujoco(path: Path) -> Read:
    """The keyframes of a model, as MuJoCo has them."""
    model = mujoco.MjModel.from_xml_path(str(path))
    attitude = Rotation.from_quat(model.key_qpos[:, [4, 5, 6, 3]])
    return Read(model.key_time.copy(), model.key_qpos[:, :3].copy(), model.key_qvel[:, :3].copy(), attitude)


READERS: dict[str, Callable[[Path], Read]] = {
    "csv": read_csv,
    "px4": read_px4,
    "blender": read_glb,
    "mujoco": read_mujoco,
    "ros1-bag": read_bag,
    "ros2-bag": read_bag,
    "mcap": read_bag,
}
