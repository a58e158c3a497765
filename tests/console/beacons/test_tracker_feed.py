"""The station's tracker and emulator: at once without delay, on time with one."""

from __future__ import annotations

import threading

import numpy as np

from bearing_sim import (
    PRESETS,
    BearingMeasurement,
    BearingParameters,
    PoseMeasurement,
    TrackerParameters,
)
from console.tracker_feed import ENDED, TrackerFeed
from quadrotor.plain_rotations import matrix_of
from tests.support.narrowing import now
from vehicle_link.messages import new

HERE, LEVEL = np.array([0.1, 0.2, 1.0]), np.array([1.0, 0, 0, 0])
MS = 1_000_000


class Sink:
    """Receiver of what is sent; `came` counts poses and frames together."""

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
    assert feed.alarm is None
    for k in range(100):
        feed.truth(10**18 + 10 * k * MS, HERE, LEVEL)
    assert [p.stamp_ns for p in sink.poses] == [10**18 + 10 * k * MS for k in range(100)]
    assert [f.stamp_ns for f in sink.frames] == [
        10**18 + round(k * 1e9 / 30) for k in range(len(sink.frames))
    ]
    assert len(sink.frames) == 30
    assert feed.rate == 100
    assert now(feed).alarm is None
    feed.close()


def test_bearings_are_seen_from_the_tracked_pose_noise_included() -> None:
    sink = Sink()
    feed = TrackerFeed(
        TrackerParameters(position_noise=0.2), BearingParameters(sigma=0.05), sink.pose, sink.frame
    )
    feed.truth(0, HERE, LEVEL)
    feed.close()
    [pose], [frame] = sink.poses, sink.frames
    from_truth, from_pose = (np.array([1.0, 1.0, 0.1]) - p for p in (HERE, pose.position_w))
    assert np.linalg.norm(pose.position_w - HERE) > 0.05
    bearing_w = matrix_of(pose.quaternion_wb) @ frame.bearings_b[0]
    assert np.linalg.norm(bearing_w - from_pose / np.linalg.norm(from_pose)) < 0.005
    assert np.linalg.norm(bearing_w - from_truth / np.linalg.norm(from_truth)) > 0.02


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


def test_delayed_poses_give_frames_at_the_instants_they_were_true() -> None:
    sink = Sink()
    bearings = BearingParameters(rate=50.0)
    feed = TrackerFeed(TrackerParameters(delay=0.03), bearings, sink.pose, sink.frame)
    for k in range(20):
        feed.truth(10**18 + 10 * k * MS, HERE, LEVEL)
    for _ in range(20 + 10):
        assert sink.came.acquire(timeout=5.0)
    assert [f.stamp_ns for f in sink.frames] == [10**18 + 20 * k * MS for k in range(10)]
    feed.close()


def test_a_layout_that_changes_while_it_runs_is_seen_at_the_next_frame() -> None:
    sink, bearings = Sink(), BearingParameters(rate=100.0)
    feed = TrackerFeed(TrackerParameters(), bearings, sink.pose, sink.frame)
    feed.truth(0, HERE, LEVEL)
    bearings.layout = "eight"
    feed.truth(10 * MS, HERE, LEVEL)
    bearings.lost = "all"
    feed.truth(20 * MS, HERE, LEVEL)
    feed.close()
    assert [len(f.beacon_ids) for f in sink.frames] == [4, 8, 0]


def test_beside_a_camera_on_board_no_bearings_are_emulated_and_its_problems_are_told() -> None:
    sink, clock = Sink(), [0.0]
    feed = TrackerFeed(
        TrackerParameters(),
        BearingParameters(layout="wall"),
        sink.pose,
        sink.frame,
        lambda: clock[0],
    )
    feed.truth(0, HERE, LEVEL)
    assert (len(sink.frames), feed.bearings_nominal, feed.camera_alarm) == (1, 30.0, None)
    feed.note_camera_status(
        new("quadlab_msgs/TrackerStatus", problem="the picture is black", frame_rate=20.0)
    )
    for k in range(1, 50):
        feed.truth(10 * k * MS, HERE, LEVEL)
    assert len(sink.frames) == 1
    assert len(sink.poses) == 50  # the simulated tracker continues
    assert feed.camera_alarm == "camera on board: the picture is black"
    assert feed.bearings_nominal == 20.0
    seen = BearingMeasurement(7, np.array([3], np.int32), np.array([[1.0, 0.0, 0.0]]), 0.002)
    feed.seen(seen)
    assert sink.frames[-1].stamp_ns == 7
    assert sink.frames[-1].beacons == PRESETS["wall"]
    clock[0] += 0.5
    assert "its process is silent" in str(feed.camera_alarm)
    assert not feed.forget_ended_camera(), "it was not ended on purpose"
    feed.note_camera_status(new("quadlab_msgs/TrackerStatus", problem=ENDED, frame_rate=0.0))
    assert feed.camera_alarm == f"camera on board: {ENDED}", "until the vehicle is disarmed"
    frames = len(sink.frames)
    assert feed.forget_ended_camera()
    for k in range(50, 60):
        feed.truth(10 * k * MS, HERE, LEVEL)
    assert now(feed.camera_alarm) is None
    assert feed.bearings_nominal == 30.0
    assert len(sink.frames) > frames
    feed.close()
