"""The figures of a flight while it is flown are those that a verdict computes of its log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.evaluation.tracking import tracking_errors
from console.exchange.telemetry import expanded, messages_of
from flight_log import LogWriter
from tests.support.live_signals import START_NS, Received, packets_of, ticks_of
from vehicle_link.messages import encode, header, new
from vehicle_link.telemetry import unpack
from vehicle_link.topics.table import TOPICS
from web.latest import TICKS
from web.live.tracking import LiveTracking

BEHAVIORS = {0.0: "take_off", 2.0: "hover", 4.0: "follow_trajectory", 9.0: "land"}


def flown(path: Path, topic: str, seconds: float = 10.0) -> tuple[LiveTracking, list[Any]]:
    """Write a flight as a station records it; return what a page saw, four times a second."""
    random, received, seen = np.random.default_rng(11), Received(), []
    tracking = LiveTracking(received.log)
    ticks = ticks_of(round(500 * seconds))
    moving = np.cumsum(random.normal(0.0, 0.002, (len(ticks), 3)), axis=0)
    ticks["reference"]["position_w"], ticks["reference"]["yaw"] = moving, moving[:, 0]
    ticks["state"]["position_w"] = moving + random.normal(0.0, 0.001, moving.shape)
    with LogWriter(path, {"vehicle": "quad1", "recorder": "station"}, {}) as writer:

        def put(name: str, message: Any, stamp_ns: int) -> None:
            payload = encode(message)
            received.live.put(name, payload, stamp_ns)
            row = f"/quad1/{name}", TOPICS[name].type_name, payload
            writer.write(*row, stamp_ns + 10_000_000, stamp_ns)

        for k, packet in enumerate(packets_of(ticks)):
            time, of_packet = 0.01 * k, unpack(packet)[1]
            stamp_ns = START_NS + round(1e9 * time)
            behavior = BEHAVIORS[max(at for at in BEHAVIORS if at <= time + 1e-9)]
            if k % 20 == 0:
                fields = {"header": header(stamp_ns), "behavior": behavior, "airborne": True}
                put("status", new("quadlab_msgs/VehicleStatus", **fields), stamp_ns)
            at_ns = stamp_ns + 700_000
            position = moving[5 * k] + random.normal(0.0, 0.003, 3) + (k % 37 == 0)
            pose = {"position": position, "orientation": (0.0, 0.0, 0.1 * np.sin(time), 1.0)}
            if topic == "truth":
                put(
                    topic,
                    new("nav_msgs/Odometry", header=header(at_ns), pose={"pose": pose}),
                    at_ns,
                )
            else:
                put(topic, new("geometry_msgs/PoseStamped", header=header(at_ns), pose=pose), at_ns)
            received.live.put(TICKS, packet, stamp_ns)
            writer.write_many(
                messages_of(expanded(of_packet, "quad1"), of_packet, "quad1", stamp_ns + 10_000_000)
            )
            received.clock.now += 0.01
            if k % 25 == 24:
                received.log.take()
                seen.append(tracking.summary(laps=2, duration=5.0))
    return tracking, seen


@pytest.mark.parametrize("topic", ["truth", "tracker_pose"])
def test_live_figures_are_those_of_the_log_to_the_last_digit(tmp_path: Path, topic: str) -> None:
    _, seen = flown(tmp_path / "a.mcap", topic)
    assert [one is None for one in seen[:8]] == [True] * 8
    figures = [one for one in seen if one is not None]
    assert {one["behavior"] for one in figures} == {"hover", "follow_trajectory"}
    laps = [one["lap_number"] for one in figures if one["behavior"] == "follow_trajectory"]
    assert (laps[0], laps[-1], sorted(laps)) == (1, 2, laps)
    for one in (figures[0], figures[7], figures[-1], figures[-1]["lap"]):
        log = tracking_errors(tmp_path / "a.mcap", "quad1", one["from"], one["to"]).metrics()
        assert {name: one[name] for name in log} == log
        assert log["samples"] > 10
    left_out = figures[-1].get("poses_left_out")
    assert left_out is None if topic == "truth" else 0.0 < left_out < 0.1
    assert seen[-1] is None
