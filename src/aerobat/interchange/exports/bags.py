"""Bags of ROS 1 and ROS 2, written without ROS: a plan's path, poses and markers at their times."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from aerobat.errors import import_extra
from aerobat.flatness import reference
from aerobat.interchange.exports.loss import Content, ExportRows
from aerobat.interchange.ros import NANOSECONDS, Messages, PlanMessages, Stamped
from aerobat.interchange.solids import flattened
from aerobat.planning import Plan

_BLANK: Mapping[str, Any] = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}  # else integers
NAME = "plan"
ROS2_BAG = ("metadata.yaml", f"{NAME}.db3")


@dataclass(frozen=True)
class StoredTypes:
    """A maker of one distribution's messages; see `Make`."""

    store: Any  # of types, a Typestore of `rosbags`

    def __call__(self, kind: str, /, **given: Any) -> Any:
        """Return a message of a kind; fields that are not given are zero, empty or false."""
        fields = dict(self.store.fielddefs[kind][1])
        return self.store.types[kind](
            **{name: given[name] if name in given else self._blank(node) for name, node in fields.items()}
        )

    def _blank(self, node: Any) -> Any:
        form, content = node
        if form.name == "NAME":
            return self(content)
        if form.name == "BASE":
            return _BLANK.get(content[0], 0)
        (_, element), count = content
        numeric = isinstance(element, tuple) and element[0] != "string"
        return np.zeros(count if form.name == "ARRAY" else 0, dtype=element[0]) if numeric else []


def _bag(container: str, plan: Plan, rate: float) -> Content:
    """Return the bag of a plan with a vehicle, with messages at `rate` [1/s] and at the end.

    The plan between messages is lost. Raises BackendMissing without rosbags.
    """
    import_extra("rosbags", "bags need rosbags", "aerobat[ros]", "export to csv")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if container == "ros1" else Stores.ROS2_HUMBLE)
    times = np.unique(np.floor(plan.trajectory.sample(rate) * NANOSECONDS)) / NANOSECONDS
    found = reference(plan, times=times)
    made = PlanMessages(Messages(StoredTypes(store)), plan).all(found)
    messages = sorted(made, key=lambda each: each.stamp)
    loss = replace(ExportRows.of(found).loss(plan), obstacles=flattened(plan))
    with tempfile.TemporaryDirectory() as scratch:  # rosbags writes to folders only
        path = Path(scratch) / NAME
        _write(container, store, messages, path)
        files = {"ros1": [path], "ros2": [path / name for name in ROS2_BAG], "mcap": [path / f"{NAME}.mcap"]}
        return Content(tuple(file.read_bytes() for file in files[container]), loss)


ros1_bag = partial(_bag, "ros1")
ros2_bag = partial(_bag, "ros2")
mcap = partial(_bag, "mcap")


def _write(container: str, store: Any, messages: Sequence[Stamped], path: Path) -> None:
    """Write messages to a new bag; each topic is added before its first message.

    Args:
        container: The kind of the bag: ros1, ros2 or mcap.
        store: The types of the messages.
        messages: The messages, in order of time.
        path: The bag, which for ROS 2 is a folder.
    """
    from rosbags import rosbag1, rosbag2

    writer: Any
    if container == "ros1":
        writer, serialize = rosbag1.Writer(path), store.serialize_ros1
    else:
        plugin = rosbag2.StoragePlugin.MCAP if container == "mcap" else rosbag2.StoragePlugin.SQLITE3
        version = rosbag2.Writer.VERSION_LATEST
        writer, serialize = rosbag2.Writer(path, version=version, storage_plugin=plugin), store.serialize_cdr
    connections: dict[str, Any] = {}
    with writer as bag:
        for each in messages:
            if each.topic not in connections:
                connections[each.topic] = bag.add_connection(each.topic, each.kind, typestore=store)
            bag.write(connections[each.topic], each.stamp, serialize(each.message, each.kind))
