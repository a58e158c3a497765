"""A page shows of a flight what the run's log has: each sample, at its tick."""

from __future__ import annotations

import numpy as np
import pytest

from console.exchange.telemetry import expanded, messages_of
from extensions.replay.build import build_replay
from extensions.replay.reader import Replay
from flight_log import LogWriter
from quadrotor.records import Record
from tests.support.live_signals import START_NS, Received, packets_of, ticks_of
from vehicle_link.messages import encode, new
from vehicle_link.telemetry import unpack
from web.latest import TICKS
from web.signals import NAMED, SIGNALS
from web.signals.expression import is_expression

DERIVED = [
    "speed = norm(state.velocity.x, state.velocity.y)",
    "= lowpass(error.distance, 5) + battery.voltage",
    "= truth.position_error - deviation.position",
]
LOST = (60, 61, 300)
"""Packets of telemetry that reached neither page nor log."""


def flight(count: int) -> Record:
    """Return ticks of a flight whose largest tracking error is at one of them."""
    ticks, random = ticks_of(count), np.random.default_rng(3)
    moving = np.cumsum(random.normal(0.0, 0.002, (count, 3)), axis=0)
    ticks["reference"]["position_w"] = moving
    ticks["state"]["position_w"] = moving + random.normal(0.0, 0.001, (count, 3))
    ticks["state"]["position_w"][1234] += (0.03, 0.0, 0.01)
    ticks["state"]["velocity_w"] = random.normal(0.0, 1.0, (count, 3))
    ticks["state"]["quaternion_wb"][:, 1:] = random.normal(0.0, 0.1, (count, 3))
    ticks["state"]["quaternion_wb"] /= np.linalg.norm(
        ticks["state"]["quaternion_wb"], axis=1, keepdims=True
    )
    ticks["imu"]["angular_velocity_b"] = random.normal(0.0, 0.5, (count, 3))
    ticks["actuators"]["thrusts"] = random.uniform(2.0, 4.0, (count, 4))
    return ticks


def others(time: float, random: np.random.Generator) -> list[tuple[str, float, bytes]]:
    """Return messages of other rates around a time (s): topic, stamp, payload."""
    found = []
    pose = {"pose": {"position": random.normal(0, 1, 3), "orientation": (0.0, 0.0, 0.0, 1.0)}}
    found.append(("truth", time + 0.0007, encode(new("nav_msgs/Odometry", pose=pose))))
    if round(time / 0.01) % 2 == 0:
        told = new("quadlab_msgs/EstimatorStatus", position_variance=random.uniform(0, 1e-3, 3))
        found.append(("estimator", time + 0.0003, encode(told)))
    if round(time / 0.01) % 50 == 0:
        battery = new("sensor_msgs/BatteryState", voltage=15.0 + random.normal())
        found.append(("battery", time, encode(battery)))
    return found


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Received, Replay]:
    """Return a flight as the page received it, and the replay of its log."""
    received, random = Received(), np.random.default_rng(5)
    types = {
        "truth": "nav_msgs/Odometry",
        "estimator": "quadlab_msgs/EstimatorStatus",
        "battery": "sensor_msgs/BatteryState",
    }
    log = tmp_path_factory.mktemp("run") / "a.mcap"
    received.log.keep(DERIVED)
    with LogWriter(log, {"vehicle": "quad1", "recorder": "station"}, {}) as writer:
        for k, packet in enumerate(packets_of(flight(2500))):
            ticks = unpack(packet)[1]
            stamp = int(ticks["imu"]["stamp_ns"][-1])
            if k not in LOST:
                received.live.put(TICKS, packet, stamp)
                payloads = expanded(ticks, "quad1")
                writer.write_many(messages_of(payloads, ticks, "quad1", stamp + 10_000_000))
            for topic, time, payload in others(0.01 * k, random):
                source_ns = START_NS + round(1e9 * time)
                received.live.put(topic, payload, source_ns)
                row = (f"/quad1/{topic}", types[topic], payload)
                writer.write(*row, source_ns + 10_000_000, source_ns)
            received.clock.now += 0.01
            if k % 4 == 0:
                received.log.take()
                received.log.advance()
    received.log.take()
    received.clock.now += 10.0
    received.log.advance()
    build_replay(log, lambda share: None)
    return received, Replay(log)


@pytest.mark.parametrize("name", [*(one.name for one in SIGNALS[:NAMED]), *DERIVED])
def test_each_sample_is_the_log_s(flown: tuple[Received, Replay], name: str) -> None:
    received, replay = flown
    if not is_expression(name) and not replay._samples.has(name):
        assert not received.log.formed(name)
        return
    times, count = replay._samples.times(name), received.log.formed(name)
    shift = 1e-9 * (received.log.origin_ns - replay._run.start_ns)
    assert count == len(times)
    np.testing.assert_allclose(received.log.times(name) + shift, times, atol=1e-8)
    mine = received.log.values(name, 0, count)
    its = replay._samples.values(name, 0, count)
    if name in ("state.position.x", "error.distance", "state.roll", DERIVED[0]):
        np.testing.assert_array_equal(mine, its)
    # The times of other topics are counted from another origin.
    np.testing.assert_allclose(mine, its, rtol=1e-5, atol=1e-6)


def test_the_largest_tracking_error_and_every_lost_tick_are_seen(
    flown: tuple[Received, Replay],
) -> None:
    received, replay = flown
    error, log = received.samples("error.distance"), received.log.log("state")
    assert log is not None
    [logged] = replay.statistics(["error.distance"], 0.0, 10.0).values()
    assert max(error) == logged["max"]
    assert max(error) > 30.0  # mm
    assert list(log.missing(0, len(log.time)).values()) == [10, 5]
    assert len(error) == 2500 - 15
