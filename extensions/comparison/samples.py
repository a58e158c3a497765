"""A gapless series of IMU samples from telemetry, each with the frames due after it."""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Sequence
from enum import Enum, auto
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from quadrotor.records import IMU_SAMPLE, Record

NOMINAL_STEP, LONGEST_STEP = 0.002, 0.05
"""Seconds: step of the first sample, and the longest step."""
BRIDGE_STEP = 0.01
LONGEST_GAP = 0.5
"""Seconds without telemetry after which the motion in between is unknown."""
OTHER_LIFE_NS = 1_000_000_000
"""Age in ns beyond which stamps belong to a vehicle that was restarted."""
BEHIND = 3
"""Number of such packets in a row that are needed: a single one may have been delayed."""
WAITING = 128


class PacketEvent(Enum):
    """The result of adding a packet."""

    GOES_ON = auto()
    GAP = auto()  # contiguous, after more than LONGEST_GAP
    RESTARTED = auto()
    NOTHING_NEW = auto()  # old samples: reordered, or repeated


class Stretch(NamedTuple):
    """IMU_SAMPLE (N,), the step to each (s), and (index, BEARINGS_SAMPLE) due after samples."""

    event: PacketEvent
    imu: Record
    steps: Sequence[float]
    frames: Sequence[tuple[int, Record]]


class SampleQueue:
    """Orders samples and frames. Frames wait for the telemetry of their instant; late ones follow
    the next sample.
    """

    def __init__(self) -> None:
        self._newest: Record | None = None  # IMU_SAMPLE (1,)
        self._newest_ns = 0
        self._behind = 0
        self._waiting: list[tuple[int, Record]] = []

    def frame(self, stamp_ns: int, record: Record) -> None:
        """Queue a BEARINGS_SAMPLE; frames of equal stamps stay in order."""
        insort(self._waiting, (stamp_ns, record), key=itemgetter(0))
        del self._waiting[:-WAITING]

    def packet(self, imu: Record) -> Stretch:
        """Return the new samples, IMU_SAMPLE (N,), in order. Samples that are not newer than the
        newest are skipped.
        """
        event = PacketEvent.GOES_ON
        stamps = imu["stamp_ns"].tolist()
        last_ns = stamps[-1]
        if self._newest is not None:
            self._behind = self._behind + 1 if last_ns < self._newest_ns - OTHER_LIFE_NS else 0
            if self._behind >= BEHIND:
                self._newest, event = None, PacketEvent.RESTARTED
        if self._newest is not None:
            if not min(stamps) > self._newest_ns:
                imu = imu[imu["stamp_ns"] > self._newest_ns]
            if not len(imu):
                return Stretch(PacketEvent.NOTHING_NEW, imu, (), ())
            gap = 1e-9 * (int(imu["stamp_ns"][0]) - self._newest_ns)
            if gap > LONGEST_GAP:
                event = PacketEvent.GAP
            elif gap > LONGEST_STEP:
                imu = np.concatenate((bridge(self._newest, imu[:1], gap), imu))
        stamps = imu["stamp_ns"].tolist()
        before_ns = self._newest_ns if self._newest is not None else stamps[0] - 2_000_000
        # On plain numbers, as numpy takes longer for the few of a packet.
        pairs = zip([before_ns, *stamps], stamps, strict=False)
        steps = [min(1e-9 * (after - before), LONGEST_STEP) for before, after in pairs]
        if event is not PacketEvent.GOES_ON:
            steps[0] = NOMINAL_STEP
        if event is PacketEvent.RESTARTED:
            self._waiting = [one for one in self._waiting if one[0] < last_ns + OTHER_LIFE_NS]
        self._newest, self._newest_ns, self._behind = imu[-1:].copy(), stamps[-1], 0
        return Stretch(event, imu, steps, self._due(imu))

    def _due(self, imu: Record) -> list[tuple[int, Record]]:
        ready = [one for one in self._waiting if one[0] <= self._newest_ns]
        if not ready:
            return []
        del self._waiting[: len(ready)]
        old_ns = int(imu["stamp_ns"][0]) - OTHER_LIFE_NS
        ready = [one for one in ready if one[0] > old_ns]
        places = np.searchsorted(imu["stamp_ns"], [stamp_ns for stamp_ns, _ in ready])
        return [(int(k), frame) for k, (_, frame) in zip(places, ready, strict=True)]


def bridge(before: Record, after: Record, gap: float) -> Record:
    """Return samples linearly interpolated between two (1,) that are `gap` s apart."""
    count = math.ceil(gap / BRIDGE_STEP) - 1
    out = np.zeros(count, IMU_SAMPLE)
    share = np.arange(1, count + 1) / (count + 1)
    for field in ("specific_force_b", "angular_velocity_b"):
        out[field] = before[field] + share[:, None] * (after[field] - before[field])
    out["stamp_ns"] = before["stamp_ns"] + np.round(share * (gap * 1e9)).astype(np.int64)
    return out
