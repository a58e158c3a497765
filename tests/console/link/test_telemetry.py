"""Quality figures and standard topics that the station derives from telemetry."""

from __future__ import annotations

import numpy as np
import pytest

from console.exchange.telemetry import expanded, messages_of
from console.link.telemetry_quality import TelemetryWindow
from quadrotor.records import TICK, Record
from vehicle_link.messages import decode
from vehicle_link.telemetry import pack, unpack
from vehicle_link.topics.control_inputs import decode_external_reference
from vehicle_link.topics.ticks import TICK_TOPICS, decode_imu, decode_odometry

MS = 1_000_000


def ticks(count: int = 5) -> Record:
    """Return consecutive ticks at 500 Hz with different numbers in every field."""
    out = np.zeros(count, TICK)
    random = np.random.default_rng(1)
    out["imu"]["stamp_ns"] = 10**18 + 2 * MS * np.arange(count)
    out["state"]["position_w"] = random.normal(size=(count, 3))
    out["state"]["velocity_w"] = random.normal(size=(count, 3))
    out["state"]["quaternion_wb"] = [0.5, 0.5, -0.5, 0.5]
    out["reference"]["snap_w"] = random.normal(size=(count, 3))
    out["actuators"]["wrench"] = random.normal(size=(count, 4))
    out["imu"]["specific_force_b"] = random.normal(size=(count, 3))
    return out


def test_every_sample_of_a_packet_comes_out_on_every_topic_with_its_stamp() -> None:
    sent = ticks()
    _, received = unpack(pack(sent, 7))
    messages = messages_of(expanded(received, "quad1"), received, "quad1", received_ns=42)
    assert len(messages) == 4 * 5
    assert {m[0] for m in messages} == {f"/quad1/{topic}" for topic in TICK_TOPICS}
    assert {m[3] for m in messages} == {42}
    for topic in TICK_TOPICS:
        stamps = [m[4] for m in messages if m[0] == f"/quad1/{topic}"]
        assert stamps == sent["imu"]["stamp_ns"].tolist()


def test_the_numbers_of_a_tick_survive_the_radio_in_single_precision() -> None:
    sent = ticks()
    _, received = unpack(pack(sent, 7))
    payloads = expanded(received, "quad1")
    stamp, state = decode_odometry(payloads["state"][3])
    assert stamp == sent["imu"]["stamp_ns"][3]
    for field in ("position_w", "velocity_w", "quaternion_wb"):
        np.testing.assert_allclose(state[field][0], sent["state"][field][3], atol=1e-6)
    np.testing.assert_allclose(
        decode_external_reference(payloads["reference"][0])[1]["snap_w"][0],
        sent["reference"]["snap_w"][0],
        rtol=1e-6,
    )
    np.testing.assert_allclose(
        decode_imu(payloads["imu"][1])["specific_force_b"][0],
        sent["imu"]["specific_force_b"][1],
        rtol=1e-6,
    )
    np.testing.assert_allclose(
        decode(payloads["actuators"][4], "quadlab_msgs/Actuators").thrust,
        sent["actuators"]["wrench"][4, 0],
        rtol=1e-6,
    )


def fed(window: TelemetryWindow, sequence: int, stamp_ns: int, received_ns: int) -> bool:
    """Feed a packet on a system clock that is never set; return the result of `feed`."""
    return window.feed(sequence, stamp_ns, received_ns, received_ns)


def test_a_steady_stream_has_its_rate_no_loss_and_no_jitter() -> None:
    window = TelemetryWindow()
    for k in range(500):
        assert fed(window, k, 10 * k * MS, 10 * k * MS + 3 * MS)
    quality = window.quality(4990 * MS + 3 * MS)
    assert quality.rate == pytest.approx(100, abs=1)
    assert quality.loss == 0
    assert quality.jitter == 0


def test_missing_packets_are_the_loss_and_uneven_ones_the_jitter() -> None:
    seed = 4
    random = np.random.default_rng(seed)
    window = TelemetryWindow()
    for k in range(2000):
        if random.random() > 0.2:
            fed(window, k, 10 * k * MS, round((10 * k + random.normal(20, 2)) * MS))
    quality = window.quality(20_000 * MS)
    assert quality.loss == pytest.approx(0.2, abs=0.08), f"seed {seed}"
    assert quality.jitter == pytest.approx(0.002, rel=0.2), f"seed {seed}"


def test_a_late_packet_is_not_the_newest_and_a_doubled_one_no_gain() -> None:
    window = TelemetryWindow()
    assert fed(window, 1, 10 * MS, 11 * MS)
    assert fed(window, 3, 30 * MS, 31 * MS)
    assert not fed(window, 2, 20 * MS, 32 * MS)
    assert not fed(window, 3, 30 * MS, 33 * MS)
    assert window.newest_stamp_ns == 30 * MS
    assert window.quality(40 * MS).loss == 0


def test_a_restarted_vehicle_is_no_loss_and_is_followed() -> None:
    window = TelemetryWindow()
    for k in range(100):
        fed(window, 100_000 + k, 10**15 + 10 * k * MS, 10 * k * MS)
    assert fed(window, 0, 0, 1010 * MS)
    assert fed(window, 1, 10 * MS, 1020 * MS)
    assert window.quality(1030 * MS).loss == 0


def test_silence_is_rate_zero() -> None:
    window = TelemetryWindow()
    fed(window, 0, 0, 0)
    assert window.quality(3000 * MS).rate == 0
