"""The station's tracker and emulator: at once without delay, on time with one."""

from __future__ import annotations

import threading

import numpy as np

from bearing_sim import (
    BearingMeasurement,
    BearingParameters,
    PoseMeasurement,
    TrackerParameters,
)
from console.tracker_feed import TrackerFeed

HERE, LEVEL = np.array([0.1, 0.2, 1.0]), np.array([1.0, 0, 0, 0])
MS = 1_000_000


class Sink:
    """Collects what is sent; `came` counts poses and frames together."""

    def __init__(self) -> None:
        self.poses: list[PoseMeasurement] = []
        self.frames: list[BearingMeasurement] = []
        self.came = threading.Semaphore(0)

    def pose(self, pose: PoseMeasurement) -> None:
        self.poses.append(pose)
        self.came.release()

    def frame(self, frame: BearingMeasurement) -> None:
        self.frames.append(frame)
        self.came.release()


def test_without_delay_pose_and_bearings_leave_with_the_truth() -> None:
    sink = Sink()
    feed = TrackerFeed(TrackerParameters(), BearingParameters(), sink.pose, sink.frame)
    assert feed.silence is None
    for k in range(100):
        feed.truth(10**18 + 10 * k * MS, HERE, LEVEL)
    assert [p.stamp_ns for p in sink.poses] == [10**18 + 10 * k * MS for k in range(100)]
    assert 29 <= len(sink.frames) <= 31
    assert {f.stamp_ns for f in sink.frames} <= {p.stamp_ns for p in sink.poses}
    assert feed.rate == 100
    assert feed.silence is not None
    feed.close()


def test_bearings_are_seen_from_the_tracked_pose_noise_included() -> None:
    sink = Sink()
    feed = TrackerFeed(
        TrackerParameters(position_noise=0.2),
        BearingParameters(sigma=0.0),
        sink.pose,
        sink.frame,
    )
    feed.truth(0, HERE, LEVEL)
    feed.close()
    [pose], [frame] = sink.poses, sink.frames
    truth_to_beacon = np.array([1.0, 1.0, 0.1]) - HERE
    assert np.linalg.norm(pose.position_w - HERE) > 0.01
    assert not np.allclose(frame.bearings_b[0], truth_to_beacon / np.linalg.norm(truth_to_beacon))


def test_a_delayed_pose_comes_by_itself_with_the_stamp_of_its_truth() -> None:
    sink = Sink()
    feed = TrackerFeed(TrackerParameters(delay=0.03), BearingParameters(), sink.pose, sink.frame)
    feed.truth(10**18, HERE, LEVEL)
    assert sink.poses == []
    for _ in range(2):  # the pose, and the frame seen from it
        assert sink.came.acquire(timeout=5.0)
    assert sink.poses[0].stamp_ns == sink.frames[0].stamp_ns == 10**18
    feed.close()


def test_parameters_can_change_while_it_runs() -> None:
    sink, tracker = Sink(), TrackerParameters()
    feed = TrackerFeed(tracker, BearingParameters(), sink.pose, sink.frame)
    tracker.drop_out = 1.0
    for k in range(10):
        feed.truth(10 * k * MS, HERE, LEVEL)
    assert sink.poses == []
    tracker.drop_out = 0.0
    feed.truth(100 * MS, HERE, LEVEL)
    assert len(sink.poses) == 1
    feed.close()
