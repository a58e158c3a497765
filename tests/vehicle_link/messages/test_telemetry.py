"""Telemetry: five ticks in one datagram."""

from __future__ import annotations

import numpy as np
import pytest

from quadrotor.errors import LinkError
from quadrotor.records import TICK, Record
from vehicle_link.messages import decode
from vehicle_link.telemetry import SAMPLES_A_PACKET, pack, unpack

SEED = 42
PARTS = ("state", "reference", "actuators")


def _ticks(count: int) -> Record:
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    ticks = np.zeros(count, TICK)
    for part in (*PARTS, "imu"):
        for name in TICK[part].names or ():
            ticks[part][name] = rng.normal(size=ticks[part][name].shape)
    ticks["imu"]["stamp_ns"] = 10**18 + 2_000_003 * np.arange(count)
    return ticks


@pytest.mark.parametrize("count", [1, 2, 5, 7])
def test_ticks_survive_to_float32_and_stamps_exactly(count: int) -> None:
    ticks = _ticks(count)
    sequence, back = unpack(pack(ticks, 17))
    assert sequence == 17
    np.testing.assert_array_equal(back["imu"]["stamp_ns"], ticks["imu"]["stamp_ns"])
    for part in PARTS:
        for name in TICK[part].names or ():
            np.testing.assert_array_equal(back[part][name], ticks[part][name].astype("f4"))
    for name in ("specific_force_b", "angular_velocity_b"):
        np.testing.assert_array_equal(back["imu"][name], ticks["imu"][name].astype("f4"))


@pytest.mark.filterwarnings("error")
def test_what_diverges_beyond_float32_travels_as_inf() -> None:
    ticks = _ticks(2)
    ticks["state"]["velocity_w"][1] = 1e39, -1e39, 1.0
    _, back = unpack(pack(ticks, 0))
    assert back["state"]["velocity_w"][1].tolist() == [np.inf, -np.inf, 1.0]


def test_a_sample_has_the_documented_order() -> None:
    ticks = _ticks(1)
    samples = decode(pack(ticks, 0), "quadlab_msgs/Telemetry").samples
    assert len(samples) == 50
    order = [("state", "position_w", 0), ("state", "quaternion_wb", 6)]
    order += [
        ("reference", "position_w", 13),
        ("reference", "snap_w", 25),
        ("reference", "yaw", 28),
    ]
    order += [("imu", "specific_force_b", 31), ("imu", "angular_velocity_b", 34)]
    order += [
        ("actuators", "wrench", 37),
        ("actuators", "thrusts", 41),
        ("actuators", "scaling", 49),
    ]
    for part, name, place in order:
        first = ticks[part][name].ravel()[0]
        assert samples[place] == np.float32(first), (part, name)


def test_a_packet_fits_one_datagram() -> None:
    assert len(pack(_ticks(SAMPLES_A_PACKET), 0)) + 33 <= 1100


def test_a_strided_slice_of_a_ring_is_packed_as_its_copy() -> None:
    ticks = _ticks(6)
    assert pack(ticks[::2], 1) == pack(ticks[::2].copy(), 1)


def test_sequence_counts_modulo_32_bits() -> None:
    assert unpack(pack(_ticks(1), 2**32 + 5))[0] == 5


def test_ticks_from_before_a_long_pause_are_left_out() -> None:
    ticks = _ticks(4)
    ticks["imu"]["stamp_ns"] = 0, 2_000_000, 9_000_000_000, 9_002_000_000
    _, back = unpack(pack(ticks, 0))
    assert back["imu"]["stamp_ns"].tolist() == [9_000_000_000, 9_002_000_000]


@pytest.mark.parametrize("payload", [b"", b"\x00\x01\x00\x00", b"\x00" * 1048])
def test_bytes_that_are_no_telemetry_are_refused(payload: bytes) -> None:
    with pytest.raises(LinkError):
        unpack(payload)


def test_counts_that_do_not_agree_are_refused() -> None:
    payload = bytearray(pack(_ticks(2), 0))
    payload[20] = 3  # claims three offsets in a packet as long as two
    with pytest.raises(LinkError, match="layout of quadlab_msgs/Telemetry"):
        unpack(bytes(payload))
