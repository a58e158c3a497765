"""Consecutive ticks in one datagram: quadlab_msgs/Telemetry, float32, at most 5 ticks.

The vehicle sends it 100 times a second; the station expands it into the standard topics.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from quadrotor.errors import LinkError
from quadrotor.records import TICK, Record, Stamps, offset_of
from vehicle_link.messages.cdr_layout import FixedLayout

SAMPLES_A_PACKET = 5
"""Ticks in one packet: 5 make 1048 bytes, with Zenoh's framing below the 1100 B of a datagram."""

FLOATS = 50
Samples = npt.NDArray[np.float32]
_SPAN_NS = 4_000_000_000  # what fits into uint32 nanoseconds, rounded down

# The float64 runs of a tick in the order of a sample: one copy for each, not for each field.
_RUNS = {"state": 13, "reference": 18, "imu": 6, "actuators": 13}


def _runs_dtype() -> np.dtype[np.void]:
    offsets = {name: offset_of(TICK, name) for name in _RUNS}
    offsets["imu"] += 8  # after its stamp
    return np.dtype(
        {
            "names": list(_RUNS),
            "formats": [("f8", (length,)) for length in _RUNS.values()],
            "offsets": [offsets[name] for name in _RUNS],
            "itemsize": TICK.itemsize,
        }
    )


_TICK_RUNS = _runs_dtype()
_PLACES = {
    name: slice(end - length, end)
    for (name, length), end in zip(_RUNS.items(), np.cumsum(list(_RUNS.values())), strict=True)
}


@cache
def _layout(count: int) -> FixedLayout:
    lengths = {"offsets_ns": count, "samples": FLOATS * count}
    return FixedLayout("quadlab_msgs/Telemetry", lengths=lengths)


def pack(ticks: Record, sequence: int) -> bytes:
    """Pack the given TICK records, shape (N,), N ≥ 1, into one packet.

    Ticks more than 4 s before the newest are left out (their offset would not fit); a value that
    float32 cannot represent is sent as inf.

    Args:
        ticks: consecutive ticks, oldest first.
        sequence: number of the packet; counts modulo 2³².
    """
    stamps = ticks["imu"]["stamp_ns"]
    offsets = stamps - stamps[0]
    if offsets[-1] >= _SPAN_NS or offsets[-1] < 0:
        ticks = ticks[np.abs(stamps - stamps[-1]) < _SPAN_NS]
        ticks = ticks[np.argsort(ticks["imu"]["stamp_ns"], kind="stable")]
        return pack(ticks, sequence)
    layout = _layout(len(ticks))
    record = layout.new()
    record["sequence"] = sequence & 0xFFFF_FFFF
    record["stamp_ns"] = stamps[0]
    record["offsets_ns"][0] = offsets
    samples = record["samples"].reshape(-1, FLOATS)
    runs = np.ascontiguousarray(ticks).view(_TICK_RUNS)
    with np.errstate(over="ignore"):
        for name, place in _PLACES.items():
            samples[:, place] = runs[name]
    return record.tobytes()


def unpack(payload: bytes) -> tuple[int, Record]:
    """Unpack a packet: (sequence of the packet, TICK records of shape (N,)).

    Estimate, status and the ticks' own sequence are not sent, and are zero.

    Raises:
        LinkError: the bytes are not telemetry of this version.
    """
    sequence, stamps_ns, samples = unpack_samples(payload)
    return sequence, ticks_of(stamps_ns, samples)


def unpack_samples(payload: bytes) -> tuple[int, Stamps, Samples]:
    """Unpack a packet as it was sent: (its sequence, stamps (N,) in ns, samples (N, FLOATS)).

    Raises LinkError as `unpack` does.
    """
    count = (len(payload) - _layout(1).size) // (4 * (1 + FLOATS)) + 1
    if count < 1:
        raise LinkError(f"{len(payload)} bytes are too few for a telemetry packet")
    record = _layout(count).decode(payload)
    stamps_ns = record["stamp_ns"] + record["offsets_ns"].astype(np.int64)
    return int(record["sequence"]), stamps_ns, record["samples"].reshape(-1, FLOATS)


def ticks_of(stamps_ns: Stamps, samples: Samples) -> Record:
    """Return the TICK records, shape (N,), of unpacked samples."""
    ticks = np.zeros(len(samples), TICK)
    ticks["imu"]["stamp_ns"] = stamps_ns
    runs = ticks.view(_TICK_RUNS)
    for name, place in _PLACES.items():
        runs[name] = samples[:, place]
    return ticks
