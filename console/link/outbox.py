"""The messages that the station sends: published to the vehicle and the base, and recorded."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from bearing_sim.emulator import BearingMeasurement
from bearing_sim.pose_measurement import PoseMeasurement
from console.link.permission import CommandPermission
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import has_attitude, pose_sample
from vehicle_link.clock import time_ns
from vehicle_link.messages import encode
from vehicle_link.messages.records import Message
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.messages import encode_change
from vehicle_link.topics.control_inputs import encode_heartbeat, encode_joy
from vehicle_link.topics.measurements import encode_bearings, pose_messages, position_messages
from vehicle_link.topics.scene import SCENE_TOPICS
from vehicle_link.topics.status import encode_event
from vehicle_link.topics.table import SHARED, TOPICS
from vehicle_link.topics.ticks import TICK_TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import OtherPath

TICKS = "ticks"

RECORDED = tuple(name for name, row in TOPICS.items() if row.recorded and row.sender == "station")
"""Topics recorded as they are sent. Heartbeats are not; telemetry's topics are recorded at full
rate elsewhere."""

INFO, WARN = 20, 30
"""Levels of events (rcl_interfaces/Log)."""
FROM_TELEMETRY = (TICKS, *TICK_TOPICS, *SCENE_TOPICS)
CHECK_PERIOD = 0.2  # s

PutMessage = Callable[[str, str, bytes, int, int], None]
"""Called with topic, type name, payload, log_ns, publish_ns."""


class Outbox:
    """Publishers of the station; any thread may send.

    Args:
        vehicle: its name, which is the namespace of the topics.
        record: called with each message to be recorded.
        vehicle_ns: the vehicle's clock, which stamps everything.
        permission: whether the vehicle accepts messages from us.
        speaker: prefix of lines for the terminal.
        heartbeat_path: the path by the lane of our heartbeats.
    """

    def __init__(
        self,
        node: Node,
        vehicle: str,
        record: PutMessage,
        vehicle_ns: Callable[[], int],
        permission: CommandPermission,
        speaker: str = "station",
        heartbeat_path: OtherPath | None = None,
    ) -> None:
        self._speaker = speaker
        self._vehicle = vehicle
        self._record = record
        self._vehicle_ns = vehicle_ns
        self._permission = permission
        names = (*RECORDED, *SHARED, "station_heartbeat", "stick_status", "marks", *FROM_TELEMETRY)
        self._subscribed: frozenset[str] = frozenset()
        self._check_due = 0.0
        others = {"station_heartbeat": heartbeat_path}
        self._publishers = {name: node.advertise(TOPICS[name], others.get(name)) for name in names}

    def put(self, name: str, payload: bytes, source_ns: int) -> None:
        """Publish a message, and record it if its topic is recorded when sent. Raises LinkError
        when closed.

        Poses, bearings and sticks are neither published nor recorded while the vehicle accepts them
        from another station.
        """
        if TOPICS[name].one_source and not self._permission.sends_measurements:
            return
        self._publishers[name].put(payload, source_ns)
        if name in RECORDED:
            topic, type_name = f"/{self._vehicle}/{name}", TOPICS[name].type_name
            self._record(topic, type_name, payload, time_ns(), source_ns)

    @property
    def subscribed_topics(self) -> frozenset[str]:
        """Return the topics of telemetry that had subscribers at most `CHECK_PERIOD` ago:
        usually none.
        """
        now = time.monotonic()
        if now >= self._check_due:
            self._check_due = now + CHECK_PERIOD
            self._subscribed = frozenset(filter(self.has_subscribers, FROM_TELEMETRY))
        return self._subscribed

    def has_subscribers(self, name: str) -> bool:
        """Return whether any node subscribes to the topic."""
        return self._publishers[name].has_subscribers

    def message(self, name: str, message: Message, stamp_ns: int) -> None:
        """Publish a message that has no encoder of its own."""
        self.put(name, encode(message), stamp_ns)

    def pose(self, pose: PoseMeasurement) -> None:
        """Send a tracked pose, or the position of a marker when it has no attitude."""
        sample = pose_sample(*pose)
        if has_attitude(pose.quaternion_wb):
            self.put("tracker_pose", pose_messages(sample).tobytes(), pose.stamp_ns)
        else:
            self.put("tracker_position", position_messages(sample).tobytes(), pose.stamp_ns)

    def bearings(self, frame: BearingMeasurement) -> None:
        payload = encode_bearings(
            frame.stamp_ns, frame.beacon_ids, frame.bearings_b, frame.sigma, self._vehicle
        )
        self.put("bearings", payload, frame.stamp_ns)

    def joy(self, axes: Sequence[float], enabled: bool) -> None:
        """Send sticks (forward, left, up, yaw) in -1..1 to the vehicle."""
        stamp_ns = self._vehicle_ns()
        self.put("joy", encode_joy(stamp_ns, axes, enabled), stamp_ns)

    def heartbeat(self, count: int) -> None:
        stamp_ns = self._vehicle_ns()
        self.put(
            "station_heartbeat",
            encode_heartbeat(count, stamp_ns, self._permission.instance),
            stamp_ns,
        )

    def say(self, level: int, line: str) -> None:
        """Publish an event: one line for the terminal, the page and the log."""
        print(f"{self._speaker}: {line}", flush=True)
        stamp_ns = self._vehicle_ns()
        self.put("events", encode_event(stamp_ns, level, line, "station"), stamp_ns)

    def parameter_changed(
        self, name: str, old: ParameterValue, value: ParameterValue, requester: str, revision: int
    ) -> None:
        """Publish a changed parameter for our own log and page, and for ROS 2."""
        stamp_ns = self._vehicle_ns()
        instance = self._permission.instance
        change = ParameterChange(
            stamp_ns,
            name,
            old=old,
            new=value,
            requester=requester,
            revision=revision,
            instance=instance,
        )
        self.put("parameter_changes", encode_change(change), stamp_ns)
