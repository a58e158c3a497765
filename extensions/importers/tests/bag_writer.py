"""A flight as a bag of ROS 1 or ROS 2: /imu and /pose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from extensions.importers.tests.foreign_flight import ForeignFlight


def write_bag(path: Path, flight: ForeignFlight, version: int, *, mcap: bool = False) -> Path:
    """Write a new bag; ROS 2's is a folder, of SQLite or of MCAP."""
    storage = rosbag2.StoragePlugin.MCAP if mcap else rosbag2.StoragePlugin.SQLITE3
    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_JAZZY)
    types = store.types
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    quaternion, pose = types["geometry_msgs/msg/Quaternion"], types["geometry_msgs/msg/Pose"]
    covariance = np.zeros(9)
    writer: Any = (
        rosbag1.Writer(path)
        if version == 1
        else rosbag2.Writer(path, version=9, storage_plugin=storage)
    )
    encode = store.serialize_ros1 if version == 1 else store.serialize_cdr
    with writer:
        imu, poses = "sensor_msgs/msg/Imu", "geometry_msgs/msg/PoseStamped"
        links = [
            writer.add_connection("/imu", imu, typestore=store),
            writer.add_connection("/pose", poses, typestore=store),
        ]
        for k, ns in enumerate(np.round(flight.seconds * 1e9).astype(np.int64).tolist()):
            stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
            more = {"seq": k} if version == 1 else {}
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **more)
            x, y, z, w = flight.rotation[k].as_quat().tolist()
            turned = quaternion(x=x, y=y, z=z, w=w)
            rate, force = vector(*flight.rate[k].tolist()), vector(*flight.force[k].tolist())
            sample = types[imu](header, turned, covariance, rate, covariance, force, covariance)
            place = pose(position=point(*flight.position[k].tolist()), orientation=turned)
            for link, message in zip(links, (sample, types[poses](header, place)), strict=True):
                writer.write(link, ns, encode(message, link.msgtype))
    return path
